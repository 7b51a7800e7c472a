"""Deviations in units of touch, against the numbers of the sources."""

from __future__ import annotations

import math

import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.metrics.force import BORDER, SPATIAL_RESOLUTION, find_weber_fractions, perceive


@pytest.mark.parametrize("force", [0.5, 0.76, 2.5, 10.0])
def test_above_half_a_newton_a_jnd_is_7_to_10_percent(force: float) -> None:
    # Gueorguiev and others 2022; Pang, Tan and Durlach 1991 have 7 % from 2.5 to 10 N.
    assert find_weber_fractions(force) == (0.07, 0.10)


@pytest.mark.parametrize("force", [0.01, 0.4, math.nextafter(BORDER, 0.0)])
def test_below_half_a_newton_a_jnd_is_15_to_27_percent(force: float) -> None:
    assert find_weber_fractions(force) == (0.15, 0.27)


def test_a_deviation_of_one_jnd_counts_as_one() -> None:
    found = perceive(0.15 * 0.4, 0.4, None)
    assert (found.least, found.most) == pytest.approx((15 / 27, 1.0))
    found = perceive(0.10 * 2.5, 2.5, None)
    assert (found.least, found.most) == pytest.approx((1.0, 10 / 7))


def test_unevenness_is_counted_in_grooves_of_the_finest_grating_that_is_told() -> None:
    # Van Boven and Johnson 1994: 0.94 mm at the finger.
    assert pytest.approx(0.94e-3) == SPATIAL_RESOLUTION
    assert perceive(None, None, 0.47e-3).resolutions == pytest.approx(0.5)


def test_without_a_reference_there_is_no_jnd() -> None:
    found = perceive(0.1, None, None).figures()
    assert found == {"rfd_jnd_least": None, "rfd_jnd_most": None, "ridge_unevenness_touch": None}


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
