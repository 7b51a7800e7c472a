"""What a session is judged by: pure functions on the arrays of a history.

Averages are over time, by the trapezium rule: a row stands for half of the intervals on
either side of it, so histories with uneven rows are judged alike. *In contact* are the
rows with a total force above zero; the finger cannot pull, and a force it no longer
exerts is exactly zero.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ParameterError
from .modes import Mode
from .surface import grid_shape

__all__ = [
    "METRICS",
    "cell_area",
    "contact_loss_share",
    "in_contact",
    "lag",
    "rfd",
    "shaping",
    "summary",
    "weights",
]

Floats = NDArray[np.float64]
Rows = NDArray[np.bool_]

#: Every key of `summary`: its unit and its meaning.
METRICS: dict[str, tuple[str, str]] = {
    "duration": ("s", "simulated time from the first row to the last"),
    "set_point": ("N", "total force the finger should feel"),
    "rfd": ("N", "rms over time of (total force - set point) while the finger touches"),
    "rfd_shaping": ("N", "the same, only while a cell follows the force: without touching down"),
    "rfd_session": ("N", "the same over the whole session; without contact the force is 0"),
    "contact_share": ("1", "share of the session's time in which the finger touches"),
    "contact_loss_share": ("1", "share of the time from first to last contact in which it does not touch"),
    "lag_mean": ("m", "mean horizontal distance from fingertip to the centroid of the cells' forces"),
    "lag_max": ("m", "largest such distance"),
    "max_cell_force": ("N", "largest force on one cell"),
    "max_total_force": ("N", "largest force on all cells together"),
    "lowest": ("m", "height of the lowest pin at the end"),
    "highest": ("m", "height of the highest pin at the end"),
    "height_range": ("m", "highest less lowest: the relief that was formed"),
    "raised_volume": ("m3", "volume formed above the initial surface"),
    "sunk_volume": ("m3", "volume formed below the initial surface"),
}


def in_contact(total_force: ArrayLike) -> Rows:
    """Return which rows have contact, shape (t,), from the total force in N."""
    touching: Rows = np.asarray(total_force, dtype=np.float64) > 0.0
    return touching


def shaping(total_force: ArrayLike, mode: ArrayLike) -> Rows:
    """Return which rows shape the clay: in contact, and a cell under the finger follows the force.

    Parameters
    ----------
    total_force : array_like, shape (t,)
        N.
    mode : array_like of int, shape (t, n)
        Codes of `Mode`.

    Returns
    -------
    ndarray of bool, shape (t,)
    """
    rows: Rows = in_contact(total_force) & np.any(np.asarray(mode) == Mode.FORCE_FOLLOW, axis=1)
    return rows


def weights(time: ArrayLike) -> Floats:
    """Return the time each row stands for, s: ``w_i = (t_{i+1} - t_{i-1}) / 2``, half of it at the ends.

    Parameters
    ----------
    time : array_like, shape (t,)
        Increasing, s.

    Returns
    -------
    ndarray, shape (t,)
        The weight of a single row is 1.
    """
    moment = np.asarray(time, dtype=np.float64)
    if len(moment) < 2:
        return np.ones(len(moment))
    half = 0.5 * np.diff(moment)
    each: Floats = np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])
    return each


def rfd(time: ArrayLike, total_force: ArrayLike, set_point: float, rows: Rows | None = None) -> float | None:
    """Return the reference force deviation, N.

    ``RFD = sqrt(sum w_i (F_i - F_ref)² / sum w_i)`` with the `weights` of the rows.

    Parameters
    ----------
    time : array_like, shape (t,)
        s.
    total_force : array_like, shape (t,)
        N.
    set_point : float
        Force the finger should feel, N.
    rows : ndarray of bool, shape (t,), optional
        Rows to judge; those in contact by default. They include touching down, and leave out
        the gaps when the finger is lost: read it next to `contact_loss_share`.

    Returns
    -------
    float or None
        None when there is no such row.
    """
    force = np.asarray(total_force, dtype=np.float64)
    chosen = in_contact(force) if rows is None else rows
    square = _mean(((force - set_point) ** 2)[chosen], weights(time)[chosen])
    return None if square is None else float(np.sqrt(square))


def contact_loss_share(time: ArrayLike, total_force: ArrayLike) -> float | None:
    """Return the share of the time from first to last contact without contact.

    A pause the session makes on purpose, with the finger lifted, counts as well.

    Parameters
    ----------
    time : array_like, shape (t,)
        s.
    total_force : array_like, shape (t,)
        N.

    Returns
    -------
    float or None
        In [0, 1); None when the finger never touches.
    """
    touching = in_contact(total_force)
    if not np.any(touching):
        return None
    first, after = int(np.argmax(touching)), len(touching) - int(np.argmax(touching[::-1]))
    return _mean(1.0 - touching[first:after], weights(time)[first:after])


def lag(position: ArrayLike, force: ArrayLike, fingertip: ArrayLike) -> Floats:
    """Return how far the blister is behind the finger, in the rows in contact.

    ``lag = |p - sum F_j r_j / sum F_j|`` in the horizontal plane, p the fingertip's lowest
    point, r_j the cells' positions.

    Parameters
    ----------
    position : array_like, shape (n, 2)
        m.
    force : array_like, shape (t, n)
        N.
    fingertip : array_like, shape (t, 7)
        Lowest point, m, and quaternion.

    Returns
    -------
    ndarray, shape (rows in contact,)
        m.
    """
    pressed = np.asarray(force, dtype=np.float64)
    total = pressed.sum(axis=1)
    rows = in_contact(total)
    centroid = pressed[rows] @ np.asarray(position, dtype=np.float64) / total[rows, None]
    distance: Floats = np.hypot(*(np.asarray(fingertip, dtype=np.float64)[rows, :2] - centroid).T)
    return distance


def cell_area(position: ArrayLike) -> float | None:
    """Return the area of the bed one cell stands for, m²: distance in a row times distance of the rows.

    Parameters
    ----------
    position : array_like, shape (n, 2)
        m; ordered row by row.

    Returns
    -------
    float or None
        A single row is taken as wide as its pins are apart; None for a single pin.
    """
    place = np.asarray(position, dtype=np.float64)
    rows, columns = grid_shape(place)
    along = abs(float(place[1, 0] - place[0, 0])) if columns > 1 else 0.0
    across = abs(float(place[columns, 1] - place[0, 1])) if rows > 1 else 0.0
    area = (along or across) * (across or along)
    return area or None


def summary(history: Mapping[str, ArrayLike], set_point: float) -> dict[str, float | None]:
    """Return every metric of a session.

    Parameters
    ----------
    history : mapping
        The arrays of ``history.npz``: time, height, force, mode, fingertip, total_force and
        position.
    set_point : float
        Force the finger should feel, N.

    Returns
    -------
    dict
        The keys of `METRICS`; SI. None where there is nothing to compute from, never a NaN.

    Raises
    ------
    ParameterError
        When the history has no rows.
    """
    time, total, height, force, position = (
        np.asarray(history[name], dtype=np.float64)
        for name in ("time", "total_force", "height", "force", "position")
    )
    if not len(time):
        raise ParameterError("History", "time", "must have at least one row", "none")
    touching = in_contact(total)
    behind, weight = lag(position, force, history["fingertip"]), weights(time)[in_contact(force.sum(axis=1))]
    formed, area = height[-1] - height[0], cell_area(position)
    found: dict[str, float | None] = {
        "duration": float(time[-1] - time[0]),
        "set_point": float(set_point),
        "rfd": rfd(time, total, set_point),
        "rfd_shaping": rfd(time, total, set_point, shaping(total, history["mode"])),
        "rfd_session": rfd(time, total, set_point, np.ones(len(time), dtype=bool)),
        "contact_share": _mean(touching.astype(np.float64), weights(time)),
        "contact_loss_share": contact_loss_share(time, total),
        "lag_mean": _mean(behind, weight),
        "lag_max": float(behind.max()) if len(behind) else None,
        "max_cell_force": float(force.max()),
        "max_total_force": float(total.max()),
        "lowest": float(height[-1].min()),
        "highest": float(height[-1].max()),
        "height_range": float(np.ptp(height[-1])),
        "raised_volume": None if area is None else area * float(np.sum(np.maximum(formed, 0.0))),
        "sunk_volume": None if area is None else area * float(np.sum(np.maximum(-formed, 0.0))),
    }
    return {
        name: value if value is not None and np.isfinite(value) else None for name, value in found.items()
    }


def _mean(values: Floats, weight: Floats) -> float | None:
    """Return the weighted mean, or None when there is nothing to average."""
    total = float(np.sum(weight))
    return float(np.sum(weight * values)) / total if total > 0.0 else None
