"""Signals whose overshoot, settling time and oscillation are known without a computer; units of touch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.metrics.force import (
    BORDER,
    SPATIAL_RESOLUTION,
    WINDOW,
    compute_deviation,
    compute_mean,
    find_weber_fractions,
    measure_amplitude,
    measure_frequency,
    measure_oscillation,
    measure_overshoot,
    measure_settling_time,
    perceive,
)

TIME = np.linspace(0.0, 10.0, 10001)
#: A second-order step response with damping 0.5 and 1 rad/s.
DAMPED = np.sqrt(0.75)
RESPONSE = 1.0 - np.exp(-0.5 * TIME) * (np.cos(DAMPED * TIME) + 0.5 / DAMPED * np.sin(DAMPED * TIME))
#: exp(-π ζ / √(1-ζ²)); the peak is flat, a row of 1 ms misses it by 1e-7.
OVERSHOOT = pytest.approx(np.exp(-np.pi * 0.5 / DAMPED), abs=1e-6)


@pytest.mark.parametrize(
    ("values", "target", "wanted"),
    [
        pytest.param(RESPONSE, 1.0, OVERSHOOT, id="a second-order system, by its formula"),
        pytest.param(-RESPONSE, -1.0, OVERSHOOT, id="a falling signal, like its mirror image"),
        pytest.param([2.0, 7.0], 4.0, 1.5, id="a share of the way"),
        pytest.param(1.0 - np.exp(-TIME), 1.0, 0.0, id="a signal that never passes its target"),
        pytest.param([1.0, 2.0], 1.0, None, id="a signal that starts at its target"),
    ],
)
def test_the_overshoot_is_known(values: Any, target: float, wanted: Any) -> None:
    assert measure_overshoot(values, target) == wanted


@pytest.mark.parametrize(
    ("time", "values", "target", "band", "wanted"),
    [
        pytest.param(
            TIME, 1.0 - np.exp(-TIME), 1.0, 0.05, pytest.approx(np.log(20.0), abs=1e-3), id="an exponential"
        ),
        pytest.param(
            TIME, np.where((TIME > 4.0) & (TIME < 5.0), 1.2, 1.0), 1.0, 0.1,
            pytest.approx(5.0, abs=1e-9), id="a signal that leaves its band again",
        ),
        pytest.param(TIME, np.sin(TIME), 0.0, 0.1, None, id="a signal outside its band at the end"),
        pytest.param([0.0, 1.0], [1.0, np.nan], 1.0, 0.1, None, id="a signal that is not a number"),
        pytest.param(TIME, np.ones(10001), 1.0, 0.1, 0.0, id="a signal always in its band"),
    ],
)  # fmt: skip
def test_the_settling_time_is_known(time: Any, values: Any, target: float, band: float, wanted: Any) -> None:
    assert measure_settling_time(time, values, target, band) == wanted


def test_a_sine_has_its_amplitude_and_frequency_and_a_drift_has_none() -> None:
    assert measure_amplitude(3.0 + 0.2 * np.sin(8.0 * TIME)) == pytest.approx(0.2, rel=1e-4)
    # Ten rises; each is found to a row of 1 ms.
    assert measure_frequency(TIME, np.sin(2.0 * np.pi * 1.3 * TIME + 0.3)) == pytest.approx(1.3, rel=1e-3)
    assert measure_frequency(TIME, TIME) is None


def test_mean_and_deviation_are_weighted_and_nothing_has_none() -> None:
    # A value for 3 s and another, 4 higher, for 1 s: mean 1, variance (3·1 + 1·9)/4.
    values, weight, nothing = np.array([0.0, 4.0]), np.array([3.0, 1.0]), np.empty(0)
    assert compute_deviation(values, weight) == pytest.approx(np.sqrt(3.0), rel=1e-12)
    assert (compute_mean(nothing, nothing), compute_deviation(nothing, nothing)) == (None, None)


#: Half a minute of a sine of each of these frequencies, Hz, with rows of 2 ms.
MOMENTS = np.arange(0.0, 30.0, 2e-3)
ALL_ROWS = np.ones(len(MOMENTS), dtype=bool)


@pytest.mark.parametrize("frequency", [1.0, 2.0, 4.0, 9.0])
def test_of_a_sine_the_share_beside_its_moving_average_counts_as_oscillation(frequency: float) -> None:
    found = measure_oscillation(MOMENTS, 3.0 + np.sin(2.0 * np.pi * frequency * MOMENTS), ALL_ROWS)
    # The moving average of a sine is its sinc; 29.75 s are no whole number of periods.
    assert found == pytest.approx((1.0 - np.sinc(frequency * WINDOW)) / np.sqrt(2.0), rel=0.01)


@pytest.mark.parametrize(
    ("values", "rows", "wanted"),
    [
        pytest.param(2.0 * MOMENTS - 7.0, ALL_ROWS, 0.0, id="a straight line"),
        pytest.param(
            np.where(MOMENTS < 1.5, 0.0, 5.0), (MOMENTS < 1.0) | (MOMENTS > 2.0), 0.0,
            id="a jump between two stretches",
        ),
        pytest.param(MOMENTS, MOMENTS < WINDOW + 4e-3, 0.0, id="a stretch longer than the window"),
        pytest.param(MOMENTS, MOMENTS < WINDOW - 2e-3, None, id="a stretch shorter than the window"),
    ],
)  # fmt: skip
def test_what_follows_its_moving_average_does_not_oscillate(values: Any, rows: Any, wanted: Any) -> None:
    found = measure_oscillation(MOMENTS, values, rows)
    assert found is None if wanted is None else found == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("force", "fractions"),
    [
        # Gueorguiev and others 2022; Pang, Tan and Durlach 1991 have 7 % from 2.5 to 10 N.
        *((force, (0.07, 0.10)) for force in (0.5, 0.76, 2.5, 10.0)),
        *((force, (0.15, 0.27)) for force in (0.01, 0.4, math.nextafter(BORDER, 0.0))),
    ],
)
def test_a_jnd_is_7_to_10_percent_from_half_a_newton_on_and_15_to_27_below(force, fractions):
    assert find_weber_fractions(force) == fractions


def test_deviations_are_counted_in_units_of_touch() -> None:
    assert list(perceive(0.15 * 0.4, 0.4, None).values())[:2] == pytest.approx([15 / 27, 1.0])
    assert list(perceive(0.10 * 2.5, 2.5, None).values())[:2] == pytest.approx([1.0, 10 / 7])
    # Van Boven and Johnson 1994: 0.94 mm at the finger.
    assert pytest.approx(0.94e-3) == SPATIAL_RESOLUTION
    assert perceive(None, None, 0.47e-3)["ridge_unevenness_touch"] == pytest.approx(0.5)
    assert set(perceive(0.1, None, None).values()) == {None}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((-0.1, 0.4, 0.0), "Perception.deviation must be at least 0 N"),
        ((math.nan, 0.4, 0.0), "Perception.deviation must be at least 0 N"),
        ((0.1, 0.0, 0.0), "Perception.force must be above 0 N"),
        ((0.1, math.nan, 0.0), "Perception.force must be above 0 N"),
        ((0.1, math.inf, 0.0), "Perception.force must be above 0 N"),
        ((0.1, 0.4, math.inf), "Perception.unevenness must be at least 0 m"),
    ],
)
def test_what_is_no_deviation_is_refused(values: tuple[float, float, float], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        perceive(*values)
