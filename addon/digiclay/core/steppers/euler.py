"""Euler's explicit method."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.arrays import Floats
from .explicit import Explicit, Rates


@dataclass(frozen=True)
class Euler(Explicit):
    """Explicit, order 1."""

    name = "euler"
    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go in one step, s long."""
        return step * rates(y, 0)
