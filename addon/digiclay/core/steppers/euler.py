"""The explicit method of Euler: the least one can do, and what others are measured by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell
from ..places import Segment
from .explicit import ExplicitPlan, Rates, marched

__all__ = ["Euler"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Euler:
    """Explicit, order 1."""

    name = "euler"
    order = 1
    nodes = (0.0, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> ExplicitPlan:
        """Work out once what all periods share."""
        return ExplicitPlan(cell, queue, segments)

    def advance(self, plan: ExplicitPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        marched(plan, driven, under, _increment)


def _increment(rates: Rates, y: Floats, step: float) -> Floats:
    """Return how far the rows go in one step."""
    return step * rates(y, 0)
