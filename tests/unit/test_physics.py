"""How fast pins can go: what a wide open valve does, and where no pin can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.layout import Layout
from digiclay.core.model.physics import Speeds, find_speeds
from digiclay.core.model.valve import Fluid

from tests.assemble import AWAY, make_system, one_cell, path, record, scripted

#: A laminar valve, a turbulent one, and reservoirs of unlike pressures.
DEVICES = [{}, {"fluid": Fluid(viscosity=1.6e-9)}, {"supply": Supply(0.8e5, -0.2e5)}]


@pytest.mark.parametrize("parts", DEVICES)
@pytest.mark.parametrize("opening", [1.0, -1.0])
def test_a_free_pin_under_a_wide_open_valve_goes_at_exactly_the_speed_that_is_said(
    parts: dict[str, object], opening: float
) -> None:
    system = one_cell(dead_time=0.0, valve_lag=None, control=scripted(lambda t, x, y: opening), **parts)
    height = record(system, AWAY, 3).height[:, 0]
    said = find_speeds(system.cell)
    speed = (height[3] - height[2]) / system.period
    assert speed == pytest.approx(said.rise if opening > 0.0 else said.fall, rel=1e-9)
    assert system.fastest == said.rise > 0.0 > said.fall


def test_reservoirs_above_the_air_let_no_pin_fall() -> None:
    assert find_speeds(one_cell(supply=Supply(0.8e5, 0.2e5)).cell).fall == 0.0


def test_reservoirs_below_the_air_let_no_pin_rise() -> None:
    system = one_cell(supply=Supply(-0.2e5, -0.8e5))
    assert system.fastest == find_speeds(system.cell).rise == 0.0


def test_a_finger_is_not_missed_by_pins_that_rise_towards_it_as_fast_as_they_can() -> None:
    # A set of cells serves for 32 periods and counts on no pin rising faster than `fastest`. The pins come up
    # 29 mm, to a finger that stands still 25 mm above them.
    system = make_system(
        Layout(9, 9),
        dead_time=0.0,
        valve_lag=None,
        control=scripted(lambda t, x, y: 1.0),
        actuator=Actuator(bore=0.5e-3, rest_height=10e-3),
    )
    count = round(29e-3 / (system.fastest * system.period))
    run = record(system, path((0.0, 0.0, 0.0, 35.0)), count)
    assert count < 64
    assert run.force[-1].max() > 0.0
    known = replace(system, fastest=1.0)
    assert np.array_equal(record(known, path((0.0, 0.0, 0.0, 35.0)), count).force, run.force)


def test_a_pin_is_no_lower_than_it_was_or_the_finger_came_but_for_its_fall() -> None:
    height, under = np.array([40e-3, 40e-3, 40e-3]), np.array([[50e-3, 35e-3], [45e-3, 38e-3]])
    lowest, highest = Speeds(-0.2, 0.1).reach(height, under, 5e-3)
    np.testing.assert_allclose(lowest, [39e-3, 34e-3, 39e-3], rtol=1e-12)
    np.testing.assert_allclose(highest, 40.5e-3, rtol=1e-12)
