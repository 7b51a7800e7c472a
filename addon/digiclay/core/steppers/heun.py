"""Heun's trapezoidal predictor-corrector method."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.arrays import Floats
from .explicit import Explicit, Rates


@dataclass(frozen=True)
class Heun(Explicit):
    """Explicit, order 2."""

    name = "heun"
    order = 2
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go in one step, s long."""
        first = rates(y, 0)
        return (0.5 * step) * (first + rates(y + step * first, 1))
