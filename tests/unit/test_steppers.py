"""Explicit steppers give up what is thrown off; Richardson's extrapolation keeps to what a cell can be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.model.physics import find_speeds
from digiclay.core.steppers.explicit import Explicit, Rates
from digiclay.core.steppers.richardson import extrapolate

from tests.assemble import make_system


@dataclass(frozen=True)
class Setter(Explicit):
    """Moves each cell by its way in a step, or puts it at a height, whatever the rates."""

    height: float | None
    ways: tuple[float, ...] = ()

    name = "setter"
    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go; the first cell is thrown off from its start only."""
        way = np.zeros_like(y)
        way[0] = self.ways if self.height is None else self.height - y[0]
        if self.height is None and y[0, 0] != 0.04:
            way[0, 0] = -0.01
        return way


def put(
    stepper: Setter, under: list[list[float]], start: list[float], **parts: object
) -> tuple[Floats, Floats]:
    """Return heights, m, and forces that a stepper leaves of pins under the undersides of a fingertip, m."""
    system = make_system(stepper="euler", dead_time=0.0, relaxation=None, **parts)
    driven = np.zeros((system.rows.physics + system.rows.queue, len(start)))
    driven[0] = start
    unders = np.array(under) if under else np.empty((len(system.plan.segments) + 1, 0))
    force = stepper.advance(system.plan, driven, unders)
    return driven[0], force


def test_a_cell_thrown_off_is_given_up_the_others_are_moved_on_and_the_force_is_that_of_the_end() -> None:
    alone = {"step": 1e-3, "fingertip": None, "contact": None}
    height, _ = put(Setter(None, (10.0, 1e-3)), [], [0.04, 0.04], **alone)
    np.testing.assert_allclose(height, [np.inf, 0.045], rtol=1e-12)
    # 1 mm deep at the end of the period: f_d b/m (e^(m x) - 1), and no contact at the start.
    _, force = put(Setter(39e-3), [[41e-3], [38e-3]], [40e-3], step=5e-3)
    assert force[0] == pytest.approx(0.34 * 250.0 / 2000.0 * np.expm1(2.0), rel=1e-9)


@pytest.mark.parametrize(
    ("height", "under", "start", "left"),
    [
        (15e-3, 15e-3, 40e-3, 15e-3),  # pushed as far as the finger comes
        # A hundredth of the stroke is allowed; an open valve lowers it by less than a millimeter in 5 ms.
        (15e-3, 20e-3, 40e-3, np.inf),
        (45e-3, 38e-3, 40e-3, np.inf),  # it rises faster than an open valve lets it
        (-30e-3, -1e-3, 5e-3, 0.0),  # pressed onto its stop
        (np.nan, 38e-3, 40e-3, np.inf),
    ],
)
def test_a_pin_is_given_up_where_neither_finger_nor_valve_can_take_it(
    height: float, under: float, start: float, left: float
) -> None:
    assert put(Setter(height), [[41e-3], [under]], [start], step=5e-3)[0] == left


CELL = make_system().cell
STROKE, WAY = CELL.actuator.stroke, find_speeds(CELL).rise * 5e-3


@pytest.mark.parametrize(
    ("coarse", "fine", "period", "under", "height"),
    [
        # In a period of 10 s a valve lets a pin go anywhere.
        (0.010, 0.013, 10.0, 1.0, 0.014),  # a third of what the halves changed is added
        (3e-3, 0.0, 10.0, 1.0, 0.0),  # no further than the end stops
        (STROKE - 3e-3, STROKE, 10.0, 1.0, STROKE),
        (40e-3, 40e-3 + WAY, 5e-3, 1.0, 40e-3 + WAY),  # nor than the valve
        (40e-3, 30e-3, 5e-3, 30e-3, 30e-3 - WAY),  # or the finger can take it
    ],
)
def test_richardsons_extrapolation_keeps_to_where_a_pin_can_be(
    coarse: float, fine: float, period: float, under: float, height: float
) -> None:
    reach = find_speeds(CELL).reach(np.full((1, 1), 40e-3), np.full((3, 1, 1), under), np.array([period]))
    fines, coarses = (np.full((CELL.rows + 1, 1, 1), value) for value in (fine, coarse))
    extrapolate(CELL, fines, coarses, reach)
    assert fines[0, 0, 0] == pytest.approx(height, rel=1e-12)
    assert (fines[CELL.pulp_rows] == max(fine + (fine - coarse) / 3.0, 0.0)).all()  # no filter pulls
    assert fines[CELL.rows] == fine  # commands on their way are not extrapolated
