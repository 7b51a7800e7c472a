"""Metrics of a session: pure functions on the arrays of a history, or on sums over its cells.

Averages are those of `signals`. *In contact* are the rows with a total force above zero, which the
fingertip exerts that cannot pull, and above the rounding of one that just touches.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Array, Cells, Flags, Floats
from ..base.errors import ParameterError
from ..base.modes import Mode
from ..model.control_interface import SetPoint, find_set_point
from ..model.layout import find_grid_shape
from .metric_table import METRICS
from .signals import (
    compute_deviation,
    compute_mean,
    compute_rms,
    compute_weights,
    find_stretches,
    measure_oscillation,
    measure_overshoot,
    measure_settling_time,
)

#: How far the fingertip must have gone on from a cell for it to count as left behind, m.
AWAY = 12e-3
#: Radius of the ball a fingertip is taken for, m, where it is asked which of several presses a pin.
BALL = 10e-3
#: Distances from a finger to cells looked at at a time: those of a long session on a large bed
#: would not fit in memory.
AT_ONCE = 2**17


def find_contact_rows(total_force: Floats) -> Flags:
    """Return which rows have contact, shape (t,), from the total force in N."""
    return np.asarray(total_force > TIE)


class CellSums(NamedTuple):
    """Sums over the cells of t rows of n cells, (t,), and the first and last heights, (n,)."""

    total: Floats
    """Total force, N."""
    x: Floats
    y: Floats
    height: Floats
    """Sums of the force times place, and times height, N m."""
    strongest: Floats
    """Largest force on a cell, N."""
    following: Cells
    """How many cells follow the force."""
    first: Floats
    last: Floats
    """Heights in the first and in the last row, m."""

    @property
    def touching(self) -> Flags:
        """Which rows have contact, shape (t,)."""
        return find_contact_rows(self.total)

    @property
    def shaping(self) -> Flags:
        """Which rows shape the clay, shape (t,): in contact, and a cell follows the force."""
        return self.touching & (self.following > 0)


def sum_cells(history: Mapping[str, Array]) -> CellSums:
    """Return the sums over the cells of a history, the arrays of ``history.npz``, of at least one row."""
    total, height, force, position = (
        history[name] for name in ("total_force", "height", "force", "position")
    )
    x, y = (np.broadcast_to(along[:, None], force.T.shape) for along in position.T)
    _, x, y, lifted, strongest = sum_row(force.T, x, y, height.T)
    following = np.count_nonzero(history["mode"] == Mode.FORCE_FOLLOW, axis=1)
    return CellSums(total, x, y, lifted, strongest, following, height[0], height[-1])


def sum_row(force: Floats, x: Floats, y: Floats, height: Floats) -> Floats:
    """Return total, x, y, height and strongest of `CellSums`, (5, b), of b rows of k cells, all (k, b)."""
    sums = np.empty((5, force.shape[1]))
    np.add.reduce(force, out=sums[0])
    for values, out in zip((x, y, height), sums[1:4], strict=True):
        np.einsum("kb,kb->b", values, force, out=out)
    np.maximum.reduce(force, out=sums[4], initial=0.0)
    return sums


def measure_lag(sums: CellSums, fingertip: Floats) -> Floats:
    """Return how far the blister is behind the fingertip, (t, 7), in the rows in contact, m.

    ``lag = |p - sum F_j r_j / sum F_j|`` in the horizontal plane, p the lowest point, r_j the
    positions.
    """
    rows = sums.touching
    centroid = np.column_stack([sums.x, sums.y])[rows] / sums.total[rows, None]
    return np.asarray(np.hypot(*(fingertip[rows, :2] - centroid).T))


def measure_surface_under(sums: CellSums, fingertip: Floats) -> Floats:
    """Return ``sum F_j H_j / sum F_j - z``, the surface under the fingertip, in the rows in contact, m."""
    rows = sums.touching
    return sums.height[rows] / sums.total[rows] - fingertip[rows, 2]


def measure_ridge_errors(
    position: Floats, final: Floats, fingertip: Floats, rows: Flags, away: float = AWAY
) -> Floats:
    """Return how far the cells the fingertip has passed over stand above its path at the end.

    ``e_j = H_j(end) - z(t_j)``, t_j the last row of `rows` in which no cell is nearer to the
    fingertip than cell j. A cell counts when the fingertip went on, in rows of the same unbroken
    stretch, to a place at least `away` from it: where it pressed or left is no ridge. Returned are
    the cells that count, in the order in which the fingertip passed them.
    """
    chosen = np.flatnonzero(rows)
    nearest = np.empty(chosen.size, dtype=np.intp)
    several = max(1, AT_ONCE // max(len(position), 1))
    for first in range(0, chosen.size, several):
        part = slice(first, first + several)
        square = (fingertip[chosen[part], 0, None] - position[:, 0]) ** 2
        square += (fingertip[chosen[part], 1, None] - position[:, 1]) ** 2
        nearest[part] = np.argmin(square, axis=1)
    last = {int(cell): i for i, cell in enumerate(nearest)}
    stretch = np.concatenate([[0], np.cumsum(np.diff(chosen) > 1)]) if chosen.size else chosen
    errors = []
    for cell, i in sorted(last.items(), key=lambda pair: pair[1]):
        after = chosen[i:][stretch[i:] == stretch[i]]
        if np.max(np.hypot(*(fingertip[after, :2] - position[cell]).T)) >= away:
            errors.append(float(final[cell]) - float(fingertip[chosen[i], 2]))
    return np.array(errors)


#: Force from which on the smaller Weber fractions hold, N.
BORDER = 0.5
#: Smallest and largest Weber fraction of forces from `BORDER` on, and of smaller ones.
ABOVE, BELOW = (0.07, 0.10), (0.15, 0.27)
#: Groove of the finest grating whose direction a fingertip tells, m.
SPATIAL_RESOLUTION = 0.94e-3


def find_weber_fractions(force: float) -> tuple[float, float]:
    """Return the smallest and the largest Weber fraction of a force, N; ParameterError unless above 0."""
    if not (math.isfinite(force) and force > 0.0):
        raise ParameterError("Perception", "force", "must be above 0 N and finite", f"{force:g} N")
    return ABOVE if force >= BORDER else BELOW


def perceive(
    deviation: float | None, force: float | None, unevenness: float | None
) -> dict[str, float | None]:
    """Return the `METRICS` in units of touch; None where there is nothing to compute from.

    `deviation`: of the force from its reference, N; `force`: reference force, N; `unevenness`: of a
    surface, m. Raises ParameterError when a deviation is negative or not finite, or the force is no
    reference.
    """
    for name, value, unit in (("deviation", deviation, "N"), ("unevenness", unevenness, "m")):
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise ParameterError(
                "Perception", name, f"must be at least 0 {unit} and finite", f"{value:g}"
            )
    least = most = None
    if deviation is not None and force is not None:
        fine, coarse = find_weber_fractions(force)
        least, most = deviation / (coarse * force), deviation / (fine * force)
    resolutions = None if unevenness is None else unevenness / SPATIAL_RESOLUTION
    return {"rfd_jnd_least": least, "rfd_jnd_most": most, "ridge_unevenness_touch": resolutions}


#: Settled is a force this near to its set point, as a share of it.
BAND = 0.1
#: Ends of contact no farther apart are bounces of one parting, s: Method I's loss time.
BOUNCE = 0.05


def compute_rfd(
    time: Floats, total_force: Floats, set_point: Floats | float, rows: Flags | None = None
) -> float | None:
    """Return the reference force deviation, N.

    ``RFD = sqrt(sum w_i (F_i - F_ref,i)² / sum w_i)`` with the `weights` of the rows.

    `time` (t,), s; `total_force` (t,), N; `set_point` (t,) or (), total force asked for, N; rows in
    which it is NaN are left out; `rows` bool (t,), rows to judge; those in contact by default. They
    include touching down, and leave out the gaps when the fingertip is lost: read it next to
    `compute_contact_loss_share`. Returns none when there is no such row.
    """
    wanted = np.broadcast_to(set_point, total_force.shape)
    chosen = (find_contact_rows(total_force) if rows is None else rows) & ~np.isnan(wanted)
    return compute_rms((total_force - wanted)[chosen], compute_weights(time)[chosen])


def compute_contact_loss_share(time: Floats, total_force: Floats) -> float | None:
    """Return the share of the time from first to last contact without contact; None: no contact.

    A pause the session makes on purpose, with the fingertip lifted, counts as well.
    """
    touching = find_contact_rows(total_force)
    if not np.any(touching):
        return None
    first, after = int(np.argmax(touching)), len(touching) - int(np.argmax(touching[::-1]))
    return compute_mean(1.0 - touching[first:after], compute_weights(time)[first:after])


class Loss(NamedTuple):
    """End of contact that the fingertip did not ask for: when, and how long it was without contact, s."""

    start: float
    time: float


def find_contact_ends(time: Floats, total_force: Floats) -> Floats:
    """Return when contact ends, s, shape (ends,), bounces counted once, from times, s, and forces (t,), N."""
    touching = find_contact_rows(total_force)
    ends: Floats = time[1:][touching[:-1] & ~touching[1:]]
    return ends[np.diff(ends, prepend=-np.inf) > BOUNCE]


def find_losses(time: Floats, total_force: Floats, height: Floats, free_speed: float) -> list[Loss]:
    """Return the ends of contact at which a fingertip rose no faster than a pin can, m/s; all (t,), SI.

    A loss lasts until the next contact, until the fingertip rises faster, or to the end.
    """
    losses = []
    ends = find_contact_ends(time, total_force)  # none in a single row, which has no gradient
    rise = np.gradient(height, time) if ends.size else height
    for end in ends.tolist():
        if rise[(time > end - 0.2) & (time <= end + 0.1)].max() <= free_speed:
            over = time[(time > end) & (find_contact_rows(total_force) | (rise > free_speed))]
            losses.append(Loss(end, float(over[0] if over.size else time[-1]) - end))
    return losses


def measure_touchdown(
    time: Floats, total_force: Floats, set_point: Floats
) -> tuple[float | None, float | None]:
    """Return overshoot, as a share, and settling time, s, of the force at first touch; None: no set point.

    The set point is NaN in rows that ask for no force: in them it is not settled.
    """
    touches = find_stretches(find_contact_rows(total_force))
    if not touches:
        return None, None
    # From the last row before the first contact to the last one of that contact.
    first = slice(max(0, touches[0].start - 1), touches[0].stop)
    beyond, wanted = total_force[first] - set_point[first], set_point[first]
    asked = ~np.isnan(wanted)
    typical = compute_mean(wanted[asked], compute_weights(time[first])[asked])
    if typical is None:
        return None, None
    # Without contact the force is below its set point by all of it.
    passed = measure_overshoot(np.concatenate([[-typical], beyond[asked]]), 0.0)
    return passed, measure_settling_time(time[first], beyond / wanted, 0.0, BAND)


def split_fingers(history: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Give the history of each finger; a pin's force counts for the nearest, where two press it.

    That is the nearest ball on a lowest point: what a lower fingertip presses may be beneath the
    other one. Where two are equally near it counts for both, and for a finger without any the
    nearest that is pressed.
    """
    if "finger_force" not in history:
        yield history
        return
    if "body_force" in history:
        force = history["force"] - np.add.reduce(history["body_force"], axis=1)
        history = {**history, "force": np.maximum(force, 0.0)}
    common = {name: values for name, values in history.items() if name != "finger_force"}
    felt = (history["force"] > 0.0) | (history["mode"] == Mode.FORCE_FOLLOW)
    cells = np.flatnonzero(felt.any(axis=0))  # of a large bed they are few
    tips, (x, y) = history["fingertip"], history["position"][cells].T
    tips = tips.reshape(len(tips), -1, 7)
    force, low = history["force"][:, cells], history["height"][:, cells] - BALL
    pressed, least = force > 0.0, np.full(force.shape, np.inf)

    def square(finger: int) -> Floats:
        beside, along, above = tips[:, finger, :3].T[:, :, None]
        return (x - beside) ** 2 + (y - along) ** 2 + (low - above) ** 2

    for finger in range(tips.shape[1]):
        np.minimum(least, square(finger), out=least)
    for finger, total in enumerate(history["finger_force"].reshape(len(tips), -1).T):
        nearest = square(finger) <= least
        lacking = np.flatnonzero(
            (total > 0.0) & pressed.any(axis=1) & ~(nearest & pressed).any(axis=1)
        )
        if lacking.size:
            away = np.where(pressed[lacking], square(finger)[lacking], np.inf)
            nearest[lacking, away.argmin(axis=1)] = True
        assigned = (nearest * force).sum(axis=1)
        # All of a finger together are exact.
        scale = np.divide(total, assigned, out=np.zeros_like(total), where=assigned > 0.0)[:, None]
        rows = {name: np.zeros_like(history[name]) for name in ("force", "mode")}  # at rest
        rows["force"][:, cells] = nearest * force * scale
        rows["mode"][:, cells] = nearest * history["mode"][:, cells]
        yield {**common, **rows, "total_force": total, "fingertip": tips[:, finger]}


def measure_bodies(history: Mapping[str, Any]) -> list[dict[str, float]]:
    """Return of each body the largest force, N, in total and on a pin, and most pins pressed at once."""
    return [
        {
            "max_total_force": float(force.sum(axis=1).max()),
            "max_cell_force": float(force.max()),
            "pressed_pins": int(np.count_nonzero(force > TIE, axis=1).max()),
        }
        for force in history["body_force"].swapaxes(0, 1)
    ]


def take_worst(each: Sequence[Mapping[str, float | None]]) -> dict[str, float | None]:
    """Return the worst of each metric of the fingers: a sum would hide that one is lost."""
    worst: dict[str, float | None] = {}
    for name in each[0]:
        values = [value for metrics in each if (value := metrics[name]) is not None]
        worse = METRICS[name].worse
        pick = min if worse == "lower" else max
        lacking = worse == "absent" and len(values) < len(each)
        worst[name] = None if lacking else pick(values, key=abs, default=None)
    return worst


def find_worst_finger(history: Mapping[str, Any], set_point: SetPoint | None) -> Mapping[str, Any]:
    """Return the history of the finger with the largest RFD, or, without any, force."""

    def judge(finger: Mapping[str, Any]) -> tuple[float, float]:
        metrics = compute_metrics(finger, set_point)
        return metrics["rfd"] or 0.0, metrics["max_total_force"] or 0.0

    return max(split_fingers(history), key=judge)


#: All cells.
ALL = slice(None)


def compute_cell_area(position: Floats) -> float | None:
    """Return the area a cell of positions (n, 2), row by row, stands for, m²; None for a single pin."""
    rows, columns = find_grid_shape(position)
    along = abs(float(position[1, 0] - position[0, 0])) if columns > 1 else 0.0
    across = abs(float(position[columns, 1] - position[0, 1])) if rows > 1 else 0.0
    # A single row is taken as wide as its pins are apart.
    return (along or across) * (across or along) or None


def compute_metrics(
    history: Mapping[str, Array], set_point: SetPoint | None
) -> dict[str, float | None]:
    """Return every metric of a session by the keys of `METRICS`, SI; None without a basis, never a NaN.

    `history`: the arrays of ``history.npz``; of several fingers see `take_worst`. Raises
    ParameterError when the history has no rows.
    """
    if "finger_force" in history:
        return take_worst([compute_metrics(finger, set_point) for finger in split_fingers(history)])
    time = history["time"]
    if not len(time):
        raise ParameterError("History", "time", "must have at least one row", "none")
    fingertip, position = history["fingertip"], history["position"]
    return compute_metrics_from_sums(sum_cells(history), time, fingertip, position, set_point)


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is no metric
def compute_metrics_from_sums(
    sums: CellSums,
    time: Floats,
    fingertip: Floats,
    position: Floats,
    set_point: SetPoint | None,
    near: Cells | slice = ALL,
) -> dict[str, float | None]:
    """Return every metric of a session of t rows, (t,) or (t, 7), and n cells, (n, 2); see `compute_metrics`.

    `near`: the cells nearest to the fingertip at some time: only they can be left behind in a
    ridge.
    """
    total, weight, felt, rows = sums.total, compute_weights(time), sums.touching, sums.shaping
    # A fingertip straight above its blister is a rounding error away from it, not 1e-17 m.
    behind = np.round(measure_lag(sums, fingertip), 12)
    above = measure_surface_under(sums, fingertip)
    ridge = measure_ridge_errors(position[near], sums.last[near], fingertip, rows)
    each = np.ones(len(ridge))
    wanted = find_set_point(set_point, sums.following)
    beyond, settled = measure_touchdown(time, total, wanted)
    formed, area = sums.last - sums.first, compute_cell_area(position)
    values: dict[str, float | None] = {
        "duration": float(time[-1] - time[0]),
        "set_point": _typical(set_point, wanted[rows], weight[rows]),
        "rfd": compute_rfd(time, total, wanted),
        "rfd_shaping": compute_rfd(time, total, wanted, rows),
        "rfd_session": compute_rfd(time, total, wanted, np.ones(len(time), dtype=bool)),
        "contact_share": compute_mean(felt.astype(np.float64), weight),
        "contact_loss_share": compute_contact_loss_share(time, total),
        "lag_mean": compute_mean(behind, weight[felt]),
        "lag_max": float(behind.max()) if len(behind) else None,
        "force_deviation": compute_deviation(total[rows], weight[rows]),
        "force_oscillation": measure_oscillation(time, total, rows),
        "force_overshoot": beyond,
        "settling_time": settled,
        "height_deviation": compute_deviation(above[rows[felt]], weight[rows]),
        "ridge_offset": compute_mean(ridge, each),
        "ridge_error": compute_rms(ridge, each),
        "ridge_unevenness": compute_deviation(ridge, each),
        "max_cell_force": float(sums.strongest.max()),
        "max_total_force": float(total.max()),
        "lowest": float(sums.last.min()),
        "highest": float(sums.last.max()),
        "height_range": float(np.ptp(sums.last)),
        "raised_volume": None if area is None else area * float(np.sum(np.maximum(formed, 0.0))),
        "sunk_volume": None if area is None else area * float(np.sum(np.maximum(-formed, 0.0))),
    }
    metrics = {
        name: value if value is not None and np.isfinite(value) else None
        for name, value in values.items()
    }
    return metrics | perceive(metrics["rfd"], metrics["set_point"], metrics["ridge_unevenness"])


def _typical(set_point: SetPoint | None, wanted: Floats, weight: Floats) -> float | None:
    """Return a set point as one number, N: its mean in the rows that shape, if it changes."""
    if set_point is None:
        return None
    return compute_mean(wanted, weight) if set_point.per_cell else set_point.force
