"""Method I up to its master: locate, control, model; direction of travel and loss."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.virtual_master import (
    Master,
    Phase,
    VirtualMaster,
    VirtualMasterControl,
    make_master_cell,
)
from digiclay.core.model.conduit import Conduit
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.layout import Layout
from digiclay.core.model.valve import Fluid, Valve

from tests.assemble import make_basis, make_system, master


def control() -> VirtualMasterControl:
    """Return Method I."""
    return make_system(Layout(15, 15), control=VirtualMaster()).controller


def touched(*presses: tuple[float, float, float], height: float = 40.0) -> Measurement:
    """Return a measurement of pressed cells: x, y in mm and force in N."""
    x, y, force = np.array(presses).reshape(-1, 3).T
    level, rest = np.full(x.size, height * 1e-3), np.full(x.size, Mode.REST, np.int8)
    return Measurement(
        make_basis(x * 1e-3, y * 1e-3), level, force, level, rest, np.empty((0, x.size)), np.arange(x.size)
    )


# Locate


NOISY = [(0, 0, 0.1), (6, 0, 9e-3), (-3, 0, 0.1)]


@pytest.mark.parametrize(
    ("before", "floor", "presses", "place"),
    [
        pytest.param(None, 0.0, [(0, 0, 0.1), (3, 0, 0.1), (0, 3, 0.2)], (0.75e-3, 1.5e-3), id="centroid"),
        pytest.param(None, 0.0, [(-20, 0, 0.1), (20, 0, 0.3)], (10e-3, 0.0), id="at first of all cells"),
        pytest.param(master(), 0.0, [(0, 0, 0.1), (6, 0, 0.1), (9, 0, 5.0)], (3e-3, 0.0), id="later near"),
        pytest.param(master(), 10e-3, NOISY, (-1.5e-3, 0.0), id="noise draws it not aside"),
    ],
)
def test_the_master_is_at_the_centroid_of_the_forces(before, floor, presses, place):
    method = replace(control(), floor=floor)
    memory, _ = method.locate(before or method.begin(), touched(*presses))
    assert (memory.x, memory.y) == pytest.approx(place, abs=1e-15)


def test_the_reference_is_the_surface_at_first_touch_and_the_cells_reach_to_the_edge_ring() -> None:
    memory, _ = control().locate(control().begin(), touched((0, 0, 0.05), height=52.0))
    assert memory.reference == pytest.approx(52e-3)
    assert control().locate(master(), touched((0, 0, 0.4)))[1] == pytest.approx((0.0, 0.0, 18.5e-3))
    assert control().locate(control().begin(), touched((0, 0, 0.9e-3)))[1] is None


# Control and noise

IDLE, SPRINGY, SHAPING = Master(), master(phase=Phase.SPRING), master()
#: Memory before, noise floor, N, presses; phase and losses after.
PHASES: dict[str, tuple[Master, float, list[tuple[float, float, float]], Phase, int]] = {
    "too small to be a fingertip": (IDLE, 0.0, [(0, 0, 0.9e-3)], Phase.IDLE, 0),
    "first touch: a spring": (IDLE, 0.0, [(0, 0, 0.1)], Phase.SPRING, 0),
    "a spring below the set point": (SPRINGY, 0.0, [(0, 0, 0.399)], Phase.SPRING, 0),
    "shaping from it on": (SPRINGY, 0.0, [(0, 0, 0.401)], Phase.SHAPING, 0),
    # The centroid takes those within r_VM of the master alone; a flank pressed farther off counts as well.
    "the force of all cells": (SPRINGY, 0.0, [(0, 0, 0.3), (9, 0, 0.11)], Phase.SHAPING, 0),
    "shaping continues below it": (SHAPING, 0.0, [(0, 0, 0.1)], Phase.SHAPING, 0),
    "elsewhere: anew, and counted": (SHAPING, 0.0, [(-18, 0, 0.1)], Phase.SPRING, 1),
    "may be noise": (IDLE, 10e-3, [(0, 0, 9.9e-3)], Phase.IDLE, 0),
    "no noise": (IDLE, 10e-3, [(0, 0, 10.1e-3)], Phase.SPRING, 0),
    "noise adds up to nothing": (IDLE, 10e-3, [(3.0 * x, 0, 9e-3) for x in range(5)], Phase.IDLE, 0),
    # What noise hides next to the master counts to the controlled force, farther off it does not.
    "enough near": (SPRINGY, 10e-3, [(0, 0, 0.39), (6, 0, 2e-3), (-6, 0, 9e-3)], Phase.SHAPING, 0),
    "too little near": (SPRINGY, 10e-3, [(0, 0, 0.39), (6, 0, -2e-3), (-6, 0, 9e-3)], Phase.SPRING, 0),
    "hidden far off": (SPRINGY, 10e-3, [(0, 0, 0.395), (9, 0, 9.9e-3)], Phase.SPRING, 0),
    "felt far off": (SPRINGY, 10e-3, [(0, 0, 0.395), (9, 0, 10.1e-3)], Phase.SHAPING, 0),
    # 6 mm behind where it was and 11 mm from where it is now; the other way round 12 mm and 7 mm.
    "near where it was": (SPRINGY, 30e-3, [(5, 0, 0.39), (-6, 0, 20e-3)], Phase.SHAPING, 0),
    "near where it is": (SPRINGY, 30e-3, [(5, 0, 0.39), (12, 0, 20e-3)], Phase.SPRING, 0),
    "hidden at first touch": (IDLE, 10e-3, [(0, 0, 0.395), (3, 0, 9e-3)], Phase.SPRING, 0),
}


@pytest.mark.parametrize(("before", "floor", "presses", "phase", "losses"), PHASES.values(), ids=PHASES)
def test_forces_set_the_phase(before, floor, presses, phase, losses):
    memory, _ = replace(control(), floor=floor).locate(before, touched(*presses))
    assert (memory.phase, memory.losses) == (phase, losses)


# Model


def settled(memory: Master, force: float, count: int = 600) -> Master:
    """Return the master after some periods of a steady force."""
    method = control()
    for _ in range(count):
        memory, _ = method.locate(memory, touched((0, 0, force)))
    return memory


@pytest.mark.parametrize(
    ("before", "force", "count", "height"),
    [
        # 0.2 N / 200 N/m is 1 mm. The flow goes with the error squared: after 3 s some 60 µm are left.
        (master(phase=Phase.SPRING, height=40e-3), 0.2, 600, pytest.approx(39e-3, abs=0.1e-3)),
        (master(), 0.4, 600, 45e-3),  # at the set point it stays
        (master(), 0.3, 20, pytest.approx(45.6e-3, abs=0.6e-3)),  # below it rises
        (master(), 0.5, 20, pytest.approx(44.4e-3, abs=0.6e-3)),  # above it sinks
        (master(), 0.002, 1500, 100e-3),  # it stops where a real pin does
        (master(), 5.0, 1500, 0.0),
    ],
)
def test_a_steady_force_takes_the_master_to_a_height(before, force, count, height):
    after = settled(before, force, count).height
    assert after == height
    assert (after == before.height) == (force == 0.4)


# Direction and loss


@pytest.mark.parametrize(
    ("before", "path_x", "toward"),
    [
        pytest.param(master(), np.linspace(0, 1.6, 500), (1.0, 0.0), id="slow, far enough"),
        pytest.param(master(), np.linspace(0, 1.4, 500), (0.0, 0.0), id="not far enough"),
        pytest.param(master(0.0, 1.0), [0.3, -0.4] * 200, (0.0, 1.0), id="at rest it keeps its direction"),
        pytest.param(master(), [-5.0], (-1.0, 0.0), id="fast, in one period"),
    ],
)
def test_a_fingertip_gets_its_direction_once_it_has_gone_far_enough(before, path_x, toward):
    method, memory = control(), before
    for x in path_x:
        memory, _ = method.locate(memory, touched((x, 0, 0.4)))
    assert memory.heading[2:] == toward


def alone(memory: Master, count: int) -> Master:
    """Return the master after some periods without a fingertip."""
    for _ in range(count):
        memory, _ = control().locate(memory, touched())
    return memory


@pytest.mark.parametrize(
    ("phase", "count", "after"),
    [
        (Phase.SHAPING, 10, (Phase.SHAPING, 0)),  # 50 ms
        (Phase.SHAPING, 11, (Phase.IDLE, 1)),
        (Phase.SPRING, 11, (Phase.IDLE, 0)),  # lost before shaping is no loss
    ],
)
def test_a_fingertip_is_lost_after_the_loss_time(phase: Phase, count: int, after: tuple[Phase, int]) -> None:
    memory = alone(master(phase=phase), count)
    assert (memory.phase, memory.losses) == after


def test_a_fingertip_felt_again_in_time_is_not_lost_and_later_is_a_new_one() -> None:
    waiting = alone(master(felt=44e-3), 9)
    assert waiting.felt == 44e-3 < waiting.height  # where the fingertip was felt last
    memory, _ = control().locate(waiting, touched((0, 0, 0.4)))
    assert alone(memory, 10).losses == 0
    memory, _ = control().locate(alone(master(), 11), touched((3, 3, 0.1)))
    assert (memory.phase, memory.losses) == (Phase.SPRING, 1)


# Cell of the master

#: Parts whose unloaded valves are laminar, and others that may be turbulent.
CELLS: dict[str, dict[str, Any]] = {
    "valve and conduit": {},
    "no conduit": {"conduit": None},
    "a thin conduit": {"conduit": Conduit(diameter=0.3e-3)},
    "a gap as wide as the opening": {"valve": Valve(gap="opening")},
    "turbulent": {"valve": Valve(orifice_diameter=2e-3), "fluid": Fluid(viscosity=1e-6)},
}


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("opening", [-1.0, -0.3, 0.0, 1e-9, 0.07, 1.0])
def test_the_speed_is_that_of_the_valve_s_flow_law(name: str, opening: float) -> None:
    one = make_system(**CELLS[name]).cell
    assert (one.flow.knee <= one.supply.largest) == (name == "turbulent")
    supply = one.supply.high if opening > 0.0 else one.supply.low
    flow = one.flow.flow(np.array([opening]), np.array([supply]))[0]
    # Another order of the same few products: rounding.
    assert make_master_cell(one, 5e-3).speed(opening) == pytest.approx(flow / one.actuator.area, rel=1e-14)


def test_in_a_period_it_goes_the_way_its_opening_lets_it() -> None:
    one, period, start, command = make_system().cell, 5e-3, 0.3, 0.9
    found, last = make_master_cell(one, period).advance(40e-3, start, command)
    times = (np.arange(2000) + 0.5) / 2000 * period
    opening = command + (start - command) * np.exp(-times / one.lag.time_constant)
    assert last == pytest.approx(command + (start - command) * np.exp(-2.5), rel=1e-12)  # rounding
    flow = one.flow.flow(opening, np.full(2000, one.supply.high))
    # Two Gauss points: the fourth derivative of a square of exponentials over 2.5 time constants.
    assert found - 40e-3 == pytest.approx(period * flow.mean() / one.actuator.area, rel=0.01)
