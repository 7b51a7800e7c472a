"""The classical fourth-order Runge-Kutta method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell
from ..places import Segment
from .explicit import ExplicitPlan, Rates, marched

__all__ = ["RungeKutta4"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RungeKutta4:
    """Explicit, order 4 where the right-hand side is smooth, 2 across a contact or a reversed valve."""

    name = "runge_kutta_4"
    order = 4
    nodes = (0.0, 0.5, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> ExplicitPlan:
        """Work out once what all periods share."""
        return ExplicitPlan(cell, queue, segments)

    def advance(self, plan: ExplicitPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        marched(plan, driven, under, _increment)


def _increment(rates: Rates, y: Floats, step: float) -> Floats:
    """Return how far the rows go in one step."""
    first = rates(y, 0)
    second = rates(y + (0.5 * step) * first, 1)
    third = rates(y + (0.5 * step) * second, 1)
    fourth = rates(y + step * third, 2)
    return (step / 6.0) * (first + 2.0 * (second + third) + fourth)
