"""What the explicit methods share: they march through the segments on the rates as they stand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell, rates
from ..places import Segment

__all__ = ["ExplicitPlan", "Rates", "marched"]

Floats = NDArray[np.float64]
#: Rates of a block of cells, from its rows and from the number of the stepper's node.
Rates = Callable[[Floats, int], Floats]


@dataclass(frozen=True)
class ExplicitPlan:
    """What all periods share."""

    cell: Cell
    queue: Queue
    segments: tuple[Segment, ...]


def marched(
    plan: ExplicitPlan, driven: Floats, under: Floats, increment: Callable[[Rates, Floats, float], Floats]
) -> None:
    """Move a block of cells on by one control period, in place; see `places.Stepper`.

    Parameters
    ----------
    increment : callable
        The method: from the rates, the rows and the length of a step to how far the rows go.

    Notes
    -----
    A method that has left its region of stability runs to infinity within a period; that is
    found by the check for finite numbers at its end, which says when and where.
    """
    cell = plan.cell
    y, commands = driven[: cell.rows], driven[cell.rows :]
    for part in plan.segments:
        command, instants = commands[plan.queue.seen(part.start)], under.take(part.nodes, axis=0)

        def rates_at(
            rows: Floats, node: int, command: Floats = command, instants: Floats = instants
        ) -> Floats:
            return rates(cell, rows, instants[node], command)

        with np.errstate(over="ignore", invalid="ignore"):
            y += increment(rates_at, y, part.length)
        np.clip(y[0], 0.0, cell.actuator.stroke, out=y[0])
    cell.lag.settle(y[cell.lag_rows])
