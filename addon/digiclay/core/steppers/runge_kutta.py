"""Classical fourth-order Runge-Kutta method."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.arrays import Floats
from .explicit import Explicit, Rates


@dataclass(frozen=True)
class RungeKutta4(Explicit):
    """Explicit, order 4 where the right-hand side is smooth, 2 across a contact or a reversed valve."""

    name = "runge_kutta_4"
    order = 4
    nodes = (0.0, 0.5, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go in one step, s long."""
        first = rates(y, 0)
        second = rates(y + (0.5 * step) * first, 1)
        third = rates(y + (0.5 * step) * second, 1)
        fourth = rates(y + step * third, 2)
        return (step / 6.0) * (first + 2.0 * (second + third) + fourth)
