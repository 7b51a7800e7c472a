"""Signals over time against closed forms: overshoot, settling time, frequency, oscillation."""

import numpy as np
import pytest
from digiclay.core.metrics.signals import (
    WINDOW,
    compute_deviation,
    compute_mean,
    measure_amplitude,
    measure_frequency,
    measure_oscillation,
    measure_overshoot,
    measure_settling_time,
)

from tests.assemble import table

FINE = np.linspace(0.0, 10.0, 10001)
#: A second-order step response with damping 0.5 and 1 rad/s.
DAMPED = np.sqrt(0.75)
RESPONSE = 1.0 - np.exp(-0.5 * FINE) * (
    np.cos(DAMPED * FINE) + 0.5 / DAMPED * np.sin(DAMPED * FINE)
)
#: exp(-π ζ / √(1-ζ²)); the peak is flat, a row of 1 ms misses it by 1e-7.
OVERSHOOT = pytest.approx(np.exp(-np.pi * 0.5 / DAMPED), abs=1e-6)


@table(
    "values, target, wanted",
    {
        "a second-order system, by its formula": (RESPONSE, 1.0, OVERSHOOT),
        "a falling signal, like its mirror image": (-RESPONSE, -1.0, OVERSHOOT),
        "a share of the way": (np.array([2.0, 7.0]), 4.0, 1.5),
        "a signal that never passes its target": (1.0 - np.exp(-FINE), 1.0, 0.0),
        "a signal that starts at its target": (np.array([1.0, 2.0]), 1.0, None),
    },
)
def test_the_overshoot_is_known(values, target, wanted):
    assert measure_overshoot(values, target) == wanted


@table(
    "time, values, target, band, wanted",
    {
        "an exponential": (
            FINE,
            1.0 - np.exp(-FINE),
            1.0,
            0.05,
            pytest.approx(np.log(20.0), abs=1e-3),
        ),
        "a signal that leaves its band again": (
            FINE,
            np.where((FINE > 4.0) & (FINE < 5.0), 1.2, 1.0),
            1.0,
            0.1,
            pytest.approx(5.0, abs=1e-9),
        ),
        "a signal outside its band at the end": (FINE, np.sin(FINE), 0.0, 0.1, None),
        "a signal that is not a number": (FINE[:2], np.array([1.0, np.nan]), 1.0, 0.1, None),
        "a signal always in its band": (FINE, np.ones(10001), 1.0, 0.1, 0.0),
    },
)
def test_the_settling_time_is_known(time, values, target, band, wanted):
    assert measure_settling_time(time, values, target, band) == wanted


def test_a_sine_has_its_amplitude_and_frequency_and_mean_and_deviation_are_weighted():
    assert measure_amplitude(3.0 + 0.2 * np.sin(8.0 * FINE)) == pytest.approx(0.2, rel=1e-4)
    # Ten rises; each is found to a row of 1 ms.
    assert measure_frequency(FINE, np.sin(2.0 * np.pi * 1.3 * FINE + 0.3)) == pytest.approx(
        1.3, rel=1e-3
    )
    assert measure_frequency(FINE, FINE) is None
    # A value for 3 s and another, 4 higher, for 1 s: mean 1, variance (3·1 + 1·9)/4.
    values, weight, nothing = np.array([0.0, 4.0]), np.array([3.0, 1.0]), np.empty(0)
    assert compute_deviation(values, weight) == pytest.approx(np.sqrt(3.0), rel=1e-12)
    assert (compute_mean(nothing, nothing), compute_deviation(nothing, nothing)) == (
        None,
        None,
    )


#: Half a minute of a sine of each of these frequencies, Hz, with rows of 2 ms.
MOMENTS = np.arange(0.0, 30.0, 2e-3)
ALL_ROWS = np.ones(len(MOMENTS), dtype=bool)


@pytest.mark.parametrize("frequency", [1.0, 2.0, 4.0, 9.0])
def test_of_a_sine_the_share_beside_its_moving_average_counts_as_oscillation(frequency):
    found = measure_oscillation(MOMENTS, 3.0 + np.sin(2.0 * np.pi * frequency * MOMENTS), ALL_ROWS)
    # The moving average of a sine is its sinc; 29.75 s are no whole number of periods.
    assert found == pytest.approx((1.0 - np.sinc(frequency * WINDOW)) / np.sqrt(2.0), rel=0.01)


@table(
    "values, rows, wanted",
    {
        "a straight line": (2.0 * MOMENTS - 7.0, ALL_ROWS, 0.0),
        "a jump between two stretches": (
            np.where(MOMENTS < 1.5, 0.0, 5.0),
            (MOMENTS < 1.0) | (MOMENTS > 2.0),
            0.0,
        ),
        "a stretch longer than the window": (MOMENTS, MOMENTS < WINDOW + 4e-3, 0.0),
        "a stretch shorter than the window": (MOMENTS, MOMENTS < WINDOW - 2e-3, None),
    },
)
def test_what_follows_its_moving_average_does_not_oscillate(values, rows, wanted):
    found = measure_oscillation(MOMENTS, values, rows)
    assert found is None if wanted is None else found == pytest.approx(0.0, abs=1e-9)
