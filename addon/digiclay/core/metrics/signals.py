"""Signals over time: averages, overshoot, settling time, frequency and oscillation.

Averages are over time, by the trapezium rule: a row stands for half of the intervals on
either side of it, so histories with uneven rows are judged alike.
"""

import math

import numpy as np

from ..base.arrays import Flags, Floats

#: Window of the moving average that is taken off for an oscillation, s. What is left of a sine of f
#: Hz is 1 - sinc(f WINDOW): less than a tenth below 1 Hz, where fingers move on purpose, and all of
#: it at 4 Hz; a controller on its limit of stability oscillates at 4 to 10 Hz (digiclay paper).
WINDOW = 0.25


def compute_weights(time: Floats) -> Floats:
    """Return the time each row stands for, (t,), s: ``w_i = (t_{i+1} - t_{i-1}) / 2``, half at the ends."""
    if len(time) < 2:  # nothing to average over
        return np.ones(len(time))
    half = 0.5 * np.diff(time)
    return np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])


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


def measure_overshoot(values: Floats, target: float) -> float | None:
    """Return how far a signal goes beyond its target, as a share of its way there.

    ``max_i (y_i - y_target) / (y_target - y_0)``, at least 0; None for a signal at its target from
    the start.
    """
    if not len(values) or values[0] == target:
        return None
    distance = target - float(values[0])
    return max(0.0, float(np.max((values - target) / distance)))


def measure_settling_time(time: Floats, values: Floats, target: float, band: float) -> float | None:
    """Return the time after which ``|y_i - y_target| <= band`` to the end, s; None when it never does."""
    outside = np.flatnonzero(~(np.abs(values - target) <= band))
    if not len(values) or (outside.size and outside[-1] == len(values) - 1):
        return None
    return float(time[outside[-1] + 1] - time[0]) if outside.size else 0.0


def measure_amplitude(values: Floats) -> float:
    """Return half the distance from a signal's lowest to its highest value."""
    return 0.5 * float(np.ptp(values))


def measure_frequency(time: Floats, values: Floats) -> float | None:
    """Return how often a signal rises through its mean, Hz; None when it does so less than three times."""
    above = values > values.mean() if len(values) else np.empty(0, dtype=bool)
    rises = np.flatnonzero(~above[:-1] & above[1:])
    if rises.size < 3:
        return None
    return float((rises.size - 1) / (time[rises[-1]] - time[rises[0]]))


def find_stretches(rows: Flags) -> list[slice]:
    """Return the unbroken stretches of chosen rows, in order. `rows` bool (t,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]])))
    return [
        slice(int(first), int(after)) for first, after in zip(edges[::2], edges[1::2], strict=True)
    ]


def measure_oscillation(time: Floats, values: Floats, rows: Flags) -> float | None:
    """Return the rms over time of a signal less its moving average.

    ``sqrt(sum w_i (y_i - m_i)² / sum w_i)``, m_i the mean of y over the window, s, around row i. A
    row counts when its whole window is within an unbroken stretch of the chosen rows; None when no
    row does.
    """
    off: list[Floats] = []
    weight: list[Floats] = []
    for stretch in find_stretches(rows):
        t, y = time[stretch], values[stretch]
        area = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
        # Half a millionth of the window: an edge on the first row is within.
        inner = (t - 0.5 * WINDOW >= t[0] - 5e-7 * WINDOW) & (
            t + 0.5 * WINDOW <= t[-1] + 5e-7 * WINDOW
        )
        below, above = (np.interp(t[inner] + side * WINDOW, t, area) for side in (-0.5, 0.5))
        off.append(y[inner] - (above - below) / WINDOW)
        weight.append(compute_weights(t)[inner])
    return compute_rms(np.concatenate(off), np.concatenate(weight)) if off else None
