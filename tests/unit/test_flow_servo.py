"""Height servos: Method III's brings loaded pins to their heights in time, for every flow law and delay."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.control.flow_servo import FlowServo, make_flow_servo
from digiclay.core.control.servo import Tracking, lock_overloaded
from digiclay.core.model.physics import Cell
from digiclay.core.model.valve import Valve

from tests.assemble import make_system

PERIOD, BAND = 5e-3, 1e-6


def cell_of(**parts: Any) -> Cell:
    """Return the cells of a default bed with some parts changed."""
    return make_system(**parts).cell


def servo_of(cell: Cell, dead_time: float = 1e-3) -> FlowServo:
    """Return the servo of a cell."""
    return make_flow_servo(cell, PERIOD, dead_time, BAND)


def test_the_delay_is_dead_time_and_lag() -> None:
    # A lag of 2 ms takes 2 (1 - exp(-5/2)) ms of a period of 5 ms.
    servo = servo_of(cell_of())
    assert servo.left == pytest.approx((1e-3 + 2e-3 * (1.0 - np.exp(-2.5)),), rel=1e-3)


def test_commands_that_act_for_more_than_a_period_are_all_allowed_for() -> None:
    servo = servo_of(cell_of(valve_lag=None), 12e-3)
    assert servo.left == pytest.approx((5e-3, 5e-3, 2e-3))
    assert servo.span == pytest.approx(2.0 * PERIOD - 2e-3)
    # Earlier ones are put behind the newest.
    speeds, still = np.array([[1e-3], [2e-3], [3e-3]]), np.zeros(1)
    servo.serve(np.array([2e-3 * servo.span]), servo.find_limits(still), still, speeds)
    assert speeds[:, 0] == pytest.approx([2e-3, 1e-3, 2e-3])


@pytest.mark.parametrize("orifice", [0.5e-3, 1.0e-3])
@pytest.mark.parametrize("force", [0.0, 0.05, 0.1])
def test_the_opening_gives_the_speed_asked_for_under_load(orifice: float, force: float) -> None:
    cell = cell_of(valve=Valve(orifice_diameter=orifice))
    servo = servo_of(cell)
    speeds, load = np.zeros((servo.rows, 4)), np.full(4, force)
    limits = servo.find_limits(load)
    asked = np.array([0.1, 0.4, -0.3, -0.8]) * np.array([limits[1][0]] * 2 + [-limits[0][0]] * 2)
    command = servo.serve(asked * servo.span, limits, load, speeds)
    drop = cell.supply.pressure(command) - cell.actuator.pressure(load)
    # Interpolation in 129 openings; with the wide orifice the flow turns turbulent, and one step refines it.
    assert cell.flow.flow(command, drop) / cell.actuator.area == pytest.approx(asked, rel=0.03)
    assert speeds[0] == pytest.approx(asked)


def test_an_overloaded_pin_is_not_opened_upwards_nor_one_within_the_dead_band() -> None:
    servo = servo_of(cell_of())
    speeds, load = np.zeros((servo.rows, 3)), np.array([servo.lift * 1.1, 0.0, 0.0])
    errors = np.array([1e-3, 0.9 * BAND, -0.9 * BAND])
    assert servo.serve(errors, servo.find_limits(load), load, speeds).tolist() == [0.0] * 3


@pytest.mark.parametrize("dead_time", [0.0, 1e-3, 7e-3, 20e-3])
def test_a_free_pin_comes_to_its_height_without_swinging(dead_time: float) -> None:
    servo = servo_of(cell_of(valve_lag=None), dead_time)
    speeds, height, still = np.zeros((servo.rows, 1)), np.zeros(1), np.zeros(1)
    queue = [0.0] * (len(servo.left) + 1)
    heights = []
    for _ in range(40):
        servo.serve(1e-3 - servo.coast(height, speeds), servo.find_limits(still), still, speeds)
        queue = [float(speeds[0, 0]), *queue[:-1]]
        whole, part = divmod(dead_time / PERIOD + 1e-9, 1.0)
        # What the valve lets through in this period: the older command first, then the newer one.
        height = height + PERIOD * (
            part * queue[int(whole) + 1 if part > 1e-6 else int(whole)] + (1.0 - part) * queue[int(whole)]
        )
        heights.append(float(height[0]))
    assert heights[-1] == pytest.approx(1e-3, abs=2.0 * BAND)
    assert max(heights) <= 1.02e-3


# Proportional control of Methods I and II


@pytest.mark.parametrize(
    ("error", "command"),
    [
        pytest.param([1.0, -0.5], [0.5, -0.25], id="gain times error"),
        pytest.param([10.0, -10.0], [1.0, -1.0], id="limited to a fully open valve"),
        pytest.param([0.0099, -0.0099, 0.0], [0.0, 0.0, 0.0], id="within the dead band"),
        pytest.param([0.0101, -0.0101], [0.00505, -0.00505], id="just beyond it"),
    ],
)
def test_the_command_is_proportional_to_the_height_error(error: list[float], command: list[float]) -> None:
    height = np.full(len(error), 50e-3)
    # Rounding of the difference.
    assert Tracking().command(height + np.array(error) * 1e-3, height) == pytest.approx(command, rel=1e-10)
    assert not Tracking(position_gain=0.0).command(height + 1.0, height).any()


@pytest.mark.parametrize(
    ("command", "force", "locked"),
    [([0.5, 0.5], [0.16, 0.15], [0.0, 0.5]), ([-0.5], [1.0], [-0.5]), ([], [], [])],
    ids=["not raised", "but lowered", "no cell"],
)
def test_an_overloaded_cell_is_locked(command: list[float], force: list[float], locked: list[float]) -> None:
    # The high reservoir lifts 0.157 N: 0.5 bar on a bore of 2 mm.
    assert lock_overloaded(np.array(command), np.array(force), 0.157).tolist() == locked
