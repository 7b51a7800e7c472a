"""What the explicit methods share: they march through the segments on the rates as they stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell, felt, rates
from ..places import Movement, Segment

__all__ = ["Explicit", "ExplicitPlan", "Rates"]

Floats = NDArray[np.float64]
#: Rates of a block of cells, from its rows and from the number of the stepper's node.
Rates = Callable[[Floats, int], Floats]

#: Share of the stroke that a step may go wrong by; what goes further is no error but a blow-up.
ASTRAY = 0.01


@dataclass(frozen=True, eq=False)
class ExplicitPlan:
    """What all periods share.

    Attributes
    ----------
    cell : Cell
    queue : Queue
    segments : tuple of Segment
        The physics steps of a period.
    fall, rise : float
        Velocity of a pin without load through a valve that is wide open, m/s: not above 0, not below.
    """

    cell: Cell
    queue: Queue
    segments: tuple[Segment, ...]
    fall: float
    rise: float


@dataclass(frozen=True)
class Explicit:
    """A method that marches through the segments of a period; each says how far one step goes.

    Notes
    -----
    A method that has left its region of stability throws pins from stop to stop, and the stops
    would hide it. But a finger that pushes a pin leaves it where they part, and a pin without
    load goes no faster than its valve lets it: no pin ever is further from where it was, or from
    the lowest the finger came. A cell that is, is given up as infinite, which the check for
    finite numbers at the end of the period finds, and says when and where.
    """

    bridges = False

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> ExplicitPlan:
        """Work out once what all periods share."""
        wide = np.array([-1.0, 1.0])
        ways = cell.flow.flow(wide, cell.supply.pressure(wide)) / cell.actuator.area
        return ExplicitPlan(cell, queue, segments, min(float(ways.min()), 0.0), max(float(ways.max()), 0.0))

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return how far the rows go in one step, s long."""
        raise NotImplementedError

    def bind(self, plan: ExplicitPlan, driven: Floats, near: int) -> Movement:
        """Make ready to move a block of cells on; see `places.Stepper`."""
        return partial(self.advance, plan, driven)

    def advance(self, plan: ExplicitPlan, driven: Floats, under: Floats) -> Floats:
        """Move a block of cells on by one control period, in place; see `places.Movement`."""
        cell, stroke = plan.cell, plan.cell.actuator.stroke
        y, commands = driven[: cell.rows], driven[cell.rows :]
        thrown = np.zeros(y.shape[1], np.bool_)
        for part in plan.segments:
            command, instants = commands[plan.queue.seen(part.start)], under.take(part.nodes, axis=0)

            def rates_at(
                rows: Floats, node: int, command: Floats = command, instants: Floats = instants
            ) -> Floats:
                return rates(cell, rows, instants[node], command)

            lowest = y[0].copy()
            np.minimum(lowest[: under.shape[1]], instants.min(axis=0), out=lowest[: under.shape[1]])
            lowest += part.length * plan.fall - ASTRAY * stroke
            highest = y[0] + (part.length * plan.rise + ASTRAY * stroke)
            with np.errstate(over="ignore", invalid="ignore"):
                y += self.increment(rates_at, y, part.length)
            np.clip(y[0], 0.0, stroke, out=y[0])
            thrown |= ~((lowest <= y[0]) & (y[0] <= highest))
        y[0][thrown] = np.inf
        return felt(cell, y, under[-1])
