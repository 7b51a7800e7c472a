"""What the explicit steppers share: a cell thrown off stays given up, the others go on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from digiclay.core.steppers.explicit import Explicit, ExplicitPlan, Rates
from numpy.typing import NDArray

from tests.assemble import make_system

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Thrower(Explicit):
    """Throws the first cell off in the first step, and raises the other by a millimeter in each."""

    name = "thrower"
    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go."""
        way = np.zeros_like(y)
        way[0] = [10.0 if y[0, 0] == 0.04 else -0.01, 1e-3]
        return way


def test_a_cell_thrown_off_is_given_up_and_the_others_are_moved_on_to_the_end() -> None:
    system = make_system(
        stepper="euler", step=1e-3, dead_time=0.0, fingertip=None, contact=None, relaxation=None
    )
    plan: ExplicitPlan = system.plan
    driven = np.zeros((system.rows.physics + system.rows.queue, 2))
    driven[0] = 0.04
    Thrower().advance(plan, driven, np.empty((len(plan.segments) + 1, 0)))
    assert len(plan.segments) == 5
    np.testing.assert_allclose(driven[0], [np.inf, 0.045], rtol=1e-12)


@dataclass(frozen=True)
class Setter(Explicit):
    """Puts every cell at a height in one step, whatever the rates."""

    height: float

    name = "setter"
    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go."""
        way = np.zeros_like(y)
        way[0] = self.height - y[0]
        return way


def put(height: float, under: float, start: float = 40e-3) -> float:
    """Return what a stepper that puts a pin at a height leaves of it, under a finger that comes so low, m."""
    system = make_system(stepper="euler", step=5e-3, dead_time=0.0, relaxation=None)
    plan: ExplicitPlan = system.plan
    driven = np.zeros((system.rows.physics + system.rows.queue, 1))
    driven[0] = start
    Setter(height).advance(plan, driven, np.array([[41e-3], [under]]))
    return float(driven[0, 0])


def test_a_pin_pushed_as_far_as_the_finger_comes_is_kept() -> None:
    assert put(15e-3, under=15e-3) == 15e-3


def test_a_pin_thrown_further_than_the_finger_comes_is_given_up() -> None:
    # A hundredth of the stroke is allowed; an open valve lowers it by less than a millimeter in 5 ms.
    assert put(15e-3, under=20e-3) == np.inf


def test_a_pin_that_rises_faster_than_an_open_valve_lets_it_is_given_up() -> None:
    assert put(45e-3, under=38e-3) == np.inf


def test_a_pin_pressed_onto_its_stop_is_kept() -> None:
    assert put(-30e-3, under=-1e-3, start=5e-3) == 0.0


def test_a_height_that_is_no_number_is_given_up() -> None:
    assert put(np.nan, under=38e-3) == np.inf


def test_the_force_told_is_that_of_the_finger_at_the_end_of_the_period() -> None:
    system = make_system(stepper="euler", step=5e-3, dead_time=0.0, relaxation=None)
    driven = np.zeros((system.rows.physics + system.rows.queue, 1))
    driven[0] = 40e-3
    force = Setter(39e-3).advance(system.plan, driven, np.array([[41e-3], [38e-3]]))
    # 1 mm deep at the end: f_d b/m (e^(m x) - 1), and no contact at the start.
    assert force[0] == pytest.approx(0.34 * 250.0 / 2000.0 * np.expm1(2.0), rel=1e-9)
