"""The cylinder under a pin (equations 1 and 2): speed, balance, volume, end stops."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.contact import Contact
from digiclay.core.model.valve import Valve
from scipy.integrate import quad

from tests.assemble import AWAY, one_cell, path, record, scripted

RAISE, LOWER = scripted(lambda t, x, y: 1.0), scripted(lambda t, x, y: -1.0)
STEPPERS = [("bernoulli", 1e-3), ("runge_kutta_4", 0.5e-3)]


def test_pressure_is_force_over_area() -> None:
    # 0.157 N on a bore of 2 mm is half a bar.
    assert Actuator().pressure(np.array([0.5e5 * math.pi * 1e-6])) == pytest.approx(0.5e5, rel=1e-15)


def test_speed_is_flow_over_area() -> None:
    rate = Actuator().rate(np.array([math.pi * 1e-8]), np.array([50e-3]))
    assert rate == pytest.approx(10e-3, rel=1e-14)


@pytest.mark.parametrize(("control", "sign"), [(RAISE, 1.0), (LOWER, -1.0)])
def test_a_free_cell_moves_at_24_mm_s_at_full_valve(control: object, sign: float) -> None:
    run = record(one_cell(control=control), AWAY, 40)
    speed = (run.height[-1, 0] - run.height[-11, 0]) / 50e-3
    assert speed == pytest.approx(sign * 24e-3, rel=0.01)  # given to two digits


def test_a_free_cell_of_the_fast_preset_moves_at_50_mm_s() -> None:
    run = record(one_cell(valve=Valve(orifice_diameter=0.6e-3), control=RAISE), AWAY, 40)
    speed = (run.height[-1, 0] - run.height[-11, 0]) / 50e-3
    assert speed == pytest.approx(50e-3, rel=0.05)  # given to one digit


@pytest.mark.parametrize(("stepper", "step"), STEPPERS)
@pytest.mark.parametrize("start", [49e-3, 47e-3], ids=["from below", "from above"])
def test_a_pin_under_a_still_elastic_finger_comes_to_the_balance_force(
    stepper: str, step: float, start: float
) -> None:
    # The finger stays with its underside at 48 mm; whatever the start, P_s A_a balances it in the end.
    system = one_cell(
        actuator=Actuator(rest_height=start), relaxation=None, contact=Contact(stiffness=1000.0),
        control=RAISE, stepper=stepper, step=step,
    )  # fmt: skip
    run = record(system, path((0.0, 0.0, 0.0, 48.0)), 100)
    # The pole is 150 1/s or faster: half a second leaves rounding.
    assert run.force[-1, 0] == pytest.approx(0.5e5 * math.pi * 1e-6, rel=1e-9)


@pytest.mark.parametrize(("stepper", "step"), STEPPERS)
def test_a_pin_under_a_still_relaxing_finger_comes_to_the_balance_force(stepper: str, step: float) -> None:
    system = one_cell(
        actuator=Actuator(rest_height=47e-3), contact=Contact(stiffness=1000.0),
        control=RAISE, stepper=stepper, step=step,
    )  # fmt: skip
    run = record(system, path((0.0, 0.0, 0.0, 48.0)), 600)
    # The pulp still creeps at 3 s, and the flow that makes up for it costs some 0.2 % of the pressure.
    assert run.force[-1, 0] == pytest.approx(0.5e5 * math.pi * 1e-6, rel=5e-3)


def test_the_volume_pumped_is_area_times_height() -> None:
    # The flow of the analytic opening, integrated by quadrature, against the pin's way up.
    system = one_cell(dead_time=0.0, control=scripted(lambda t, x, y: 0.8))
    run = record(system, AWAY, 20)

    def flow(time: float) -> float:
        opening = np.array([0.8 * -math.expm1(-time / 2e-3)])
        return float(system.cell.flow.flow(opening, np.array([0.5e5]))[0])

    volume = quad(flow, 0.0, 0.1, epsabs=0.0, epsrel=1e-10, limit=200)[0]
    way = run.height[-1, 0] - run.height[0, 0]
    # 1 ms steps average K² by two Gauss points: (1/2)^4/4320 of the first few steps' flow.
    assert system.cell.actuator.area * way == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize(("control", "stop"), [(RAISE, 100e-3), (LOWER, 0.0)])
@pytest.mark.parametrize(("stepper", "step"), STEPPERS)
def test_a_pin_rests_exactly_at_its_end_stop(control: object, stop: float, stepper: str, step: float) -> None:
    start = Actuator(rest_height=98e-3 if stop else 2e-3)
    system = one_cell(actuator=start, control=control, stepper=stepper, step=step)
    run = record(system, AWAY, 60)
    assert run.height[-10:, 0].tolist() == [stop] * 10


@pytest.mark.parametrize(("stepper", "step"), STEPPERS)
def test_a_pin_on_its_end_stop_feels_the_indentation_beyond_where_force_begins(
    stepper: str, step: float
) -> None:
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


def test_no_fluid_flows_into_an_end_stop() -> None:
    rate = Actuator().rate(np.array([1e-9, -1e-9]), np.array([100e-3, 0.0]))
    assert rate.tolist() == [0.0, 0.0]


def test_fluid_flows_out_of_an_end_stop() -> None:
    rate = Actuator().rate(np.array([-1e-9, 1e-9]), np.array([100e-3, 0.0]))
    assert np.sign(rate).tolist() == [-1.0, 1.0]


def test_a_finger_cannot_press_a_pin_below_its_stop() -> None:
    # From 1 mm up, down through the floor: the low reservoir opens, the finger presses, the pin stops at 0.
    system = one_cell(actuator=Actuator(rest_height=1e-3), control=LOWER)
    run = record(system, path((0, 0, 0, 1.5), (0.3, 0, 0, -0.5)), 80)
    assert run.height.min() == 0.0
    assert run.force[-1, 0] > 0.0


def test_a_rest_height_above_the_stroke_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"^Actuator\.rest_height must be at most the stroke, 0\.1 m \(got 0\.2 m\)\.$"
    ):
        Actuator(rest_height=0.2)
