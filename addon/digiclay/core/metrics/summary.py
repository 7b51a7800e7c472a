"""Metrics of a session: pure functions on the arrays of a history.

Averages are over time, by the trapezium rule: a row stands for half of the intervals on
either side of it, so histories with uneven rows are judged alike. *In contact* are the
rows with a total force above zero; the fingertip cannot pull, and a force it no longer
exerts is exactly zero.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..model.control_interface import SetPoint, find_set_point
from ..surface.skin_mesh import find_grid_shape
from .finger_path import CellSums, measure_lag, measure_ridge_errors, measure_surface_under, sum_cells
from .force import (
    compute_contact_loss_share,
    compute_deviation,
    compute_mean,
    compute_rfd,
    compute_rms,
    compute_weights,
    measure_oscillation,
    measure_touchdown,
    perceive,
)

#: All cells.
ALL = slice(None)


def compute_cell_area(position: ArrayLike) -> float | None:
    """Return the area a cell of positions (n, 2), row by row, stands for, m²; None for a single pin."""
    place = np.asarray(position, dtype=np.float64)
    rows, columns = find_grid_shape(place)
    along = abs(float(place[1, 0] - place[0, 0])) if columns > 1 else 0.0
    across = abs(float(place[columns, 1] - place[0, 1])) if rows > 1 else 0.0
    # A single row is taken as wide as its pins are apart.
    return (along or across) * (across or along) or None


def compute_metrics(history: Mapping[str, ArrayLike], set_point: SetPoint | None) -> dict[str, float | None]:
    """Return every metric of a session by the keys of `METRICS`, SI; None without a basis, never a NaN.

    `history`: the arrays of ``history.npz``. Raises ParameterError when the history has no rows.
    """
    time = np.asarray(history["time"], dtype=np.float64)
    if not len(time):
        raise ParameterError("History", "time", "must have at least one row", "none")
    fingertip, position = (np.asarray(history[name], dtype=np.float64) for name in ("fingertip", "position"))
    return compute_metrics_from_sums(sum_cells(history), time, fingertip, position, set_point)


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is no metric
def compute_metrics_from_sums(
    sums: CellSums,
    time: Floats,
    fingertip: Floats,
    position: Floats,
    set_point: SetPoint | None,
    near: NDArray[np.intp] | slice = ALL,
) -> dict[str, float | None]:
    """Return every metric of a session of t rows, (t,) or (t, 7), and n cells, (n, 2); see `compute_metrics`.

    `near`: the cells nearest to the fingertip at some time: only they can be left behind in a ridge.
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
        name: value if value is not None and np.isfinite(value) else None for name, value in values.items()
    }
    return metrics | perceive(metrics["rfd"], metrics["set_point"], metrics["ridge_unevenness"])


def _typical(set_point: SetPoint | None, wanted: Floats, weight: Floats) -> float | None:
    """Return a set point as one number, N: its mean in the rows that shape, if it changes."""
    if set_point is None:
        return None
    return compute_mean(wanted, weight) if set_point.per_cell else set_point.force
