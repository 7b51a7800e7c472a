"""Metrics of signals and of the total force: deviation, overshoot, contact loss, differences one can feel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from .finger_path import Rows, find_contact_rows

#: Window of the moving average that is taken off for an oscillation, s. What is left of a sine of f Hz is
#: 1 - sinc(f WINDOW): less than a tenth below 1 Hz, where fingers move on purpose, and all of it at 4 Hz; a
#: controller on its limit of stability oscillates at 4 to 10 Hz (digiclay paper).
WINDOW = 0.25


def compute_weights(time: ArrayLike) -> Floats:
    """Return the time each row stands for, (t,), s: ``w_i = (t_{i+1} - t_{i-1}) / 2``, half at the ends."""
    moment = np.asarray(time, dtype=np.float64)
    if len(moment) < 2:  # nothing to average over
        return np.ones(len(moment))
    half = 0.5 * np.diff(moment)
    each: Floats = np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])
    return each


def compute_mean(values: Floats, weight: Floats) -> float | None:
    """Return the weighted mean of values (t,), or None when there is nothing to average."""
    total = float(np.sum(weight))
    return float(np.sum(weight * values)) / total if total > 0.0 else None


def compute_rms(values: Floats, weight: Floats) -> float | None:
    """Return the weighted root mean square of values (t,), or None without any rows."""
    square = compute_mean(values**2, weight)
    return None if square is None else math.sqrt(square)


def compute_deviation(values: Floats, weight: Floats) -> float | None:
    """Return the weighted standard deviation about the weighted mean, or None without any rows."""
    middle = compute_mean(values, weight)
    return None if middle is None else compute_rms(values - middle, weight)


def measure_overshoot(values: ArrayLike, target: float) -> float | None:
    """Return how far a signal goes beyond its target, as a share of its way there.

    ``max_i (y_i - y_target) / (y_target - y_0)``, at least 0; None for a signal at its target from the start.
    """
    signal = np.asarray(values, dtype=np.float64)
    if not len(signal) or signal[0] == target:
        return None
    way = target - float(signal[0])
    return max(0.0, float(np.max((signal - target) / way)))


def measure_settling_time(time: ArrayLike, values: ArrayLike, target: float, band: float) -> float | None:
    """Return the time after which ``|y_i - y_target| <= band`` to the end, s; None when it never does."""
    moment, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    outside = np.flatnonzero(~(np.abs(signal - target) <= band))
    if not len(signal) or (outside.size and outside[-1] == len(signal) - 1):
        return None
    return float(moment[outside[-1] + 1] - moment[0]) if outside.size else 0.0


def measure_amplitude(values: ArrayLike) -> float:
    """Return half the distance from a signal's lowest to its highest value."""
    return 0.5 * float(np.ptp(np.asarray(values, dtype=np.float64)))


def measure_frequency(time: ArrayLike, values: ArrayLike) -> float | None:
    """Return how often a signal rises through its mean, Hz; None when it does so less than three times."""
    moment, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    above = signal > signal.mean() if len(signal) else np.empty(0, dtype=bool)
    rises = np.flatnonzero(~above[:-1] & above[1:])
    if rises.size < 3:
        return None
    return float((rises.size - 1) / (moment[rises[-1]] - moment[rises[0]]))


def find_stretches(rows: NDArray[np.bool_]) -> list[slice]:
    """Return the unbroken stretches of chosen rows, in order. `rows` bool (t,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]])))
    return [slice(int(first), int(after)) for first, after in zip(edges[::2], edges[1::2], strict=True)]


def measure_oscillation(
    time: ArrayLike, values: ArrayLike, rows: NDArray[np.bool_], window: float = WINDOW
) -> float | None:
    """Return the rms over time of a signal less its moving average.

    ``sqrt(sum w_i (y_i - m_i)² / sum w_i)``, m_i the mean of y over the window, s, around row i. A row
    counts when its whole window is within an unbroken stretch of the chosen rows; None when no row does.
    """
    moment, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    off: list[Floats] = []
    weight: list[Floats] = []
    for stretch in find_stretches(rows):
        t, y = moment[stretch], signal[stretch]
        area = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
        # Half a millionth of the window: an edge on the first row is within.
        inner = (t - 0.5 * window >= t[0] - 5e-7 * window) & (t + 0.5 * window <= t[-1] + 5e-7 * window)
        below, above = (np.interp(t[inner] + side * window, t, area) for side in (-0.5, 0.5))
        off.append(y[inner] - (above - below) / window)
        weight.append(compute_weights(t)[inner])
    return compute_rms(np.concatenate(off), np.concatenate(weight)) if off else None


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

    `deviation`: of the force from its reference, N; `force`: reference force, N; `unevenness`: of a surface,
    m. Raises ParameterError when a deviation is negative or not finite, or the force is no reference.
    """
    for name, value, unit in (("deviation", deviation, "N"), ("unevenness", unevenness, "m")):
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise ParameterError("Perception", name, f"must be at least 0 {unit} and finite", f"{value:g}")
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
    time: ArrayLike, total_force: ArrayLike, set_point: ArrayLike, rows: Rows | None = None
) -> float | None:
    """Return the reference force deviation, N.

    ``RFD = sqrt(sum w_i (F_i - F_ref,i)² / sum w_i)`` with the `weights` of the rows.

    `time` (t,), s; `total_force` (t,), N; `set_point` (t,) or (), total force asked for, N; rows in which it
    is NaN are left out; `rows` bool (t,), rows to judge; those in contact by default. They include touching
    down, and leave out the gaps when the fingertip is lost: read it next to `compute_contact_loss_share`.
    Returns none when there is no such row.
    """
    force = np.asarray(total_force, dtype=np.float64)
    wanted = np.broadcast_to(np.asarray(set_point, dtype=np.float64), force.shape)
    chosen = (find_contact_rows(force) if rows is None else rows) & ~np.isnan(wanted)
    return compute_rms((force - wanted)[chosen], compute_weights(time)[chosen])


def compute_contact_loss_share(time: ArrayLike, total_force: ArrayLike) -> float | None:
    """Return the share of the time from first to last contact without contact; None: no contact.

    A pause the session makes on purpose, with the fingertip lifted, counts as well.
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
    known = ~np.isnan(wanted)
    typical = compute_mean(wanted[known], compute_weights(time[first])[known])
    if typical is None:
        return None, None
    # Without contact the force is below its set point by all of it.
    passed = measure_overshoot(np.concatenate([[-typical], beyond[known]]), 0.0)
    return passed, measure_settling_time(time[first], beyond / wanted, 0.0, BAND)
