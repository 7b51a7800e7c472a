"""Nominal relief of a session, and the deviation of the formed one.

It is what the method's own blister, carried along the fingertip's path, leaves behind:
``H_j = H_rest + max_t p(d_j(t)) (z(t) + c - H_rest)`` for a boss, with the least instead of the greatest for
a crease; p is the blister's profile, d_j the distance from cell j to the fingertip, z the height of the
fingertip's lowest point, and c how deep the pins press into it. Method II counts its blister from the nearest
cell under the fingertip: there d_j is less by how far the middles of the cells of a disc reach that has as
many cells as follow, the disc's radius less half a pitch.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.modes import Mode
from ..control.blister import Blister
from ..metrics.summary import compute_cell_area, find_contact_rows, find_stretches, split_fingers
from ..scene.schema import Scene

#: Rows of a history of which one is taken.
THINNED = 4


class ReliefError(NamedTuple):
    """Deviation of a formed relief from the nominal one, over the cells that the blister has covered.

    Where the fingertip pressed first or left is no relief: cells within a blister of it are left out.
    """

    #: m; None where no cell was covered, or the method has no blister.
    rms: float | None
    largest: float | None


def find_nominal(
    scene: Scene, history: Mapping[str, NDArray[Any]], following: NDArray[Any], pressed: float = 0.0
) -> Floats:
    """Return the nominal heights over the bed at rest, shape (n,), m."""
    assert scene.blister is not None
    rest, place, tip = scene.actuator.rest_height, history["position"], history["fingertip"]
    patch = measure_reach(scene, place, following)
    boss, crease = np.zeros(len(place)), np.zeros(len(place))
    for center, over, wide in zip(tip[:, :2], tip[:, 2] + pressed - rest, patch, strict=True):
        swept = evaluate_share(scene.blister, np.hypot(*(place - center).T) - wide) * over
        np.maximum(boss, swept, out=boss)
        np.minimum(crease, swept, out=crease)
    # What was pressed in first and raised afterwards is a boss.
    return np.where(boss > 0.0, boss, crease)


def measure_relief(scene: Scene, history: Mapping[str, NDArray[Any]], pressed: float | None) -> ReliefError:
    """Return how far the final heights are from the nominal ones, of all fingers together."""
    if scene.blister is None or pressed is None:
        return ReliefError(None, None)
    nominal = np.zeros(scene.cells)
    clear = np.ones(scene.cells, dtype=bool)
    for own in split_fingers(history):
        following = np.count_nonzero(own["mode"] == Mode.FORCE_FOLLOW, axis=1)
        touching = find_contact_rows(own["total_force"]) & (following > 0)
        rows = np.flatnonzero(touching)[::THINNED]
        path = {"fingertip": own["fingertip"][rows], "position": own["position"]}
        found = find_nominal(scene, path, following[rows], pressed)
        boss = np.maximum(nominal, found)
        nominal = np.where(boss > 0.0, boss, np.minimum(nominal, found))
        for stretch in find_stretches(touching):
            for row in (stretch.start, stretch.stop - 1):
                away = own["position"] - own["fingertip"][row, :2]
                clear &= np.hypot(*away.T) > scene.blister.radius
    covered = (nominal != 0.0) & clear
    if not np.any(covered):
        return ReliefError(None, None)
    off = (history["height"][-1] - scene.actuator.rest_height - nominal)[covered]
    return ReliefError(float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()))


def measure_reach(scene: Scene, position: Floats, following: NDArray[Any]) -> Floats:
    """Return how far the middles of the cells under the fingertip reach, (t,), m; 0 but for Method II."""
    if scene.method != "cell_states":
        return np.zeros(len(following))
    side = np.sqrt(compute_cell_area(position) or 0.0)
    return np.asarray(np.maximum(side * (np.sqrt(following / np.pi) - 0.5), 0.0))


def evaluate_share(blister: Blister, distance: Floats) -> Floats:
    """Return the profile p(d), 0 outside the blister. `distance`: from its middle, m."""
    inside = np.maximum(distance, 0.0)
    share: Floats = np.where(inside < blister.radius, np.maximum(blister.evaluate_profile(inside), 0.0), 0.0)
    return share
