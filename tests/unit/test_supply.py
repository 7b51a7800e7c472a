"""The reservoirs: which one an opening connects to, and which way the flow goes."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Supply
from digiclay.core.model.physics import compute_rates

from tests.assemble import one_cell


def test_an_opening_above_zero_connects_to_the_high_reservoir() -> None:
    assert Supply().pressure(np.array([1e-12, 1.0])).tolist() == [0.5e5, 0.5e5]


def test_an_opening_below_zero_connects_to_the_low_reservoir() -> None:
    assert Supply().pressure(np.array([-1e-12, -1.0])).tolist() == [-0.5e5, -0.5e5]


def speed_under(force: float, opening: float) -> float:
    """Return how fast a cell moves whose finger presses with `force`, m/s."""
    cell = one_cell(valve_lag=None, relaxation=None).cell
    contact = cell.touch.contact
    depth = np.log1p(force / contact.share * contact.exponent / contact.stiffness) / contact.exponent
    y, under = np.array([[50e-3]]), np.array([50e-3 - depth])
    return float(compute_rates(cell, y, under, np.array([opening]))[0, 0])


def test_a_cell_pressed_harder_than_the_high_reservoir_lifts_sinks_through_the_open_raise_valve() -> None:
    lift = 0.5e5 * np.pi * 1e-6  # P_s A_a = 0.157 N
    assert speed_under(1.5 * lift, 1.0) < 0.0


def test_the_reversed_flow_is_as_large_as_the_drop_says() -> None:
    # Twice the balance force turns ΔP = P_s - F/A_a into its opposite; the laminar flow with it. Rounding.
    lift = 0.5e5 * np.pi * 1e-6
    assert speed_under(2.0 * lift, 1.0) == pytest.approx(-speed_under(0.0, 1.0), rel=1e-9)


def test_a_cell_pressed_with_the_balance_force_stands_still() -> None:
    # Rounding of ΔP: 1e-16 of 0.5 bar, against the free speed of 24 mm/s.
    assert abs(speed_under(0.5e5 * np.pi * 1e-6, 1.0)) < 1e-12


def test_a_load_speeds_up_lowering() -> None:
    assert speed_under(0.1, -1.0) < speed_under(0.0, -1.0) < 0.0


def test_a_locked_cell_stands_still_under_any_load() -> None:
    assert speed_under(1e3, 0.0) == 0.0


def test_a_high_reservoir_below_the_low_one_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"^Supply\.high must be above Supply\.low \(got -60000 Pa, low -50000 Pa\)\.$"
    ):
        Supply(high=-0.6e5)


def test_a_high_reservoir_as_low_as_the_low_one_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^Supply\.high must be above Supply\.low \(got -50000 Pa"):
        Supply(high=-0.5e5)
