"""The cylinder under a pin (equations 1 and 2): speed, balance, volume, end stops."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.contact import Contact
from digiclay.core.model.layout import Layout
from digiclay.core.model.physics import find_speeds
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.valve import Fluid, Valve

from tests.assemble import AWAY, make_system, one_cell, path, record, scripted

RAISE, LOWER = scripted(lambda t, x, y: 1.0), scripted(lambda t, x, y: -1.0)
STEPPERS = pytest.mark.parametrize(("stepper", "step"), [("bernoulli", 1e-3), ("runge_kutta_4", 0.5e-3)])
#: Force that the high reservoir balances, N: half a bar on a bore of 2 mm.
BALANCE = 0.5e5 * math.pi * 1e-6


def test_pressure_is_force_over_area_and_speed_is_flow_over_area_but_for_flow_into_a_stop() -> None:
    assert Actuator().pressure(np.array([BALANCE])) == pytest.approx(0.5e5, rel=1e-15)
    flow, height = np.array([1, 1, -1, -1, 1]) * math.pi * 1e-8, np.array([50e-3, 100e-3, 0.0, 100e-3, 0.0])
    assert Actuator().rate(flow, height) == pytest.approx([10e-3, 0.0, 0.0, -10e-3, 10e-3], rel=1e-14)


@pytest.mark.parametrize(
    ("parts", "rise", "fall", "digits"),
    [
        ({}, 24e-3, -24e-3, 0.01),  # as printed
        ({"valve": Valve(orifice_diameter=0.6e-3)}, 50e-3, -50e-3, 0.05),  # the fast preset; to one digit
        ({"fluid": Fluid(viscosity=1.6e-9)}, 0.0, 0.0, math.inf),  # turbulent
        ({"supply": Supply(0.8e5, -0.2e5)}, 38.4e-3, -9.6e-3, 0.01),  # as the drops
    ],
)
def test_a_free_cell_has_the_printed_speed_at_full_valve_exactly_that_of_the_bound(parts, rise, fall, digits):
    for control, printed in ((RAISE, rise), (LOWER, fall)):
        system = one_cell(dead_time=0.0, valve_lag=None, control=control, **parts)
        height, bound = record(system, AWAY, 3).height[:, 0], find_speeds(system.cell)
        speed = (height[3] - height[2]) / system.period
        assert speed == pytest.approx(bound.rise if control is RAISE else bound.fall, rel=1e-9)
        assert math.isinf(digits) or speed == pytest.approx(printed, rel=digits)
        assert system.fastest == bound.rise > 0.0 > bound.fall


@pytest.mark.parametrize(
    ("start", "pulp", "count", "error", "stepper", "step"),
    [
        # The pole is 150 1/s or faster: half a second leaves rounding.
        (49e-3, None, 100, 1e-9, "bernoulli", 1e-3),
        (47e-3, None, 100, 1e-9, "bernoulli", 1e-3),
        (47e-3, None, 100, 1e-9, "runge_kutta_4", 0.5e-3),
        # The pulp still creeps at 3 s, and the flow that makes up for it costs some 0.2 % of the pressure.
        (47e-3, Relaxation(), 600, 5e-3, "bernoulli", 1e-3),
    ],
)
def test_a_pin_under_a_still_finger_comes_to_the_balance_force(start, pulp, count, error, stepper, step):
    # The finger stays with its underside at 48 mm; whatever the start, P_s A_a balances it in the end.
    system = one_cell(
        actuator=Actuator(rest_height=start), relaxation=pulp, contact=Contact(stiffness=1000.0),
        control=RAISE, stepper=stepper, step=step,
    )  # fmt: skip
    run = record(system, path((0.0, 0.0, 0.0, 48.0)), count)
    assert run.force[-1, 0] == pytest.approx(BALANCE, rel=error)


@STEPPERS
@pytest.mark.parametrize(("control", "stop"), [(RAISE, 100e-3), (LOWER, 0.0)])
def test_a_pin_rests_exactly_at_its_end_stop(control: Any, stop: float, stepper: str, step: float) -> None:
    start = Actuator(rest_height=98e-3 if stop else 2e-3)
    run = record(one_cell(actuator=start, control=control, stepper=stepper, step=step), AWAY, 60)
    assert run.height[-10:, 0].tolist() == [stop] * 10


@STEPPERS
def test_a_pin_on_its_end_stop_feels_the_indentation_beyond_where_force_begins(stepper, step):
    # The valve is open downwards: the stop holds the pin, and the finger presses on it.
    contact, start = Contact(offset=0.5e-3), Actuator(rest_height=0.0)
    system = one_cell(
        actuator=start, contact=contact, relaxation=None, control=LOWER, stepper=stepper, step=step
    )
    run = record(system, path((0.0, 0.0, 0.0, 1.0), (0.05, 0.0, 0.0, -1.5), (0.1, 0.0, 0.0, -1.5)), 20)
    m, wanted = contact.exponent, contact.share * contact.stiffness / contact.exponent
    assert run.height[-1, 0] == 0.0
    assert run.force[-1, 0] == pytest.approx(wanted * math.expm1(m * 1.0e-3), rel=1e-9)


def test_a_pin_leaves_its_end_stop_at_once() -> None:
    turn = scripted(lambda t, x, y: 1.0 if t < 0.05 else -1.0)
    system = one_cell(actuator=Actuator(rest_height=100e-3), valve_lag=None, dead_time=0.0, control=turn)
    run = record(system, AWAY, 12)
    assert run.height[10, 0] == 100e-3
    assert run.height[11, 0] == pytest.approx(100e-3 - 24e-3 * 5e-3, rel=0.01)  # free speed to two digits


def test_reservoirs_above_the_air_let_no_pin_fall_and_reservoirs_below_it_none_rise() -> None:
    above, below = (one_cell(supply=Supply(*ends)) for ends in ((0.8e5, 0.2e5), (-0.2e5, -0.8e5)))
    assert find_speeds(above.cell).fall == find_speeds(below.cell).rise == below.fastest == 0.0


def test_a_finger_is_not_missed_by_pins_that_rise_towards_it_as_fast_as_they_can() -> None:
    # A set of cells serves for 32 periods and counts on no pin rising faster than `fastest`. The pins come up
    # 29 mm, to a finger that stands still 25 mm above them.
    start = Actuator(bore=0.5e-3, rest_height=10e-3)
    system = make_system(Layout(9, 9), dead_time=0.0, valve_lag=None, control=RAISE, actuator=start)
    count, still = round(29e-3 / (system.fastest * system.period)), path((0.0, 0.0, 0.0, 35.0))
    force = record(system, still, count).force
    assert count < 64
    assert force[-1].max() > 0.0
    assert np.array_equal(record(replace(system, fastest=1.0), still, count).force, force)
