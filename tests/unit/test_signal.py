"""Signals whose overshoot, settling time and oscillation are known without a computer."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.metrics.force import (
    WINDOW,
    compute_deviation,
    compute_mean,
    measure_amplitude,
    measure_frequency,
    measure_oscillation,
    measure_overshoot,
    measure_settling_time,
)

TIME = np.linspace(0.0, 10.0, 10001)
#: A second-order step response with damping 0.5 and 1 rad/s.
DAMPED = np.sqrt(0.75)
RESPONSE = 1.0 - np.exp(-0.5 * TIME) * (np.cos(DAMPED * TIME) + 0.5 / DAMPED * np.sin(DAMPED * TIME))


def test_a_second_order_system_overshoots_by_its_formula() -> None:
    # exp(-π ζ / √(1-ζ²)); the peak is flat, a row of 1 ms misses it by 1e-7.
    assert measure_overshoot(RESPONSE, 1.0) == pytest.approx(np.exp(-np.pi * 0.5 / DAMPED), abs=1e-6)


def test_a_falling_signal_overshoots_like_its_mirror_image() -> None:
    assert measure_overshoot(-RESPONSE, -1.0) == measure_overshoot(RESPONSE, 1.0)


def test_the_overshoot_is_a_share_of_the_way() -> None:
    assert measure_overshoot([2.0, 7.0], 4.0) == 1.5


def test_a_signal_that_never_passes_its_target_does_not_overshoot() -> None:
    assert measure_overshoot(1.0 - np.exp(-TIME), 1.0) == 0.0


def test_a_signal_that_starts_at_its_target_has_no_overshoot_to_speak_of() -> None:
    assert measure_overshoot([1.0, 2.0], 1.0) is None


def test_an_exponential_settles_at_the_logarithm_of_its_band() -> None:
    assert measure_settling_time(TIME, 1.0 - np.exp(-TIME), 1.0, 0.05) == pytest.approx(
        np.log(20.0), abs=1e-3
    )


def test_a_signal_that_leaves_its_band_again_has_not_settled_before() -> None:
    signal = np.where((TIME > 4.0) & (TIME < 5.0), 1.2, 1.0)
    assert measure_settling_time(TIME, signal, 1.0, 0.1) == pytest.approx(5.0, abs=1e-9)


def test_a_signal_outside_its_band_at_the_end_never_settles() -> None:
    assert measure_settling_time(TIME, np.sin(TIME), 0.0, 0.1) is None


def test_a_signal_that_is_not_a_number_never_settles() -> None:
    assert measure_settling_time([0.0, 1.0], [1.0, np.nan], 1.0, 0.1) is None


def test_a_signal_always_in_its_band_settles_at_once() -> None:
    assert measure_settling_time(TIME, np.ones(10001), 1.0, 0.1) == 0.0


def test_the_amplitude_of_a_sine_about_an_offset_is_its_own() -> None:
    assert measure_amplitude(3.0 + 0.2 * np.sin(8.0 * TIME)) == pytest.approx(0.2, rel=1e-4)


def test_the_frequency_of_a_sine_is_its_own() -> None:
    # Ten rises; each is found to a row of 1 ms.
    assert measure_frequency(TIME, np.sin(2.0 * np.pi * 1.3 * TIME + 0.3)) == pytest.approx(1.3, rel=1e-3)


def test_a_drift_has_no_frequency() -> None:
    assert measure_frequency(TIME, TIME) is None


def test_the_deviation_is_weighted() -> None:
    # A value for 3 s and another, 4 higher, for 1 s: mean 1, variance (3·1 + 1·9)/4.
    assert compute_deviation(np.array([0.0, 4.0]), np.array([3.0, 1.0])) == pytest.approx(
        np.sqrt(3.0), rel=1e-12
    )


def test_nothing_has_no_mean_and_no_deviation() -> None:
    assert (compute_mean(np.empty(0), np.empty(0)), compute_deviation(np.empty(0), np.empty(0))) == (
        None,
        None,
    )


#: Half a minute of a sine of each of these frequencies, Hz, with rows of 2 ms.
MOMENTS = np.arange(0.0, 30.0, 2e-3)
ALL_ROWS = np.ones(len(MOMENTS), dtype=bool)


@pytest.mark.parametrize("frequency", [1.0, 2.0, 4.0, 9.0])
def test_of_a_sine_the_share_beside_its_moving_average_counts_as_oscillation(frequency: float) -> None:
    found = measure_oscillation(MOMENTS, 3.0 + np.sin(2.0 * np.pi * frequency * MOMENTS), ALL_ROWS)
    # The moving average of a sine is its sinc; 29.75 s are no whole number of periods.
    assert found == pytest.approx((1.0 - np.sinc(frequency * WINDOW)) / np.sqrt(2.0), rel=0.01)


def test_a_straight_line_does_not_oscillate() -> None:
    assert measure_oscillation(MOMENTS, 2.0 * MOMENTS - 7.0, ALL_ROWS) == pytest.approx(0.0, abs=1e-9)


def test_a_jump_between_two_stretches_is_no_oscillation() -> None:
    rows = (MOMENTS < 1.0) | (MOMENTS > 2.0)
    assert measure_oscillation(MOMENTS, np.where(MOMENTS < 1.5, 0.0, 5.0), rows) == pytest.approx(
        0.0, abs=1e-9
    )


def test_a_stretch_shorter_than_the_window_has_no_oscillation() -> None:
    shorter, longer = MOMENTS < WINDOW - 2e-3, MOMENTS < WINDOW + 4e-3
    assert measure_oscillation(MOMENTS, MOMENTS, shorter) is None
    assert measure_oscillation(MOMENTS, MOMENTS, longer) == pytest.approx(0.0, abs=1e-9)
