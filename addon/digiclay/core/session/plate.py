"""A finger over a whole bed: its closed form on a flat plate, and what the lattice of pins makes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..model.contact import ExponentialLaw
from ..model.fingertip import LEVEL, Fingertip, compute_forms, compute_underside
from ..model.layout import Layout, make_grid
from ..scene.schema import Scene
from .probes import require_scene

#: Deepest indentation of the closed form, as a share of the height of the fingertip: from there on the
#: underside is not that of the ellipsoid, see `fingertip.JOIN`.
DEEPEST = 0.8
#: Depth at which a lattice is judged, as a share of the height of the fingertip: 2 mm of the paper's.
JUDGED = 0.25
#: Places along a pitch and along two row spacings at which it is judged; spread that is tolerated, and
#: spread from which every method loses the force of the finger, or the finger (7 mm for the paper's).
PLACES, COARSE, LOST = (8, 16), 0.01, 0.5


def plate_force(scene: Scene, indentation: Floats | float) -> Floats:
    """Return the elastic force of the whole finger, level on a flat plate or on pins that are held.

    With u = max(δ - x0, 0) and e = exp(m u) - 1 it is ``f_d / A_cell 2π a_x a_y / a_z (b / m²)
    ((e - m u) - (e - m u - (m u)² / 2) / (m a_z))``: the law of a pin (equation 11) summed over the
    footprint, the mean of `force` over all places. It is no multiple of the law of a pin: measured
    forces of a whole finger are compared with this one. Held on, it falls as ``G(t) F``.

    Parameters
    ----------
    scene : Scene
        With one finger; its contact, fingertip and layout count.
    indentation : array_like
        Depth δ of the lowest point of the fingertip in the plate, m.

    Returns
    -------
    ndarray
        Force, N, of the shape of `indentation`.

    Raises
    ------
    DigiclayError
        When the scene is none, without a fingertip or with several; for an indentation that is not
        finite, or is deeper than 0.8 of the semi-axis ``fingertip.height``.
    """
    tip, law = require_scene(scene).section("fingertip"), scene.section("contact")
    if tip is None or law is None:
        raise ParameterError("fingertip", "", "must be given to press a plate", "absent")
    depth = np.asarray(indentation, np.float64)
    if not np.isfinite(depth).all() or depth.max(initial=0.0) - law.offset > DEEPEST * tip.height:
        rule = f"must be finite and at most {DEEPEST * tip.height + law.offset:g} m"
        raise ParameterError("plate_force", "indentation", rule, f"{depth.max():g} m")
    plan = scene.layout
    turn = law.exponent * np.maximum(depth - law.offset, 0.0)
    first = np.expm1(turn) - turn
    second = (first - 0.5 * turn * turn) / (law.exponent * tip.height)
    size = 2.0 * math.pi * tip.length * tip.width / tip.height
    summed = size * law.stiffness / law.exponent**2 * (first - second)
    return law.share / (plan.pitch * plan.row_spacing) * summed


def measure_lattice(plan: Layout, tip: Fingertip, law: ExponentialLaw) -> float:
    """Return half the range of a level finger's force over its places on a bed, as a share of the mean."""
    closest, widest = min(plan.pitch, plan.row_spacing), max(plan.pitch, plan.row_spacing)
    if 4.0 * widest < min(tip.length, tip.width):
        return 0.0
    side = 2 * math.ceil(max(tip.length, tip.width) / closest) + 5
    bed = make_grid(Layout(side, side, plan.pitch, plan.arrangement))
    x, y = (np.arange(count) for count in PLACES)
    poses = np.empty((x.size * y.size, 7))
    poses[:, 0] = np.repeat(x * plan.pitch / x.size, y.size)
    poses[:, 1] = np.tile(y * 2.0 * plan.row_spacing / y.size, x.size)
    poses[:, 2], poses[:, 3:] = 0.0, LEVEL
    under = compute_underside(
        *compute_forms(tip.outline(poses)), bed.compute_basis(np.arange(bed.count))
    )
    force = law.tension(JUDGED * tip.height + law.offset - under).sum(axis=1)
    return float(0.5 * np.ptp(force) / force.mean())


def list_cautions(scene: Scene) -> list[str]:
    """Return lines on fingers that have another force than on a plate, and on what a drive does to pins."""
    plan, lines = scene.layout, list(_list_drive_cautions(scene))
    for finger in dict.fromkeys((each.fingertip, each.contact) for each in scene.fingers):
        tip, law = finger
        if tip is None or law is None:
            continue
        ratio, spread = law.share / plan.share, measure_lattice(plan, tip, law)
        if abs(ratio - 1.0) > COARSE:
            lines.append(
                f"contact.share {law.share:g} gives {ratio:.3g} of the finger's force on this bed; "
                f"{plan.share:g}, the area of a cell over 26.5 mm², gives all"
                " (an older file takes it with format = 2)"
            )
        if spread > COARSE:
            lines.append(
                f"pins {plan.pitch * 1e3:g} mm apart are coarse for this finger: "
                f"its force changes by ± {100 * spread:.3g} % from place to place, "
                f"{JUDGED * tip.height * 1e3:g} mm deep"
                + (": the bed can show shapes, but cannot be sculpted" if spread > LOST else "")
            )
    return list(dict.fromkeys(lines))


#: Methods whose cycle of control periods meets the turns of lines that wait.
ALIASED = {("push_pull", "needed"), ("push_pull", "round_robin")}


def _list_drive_cautions(scene: Scene) -> Iterator[str]:
    """Yield lines on pins that run away or creep."""
    drive = scene.drive
    if drive is None:
        return
    lines_wait = drive.sections < drive.count_lines(scene.layout)
    if lines_wait and (scene.method, drive.policy) in ALIASED:
        yield (
            f"drive.policy {drive.policy} may serve a line only when push_pull pushes its pins, so that they "
            "run away: use pressed"
        )
    if drive.line_lag and scene.control:
        yield (
            "drive.line_lag: leak and half-selection also move pins away from the fingertip, and the method "
            "corrects only those near it and those that it still moves"
        )
