"""Metrics of one signal over time: averages, overshoot, settling, oscillation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats

#: Window of the moving average that is taken off for an oscillation, s. What is left of a sine of f Hz is
#: 1 - sinc(f WINDOW): less than a tenth below 1 Hz, where fingers move on purpose, and all of it at 4 Hz; a
#: controller on its limit of stability oscillates at 4 to 10 Hz (digiclay paper).
WINDOW = 0.25


def compute_weights(time: ArrayLike) -> Floats:
    """Return the time each row stands for, s: ``w_i = (t_{i+1} - t_{i-1}) / 2``, half of it at the ends.

    `time` (t,), increasing, s. Returns (t,), the weight of a single row is 1.
    """
    moment = np.asarray(time, dtype=np.float64)
    if len(moment) < 2:
        return np.ones(len(moment))
    half = 0.5 * np.diff(moment)
    each: Floats = np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half])
    return each


def compute_mean(values: Floats, weight: Floats) -> float | None:
    """Return the weighted mean, or None when there is nothing to average. `values`, `weight` (t,)."""
    total = float(np.sum(weight))
    return float(np.sum(weight * values)) / total if total > 0.0 else None


def compute_deviation(values: Floats, weight: Floats) -> float | None:
    """Return the weighted standard deviation about the weighted mean, or None without any rows.

    `values`, `weight` (t,).
    """
    middle = compute_mean(values, weight)
    if middle is None:
        return None
    square = compute_mean((values - middle) ** 2, weight)
    return None if square is None else float(np.sqrt(square))


def measure_overshoot(values: ArrayLike, target: float) -> float | None:
    """Return how far a signal goes beyond its target, as a share of its way there.

    ``max_i (y_i - y_target) / (y_target - y_0)``, at least 0; a falling signal is judged alike.

    `values` (t,), the signal, from the row in which it sets out. Returns 0 for a signal that never passes its
    target; None for one that has no way to go.
    """
    signal = np.asarray(values, dtype=np.float64)
    if not len(signal) or signal[0] == target:
        return None
    way = target - float(signal[0])
    return max(0.0, float(np.max((signal - target) / way)))


def measure_settling_time(time: ArrayLike, values: ArrayLike, target: float, band: float) -> float | None:
    """Return the time after which a signal stays within a band about its target, s.

    From the first row to the first one from which on ``|y_i - y_target| <= band`` to the end.

    `time`, `values` (t,), s, and the signal; `target`, `band`: in the signal's unit. Returns none when the
    signal is outside the band at its end, or has no rows.
    """
    moment, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    outside = np.flatnonzero(~(np.abs(signal - target) <= band))
    if not len(signal) or (outside.size and outside[-1] == len(signal) - 1):
        return None
    return float(moment[outside[-1] + 1] - moment[0]) if outside.size else 0.0


def measure_amplitude(values: ArrayLike) -> float:
    """Return half the distance from a signal's lowest to its highest value."""
    return 0.5 * float(np.ptp(np.asarray(values, dtype=np.float64)))


def measure_frequency(time: ArrayLike, values: ArrayLike) -> float | None:
    """Return how often a signal rises through its mean, Hz; None when it does so less than three times.

    `time`, `values` (t,), s, and the signal.
    """
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

    ``sqrt(sum w_i (y_i - m_i)² / sum w_i)``, m_i the mean of y over the window around row i. A row
    counts when its whole window is within an unbroken stretch of the chosen rows.

    `time`, `values` (t,), increasing, s, and the signal; `rows` bool (t,), chosen rows; `window`, s. Returns
    none when no stretch is as long as the window.
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
    if not off:
        return None
    square = compute_mean(np.concatenate(off) ** 2, np.concatenate(weight))
    return None if square is None else float(np.sqrt(square))
