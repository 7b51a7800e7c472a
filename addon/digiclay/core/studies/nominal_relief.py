"""Nominal relief of a session, and the deviation of the formed one.

It is the relief that the method's blister, moved along the fingertip's path, leaves behind. For a
boss, ``H_j = H_rest + max_t p(d_j(t)) (z(t) + c - H_rest)``, with the minimum for a crease; p is
the blister's profile, d_j the distance from cell j to the fingertip, z the height of the
fingertip's lowest point, and c the indentation by the pins. The blister of Method II begins at the
nearest cell under the fingertip: there d_j is less by the radius of a disc of as many cells as
follow, less half a pitch.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..base.arrays import Array, Floats
from ..base.modes import FORCE_FOLLOW
from ..control.blister import Blister
from ..metrics.signals import find_stretches
from ..metrics.summary import compute_cell_area, find_contact_rows, split_fingers
from ..scene.schema import Scene

#: One of this many rows of a history is evaluated.
THINNED = 4


class ReliefError(NamedTuple):
    """Deviation of a formed relief from the nominal one, over the cells that the blister has covered.

    Cells within a blister of where contact began or ended have no relief, and are left out.
    """

    #: m; None if no cell was covered, or the method has no blister.
    rms: float | None
    largest: float | None


def find_nominal(
    scene: Scene, history: Mapping[str, Array], following: Array, pressed: float = 0.0
) -> Floats:
    """Return the nominal heights over the bed at rest, (n,), m."""
    assert scene.blister is not None
    position, tip = history["position"], history["fingertip"]
    rise = tip[:, 2] + pressed - scene.actuator.rest_height
    patch = measure_reach(scene, position, following)
    boss, crease = np.zeros((2, len(position)))
    for center, over, wide in zip(tip[:, :2], rise, patch, strict=True):
        swept = evaluate_share(scene.blister, np.hypot(*(position - center).T) - wide) * over
        np.maximum(boss, swept, out=boss)
        np.minimum(crease, swept, out=crease)
    # Cells that were first pressed in and then raised belong to a boss.
    return np.where(boss > 0.0, boss, crease)


def measure_relief(
    scene: Scene, history: Mapping[str, Array], pressed: float | None
) -> ReliefError:
    """Return the deviation of the final heights from the nominal ones, of all fingers together."""
    if scene.blister is None or pressed is None:
        return ReliefError(None, None)
    nominal = np.zeros(scene.cells)
    clear = np.ones(scene.cells, dtype=bool)
    for part in split_fingers(history):
        following = np.count_nonzero(part["mode"] == FORCE_FOLLOW, axis=1)
        touching = find_contact_rows(part["total_force"]) & (following > 0)
        rows = np.flatnonzero(touching)[::THINNED]
        path = {"fingertip": part["fingertip"][rows], "position": part["position"]}
        by_finger = find_nominal(scene, path, following[rows], pressed)
        boss = np.maximum(nominal, by_finger)
        nominal = np.where(boss > 0.0, boss, np.minimum(nominal, by_finger))
        for stretch in find_stretches(touching):
            for row in (stretch.start, stretch.stop - 1):
                away = part["position"] - part["fingertip"][row, :2]
                clear &= np.hypot(*away.T) > scene.blister.radius
    covered = (nominal != 0.0) & clear
    if not np.any(covered):
        return ReliefError(None, None)
    off = (history["height"][-1] - scene.actuator.rest_height - nominal)[covered]
    return ReliefError(float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()))


def measure_reach(scene: Scene, position: Floats, following: Array) -> Floats:
    """Return the radius of the cells' axes under the fingertip, (t,), m; 0 except for Method II."""
    if scene.method != "cell_states":
        return np.zeros(len(following))
    side = np.sqrt(compute_cell_area(position) or 0.0)
    return np.maximum(side * (np.sqrt(following / np.pi) - 0.5), 0.0)


def evaluate_share(blister: Blister, distance: Floats) -> Floats:
    """Return the profile p(d), 0 outside the blister. `distance`: from its middle, m."""
    inside = np.maximum(distance, 0.0)
    profile = np.maximum(blister.evaluate_profile(inside), 0.0)
    return np.where(inside < blister.radius, profile, 0.0)
