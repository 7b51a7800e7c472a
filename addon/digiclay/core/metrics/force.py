"""Metrics of the total force: deviation, contact loss, first touch."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats
from .finger_path import Rows, find_contact_rows
from .signal import compute_mean, compute_weights, measure_overshoot, measure_settling_time

#: Settled is a force this near to its set point, as a share of it.
BAND = 0.1
#: Ends of contact no farther apart are bounces of one parting, s: Method I's loss time.
BOUNCE = 0.05


def compute_rfd(
    time: ArrayLike, total_force: ArrayLike, set_point: ArrayLike, rows: Rows | None = None
) -> float | None:
    """Return the reference force deviation, N.

    ``RFD = sqrt(sum w_i (F_i - F_ref,i)² / sum w_i)`` with the `weights` of the rows.

    `time` (t,), s; `total_force` (t,), N; `set_point` (t,) or (), total force asked for, N; rows in which it
    is NaN are left out; `rows` bool (t,), rows to judge; those in contact by default. They include touching
    down, and leave out the gaps when the finger is lost: read it next to `compute_contact_loss_share`.
    Returns none when there is no such row.
    """
    force = np.asarray(total_force, dtype=np.float64)
    wanted = np.broadcast_to(np.asarray(set_point, dtype=np.float64), force.shape)
    chosen = (find_contact_rows(force) if rows is None else rows) & ~np.isnan(wanted)
    square = compute_mean((force - wanted)[chosen] ** 2, compute_weights(time)[chosen])
    return None if square is None else float(np.sqrt(square))


def compute_contact_loss_share(time: ArrayLike, total_force: ArrayLike) -> float | None:
    """Return the share of the time from first to last contact without contact.

    A pause the session makes on purpose, with the finger lifted, counts as well.

    `time` (t,), s; `total_force` (t,), N. Returns in [0, 1); None when the finger never touches.
    """
    touching = find_contact_rows(total_force)
    if not np.any(touching):
        return None
    first, after = int(np.argmax(touching)), len(touching) - int(np.argmax(touching[::-1]))
    return compute_mean(1.0 - touching[first:after], compute_weights(time)[first:after])


def find_contact_ends(time: ArrayLike, total_force: ArrayLike) -> Floats:
    """Return when contact ends, s, shape (ends,), bounces counted once, from times, s, and forces (t,), N."""
    touching = find_contact_rows(total_force)
    ends: Floats = np.asarray(time, dtype=np.float64)[1:][touching[:-1] & ~touching[1:]]
    return ends[np.diff(ends, prepend=-np.inf) > BOUNCE]


def find_first_touch(total_force: ArrayLike) -> slice:
    """Return the rows from the last one before the first contact to the last one of that contact."""
    touching = find_contact_rows(total_force)
    if not np.any(touching):
        return slice(0, 0)
    start = int(np.argmax(touching))
    gone = np.flatnonzero(~touching[start:])
    return slice(max(0, start - 1), start + int(gone[0]) if gone.size else len(touching))


def measure_touchdown(
    time: Floats, total_force: Floats, set_point: Floats
) -> tuple[float | None, float | None]:
    """Return overshoot and settling time of the force at first touch; None without a set point.

    `time`, `total_force` (t,), s, N; `set_point` (t,), total force asked for, N; NaN in rows that ask for
    none: in them the force is not settled. Returns `passed`: largest force beyond the set point, as a share
    of its mean over the first touch; `settled`, s.
    """
    first = find_first_touch(total_force)
    if first.stop == first.start:
        return None, None
    beyond, wanted = total_force[first] - set_point[first], set_point[first]
    known = ~np.isnan(wanted)
    typical = compute_mean(wanted[known], compute_weights(time[first])[known])
    if typical is None:
        return None, None
    # Without contact the force is below its set point by all of it.
    passed = measure_overshoot(np.concatenate([[-typical], beyond[known]]), 0.0)
    return passed, measure_settling_time(time[first], beyond / wanted, 0.0, BAND)
