"""What the explicit steppers share: a cell thrown off stays given up, the others go on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from digiclay.core.steppers.explicit import Explicit, ExplicitPlan, Rates
from numpy.typing import NDArray

from tests.assemble import make_system

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Thrower(Explicit):
    """Throws the first cell off in the first step, and raises the other by a millimetre in each."""

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
