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
from .metrics_path import Rows, in_contact, lag, ridge_errors, shaping, surface_under
from .metrics_signal import deviation, mean, overshoot, settling_time, weights
from .surface import grid_shape

__all__ = [
    "BAND",
    "METRICS",
    "cell_area",
    "contact_loss_share",
    "first_touch",
    "in_contact",
    "lag",
    "rfd",
    "shaping",
    "summary",
    "weights",
]

Floats = NDArray[np.float64]

#: Settled is a force this near to its set point, as a share of it.
BAND = 0.1

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
    "force_deviation": ("N", "standard deviation over time of the total force while shaping"),
    "force_overshoot": ("1", "first touch: largest force beyond the set point, as a share of it"),
    "settling_time": (
        "s",
        "first touch: from touching down until the force stays within 10 % of its set point",
    ),
    "height_deviation": (
        "m",
        "standard deviation over time of the surface's height over the finger, shaping",
    ),
    "ridge_offset": ("m", "mean height of what the finger left behind over its path"),
    "ridge_error": ("m", "rms of the same"),
    "ridge_unevenness": ("m", "standard deviation of the same"),
    "max_cell_force": ("N", "largest force on one cell"),
    "max_total_force": ("N", "largest force on all cells together"),
    "lowest": ("m", "height of the lowest pin at the end"),
    "highest": ("m", "height of the highest pin at the end"),
    "height_range": ("m", "highest less lowest: the relief that was formed"),
    "raised_volume": ("m3", "volume formed above the initial surface"),
    "sunk_volume": ("m3", "volume formed below the initial surface"),
}


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
    square = mean(((force - set_point) ** 2)[chosen], weights(time)[chosen])
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
    return mean(1.0 - touching[first:after], weights(time)[first:after])


def first_touch(total_force: ArrayLike) -> slice:
    """Return the rows from the last one before the first contact to the last one of that contact."""
    touching = in_contact(total_force)
    if not np.any(touching):
        return slice(0, 0)
    start = int(np.argmax(touching))
    gone = np.flatnonzero(~touching[start:])
    return slice(max(0, start - 1), start + int(gone[0]) if gone.size else len(touching))


def _followed(
    time: Floats, total: Floats, set_point: float, first: slice
) -> tuple[float | None, float | None]:
    """Return overshoot and settling time of the force at first touch; None at a set point of 0."""
    if first.stop == first.start:
        return None, None
    beyond = overshoot(np.concatenate([[0.0], total[first]]), set_point)
    return beyond, settling_time(time[first], total[first], set_point, BAND * set_point)


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
    # A finger straight above its blister is a rounding error away from it, not 1e-17 m.
    pressed = force.sum(axis=1)
    behind = np.round(lag(position, force, history["fingertip"], pressed), 12)
    felt = in_contact(pressed)
    weight = weights(time)[felt]
    formed, area = height[-1] - height[0], cell_area(position)
    rows = shaping(total, history["mode"])
    beyond, settled = _followed(time, total, float(set_point), first_touch(total))
    above = surface_under(height, force, history["fingertip"], pressed)
    ridge = ridge_errors(position, height[-1], history["fingertip"], rows)
    each = np.ones(len(ridge))
    found: dict[str, float | None] = {
        "duration": float(time[-1] - time[0]),
        "set_point": float(set_point),
        "rfd": rfd(time, total, set_point),
        "rfd_shaping": rfd(time, total, set_point, rows),
        "rfd_session": rfd(time, total, set_point, np.ones(len(time), dtype=bool)),
        "contact_share": mean(touching.astype(np.float64), weights(time)),
        "contact_loss_share": contact_loss_share(time, total),
        "lag_mean": mean(behind, weight),
        "lag_max": float(behind.max()) if len(behind) else None,
        "force_deviation": deviation(total[rows], weights(time)[rows]),
        "force_overshoot": beyond,
        "settling_time": settled,
        "height_deviation": deviation(above[rows[felt]], weights(time)[felt][rows[felt]]),
        "ridge_offset": mean(ridge, each),
        "ridge_error": float(np.sqrt(np.mean(ridge**2))) if len(ridge) else None,
        "ridge_unevenness": deviation(ridge, each),
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
