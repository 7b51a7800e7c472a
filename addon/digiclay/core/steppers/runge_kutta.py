"""The classical fourth-order Runge-Kutta method, on the rates as they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell, rates
from ..places import Segment

__all__ = ["RungeKutta4", "RungeKuttaPlan"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RungeKuttaPlan:
    """What all periods share."""

    cell: Cell
    queue: Queue
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class RungeKutta4:
    """Explicit, order 4 where the right-hand side is smooth, 2 across a contact or a reversed valve."""

    name = "runge_kutta_4"
    order = 4
    nodes = (0.0, 0.5, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> RungeKuttaPlan:
        """Work out once what all periods share."""
        return RungeKuttaPlan(cell, queue, segments)

    def advance(self, plan: RungeKuttaPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        cell, height = plan.cell, driven[0]
        y, commands = driven[: cell.rows], driven[cell.rows :]
        for part in plan.segments:
            step, command = part.length, commands[plan.queue.seen(part.start)]
            start, middle, end = (under[node] for node in part.nodes)
            first = rates(cell, y, start, command)
            second = rates(cell, y + (0.5 * step) * first, middle, command)
            third = rates(cell, y + (0.5 * step) * second, middle, command)
            fourth = rates(cell, y + step * third, end, command)
            y += (step / 6.0) * (first + 2.0 * (second + third) + fourth)
            np.clip(height, 0.0, cell.actuator.stroke, out=height)
        cell.lag.settle(y[cell.lag_rows])
