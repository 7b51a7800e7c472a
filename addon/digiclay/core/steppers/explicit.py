"""Explicit steppers: Euler, Heun and Runge-Kutta 4, segment by segment of a period."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base.arrays import Floats
from ..model.delay import Queue
from ..model.interfaces import Alike, Movement, Segment
from ..model.physics import Cell, Speeds, compute_rates, find_contact_force, find_speeds

#: Rates of a block of cells, from its rows and the number of the stepper's node.
Rates = Callable[[Floats, int], Floats]

#: Largest error of a step, as a share of the stroke; a larger one is instability.
ASTRAY = 0.01


@dataclass(frozen=True, eq=False)
class ExplicitPlan:
    """Constants of all periods."""

    cell: Cell
    queue: Queue
    segments: tuple[Segment, ...]
    """The physics steps of a period."""
    speeds: Speeds


class Explicit(Alike):
    """Base of the explicit steppers, which integrate segment by segment of a period.

    A method outside its region of stability throws pins from stop to stop, and the stops would
    hide it. But no pin can leave the bounds of `Speeds.reach`. A cell that does becomes infinite,
    and the check for finite numbers at the end of the period reports when and where.
    """

    bridges = False

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> ExplicitPlan:
        """Compute once what all periods share."""
        return ExplicitPlan(cell, queue, segments, find_speeds(cell))

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return the change of rows y (r, n) in one step, s, by their rates at rows and a node."""
        raise NotImplementedError

    def prepare(self, plan: ExplicitPlan, rows: Floats, near: int) -> Movement:
        """Prepare to move a block of cells; see `interfaces.Stepper`."""
        return partial(self.advance, plan, rows)

    def advance(self, plan: ExplicitPlan, rows: Floats, under: Floats) -> Floats:
        """Move rows and commands (r + q, n) by one control period, in place; see `interfaces.Movement`."""
        cell, stroke = plan.cell, plan.cell.actuator.stroke
        y, commands = rows[: cell.rows], rows[cell.rows :]
        height, thrown = y[0], np.zeros(y.shape[1:], np.bool_)
        with np.errstate(over="ignore", invalid="ignore"):
            for part in plan.segments:
                command = commands[plan.queue.seen(part.start)]
                instants = under.take(part.nodes, axis=0)

                def rates_at(
                    rows: Floats, node: int, command: Floats = command, instants: Floats = instants
                ) -> Floats:
                    return compute_rates(cell, rows, instants[node], command)

                lowest, highest = plan.speeds.reach(height, instants, part.length)
                lowest -= ASTRAY * stroke
                highest += ASTRAY * stroke
                y += self.increment(rates_at, y, part.length)
                np.maximum(height, 0.0, out=height)
                np.minimum(height, stroke, out=height)
                thrown |= ~((lowest <= height) & (height <= highest))
        y[0][thrown] = np.inf
        return find_contact_force(cell, y, under[-1])


class Euler(Explicit):
    """Explicit, order 1."""

    name = "euler"
    order = 1
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return the change of the rows in one step, s."""
        return step * rates(y, 0)


class Heun(Explicit):
    """Explicit, order 2."""

    name = "heun"
    order = 2
    nodes = (0.0, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return the change of the rows in one step, s."""
        first = rates(y, 0)
        return (0.5 * step) * (first + rates(y + step * first, 1))


class RungeKutta4(Explicit):
    """Explicit, order 4 for a smooth right-hand side, 2 across a contact or a reversal of the valve."""

    name = "runge_kutta_4"
    order = 4
    nodes = (0.0, 0.5, 1.0)

    def increment(self, rates: Rates, y: Floats, step: float) -> Floats:
        """Return the change of the rows in one step, s."""
        first = rates(y, 0)
        second = rates(y + (0.5 * step) * first, 1)
        third = rates(y + (0.5 * step) * second, 1)
        fourth = rates(y + step * third, 2)
        return (step / 6.0) * (first + 2.0 * (second + third) + fourth)
