"""The trapezoidal predictor-corrector of Heun."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell
from ..places import Segment
from .explicit import ExplicitPlan, Rates, marched

__all__ = ["Heun"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Heun:
    """Explicit, order 2."""

    name = "heun"
    order = 2
    nodes = (0.0, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> ExplicitPlan:
        """Work out once what all periods share."""
        return ExplicitPlan(cell, queue, segments)

    def advance(self, plan: ExplicitPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        marched(plan, driven, under, _increment)


def _increment(rates: Rates, y: Floats, step: float) -> Floats:
    """Return how far the rows go in one step."""
    first = rates(y, 0)
    return (0.5 * step) * (first + rates(y + step * first, 1))
