"""The virtual master's cylinder and valve, and its memory from period to period."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.core.control.travel import Heading
from digiclay.core.control.virtual_master import Master, Phase, make_master_cell
from digiclay.core.model.conduit import Conduit
from digiclay.core.model.physics import Cell
from digiclay.core.model.valve import Fluid, Valve

from tests.assemble import make_system

#: Parts whose unloaded valves are laminar, and others that may be turbulent.
CELLS: dict[str, dict[str, Any]] = {
    "valve and conduit": {},
    "no conduit": {"conduit": None},
    "a thin conduit": {"conduit": Conduit(diameter=0.3e-3)},
    "a gap as wide as the opening": {"valve": Valve(gap="opening")},
    "turbulent": {"valve": Valve(orifice_diameter=2e-3), "fluid": Fluid(viscosity=1e-6)},
}
#: A master of which no two numbers are alike.
MASTER = Master(Phase.SPRING, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, Heading(7.0, 8.0, 0.6, 0.8), 9.0, 10, 11)


def cell(**parts: Any) -> Cell:
    """Return a cell with some parts changed."""
    return make_system(**parts).cell


def test_one_of_the_cells_may_be_turbulent() -> None:
    turbulent = {
        name for name, parts in CELLS.items() if (one := cell(**parts)).flow.knee <= one.supply.largest
    }
    assert turbulent == {"turbulent"}


@pytest.mark.parametrize("parts", CELLS.values(), ids=CELLS.keys())
@pytest.mark.parametrize("opening", [-1.0, -0.3, 1e-9, 0.07, 1.0])
def test_the_speed_is_that_of_the_valve_s_flow_law(parts: dict[str, Any], opening: float) -> None:
    one = cell(**parts)
    supply = one.supply.high if opening > 0.0 else one.supply.low
    flow = one.flow.flow(np.array([opening]), np.array([supply]))[0]
    # Another order of the same few products: rounding.
    assert make_master_cell(one, 5e-3).speed(opening) == pytest.approx(flow / one.actuator.area, rel=1e-14)


@pytest.mark.parametrize("parts", CELLS.values(), ids=CELLS.keys())
def test_a_shut_valve_stands_still(parts: dict[str, Any]) -> None:
    assert make_master_cell(cell(**parts), 5e-3).speed(0.0) == 0.0


def test_in_a_period_it_goes_the_way_its_opening_lets_it() -> None:
    one, period, start, command = cell(), 5e-3, 0.3, 0.9
    found, _ = make_master_cell(one, period).advance(40e-3, start, command)
    times = (np.arange(2000) + 0.5) / 2000 * period
    opening = command + (start - command) * np.exp(-times / one.lag.time_constant)
    flow = one.flow.flow(opening, np.full(2000, one.supply.high))
    # Two Gauss points: the fourth derivative of a square of exponentials over 2.5 time constants.
    assert found - 40e-3 == pytest.approx(period * flow.mean() / one.actuator.area, rel=0.01)


def test_felt_again_it_is_elsewhere_and_no_longer_alone_and_else_the_same() -> None:
    heading = Heading(0.1, 0.2, 1.0, 0.0)
    assert MASTER.move_to(21.0, 22.0, heading) == MASTER._replace(x=21.0, y=22.0, heading=heading, alone=0)


def test_led_it_has_another_height_and_opening_and_phase_and_is_else_the_same() -> None:
    led = MASTER.lead(Phase.SHAPING, 23.0, 0.5)
    assert led == MASTER._replace(phase=Phase.SHAPING, height=23.0, opening=0.5)


def test_the_height_it_is_led_to_with_the_finger_on_it_is_where_the_finger_was_felt() -> None:
    assert MASTER._replace(alone=0).lead(Phase.SHAPING, 23.0, 0.5).felt == 23.0


def test_in_another_surface_only_its_edge_is_another() -> None:
    assert MASTER.with_edge(24.0) == MASTER._replace(edge=24.0)
