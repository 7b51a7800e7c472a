"""Richardson extrapolation of the closed-form step: one step against two halves.

The closed-form step's error falls with the square of its length, so
``(4 fine - coarse) / 3`` is free of its leading term, and ``(fine - coarse) / 3`` is what the
finer one still had. It is done over a control period, in which the commands are held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..delay import Queue
from ..physics import Cell
from ..places import Segment
from .bernoulli import BernoulliExponential, BernoulliPlan

__all__ = ["Richardson", "RichardsonPlan", "halved"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RichardsonPlan:
    """What all periods share: the closed-form plans for the steps, and for their halves.

    Attributes
    ----------
    ends : ndarray of int (s + 1,)
        Which of the period's instants are ends of whole steps.
    """

    coarse: BernoulliPlan
    fine: BernoulliPlan
    ends: NDArray[np.intp]


@dataclass(frozen=True)
class Richardson:
    """Order 3 where the problem is smooth; as stable as the closed-form step."""

    name = "richardson"
    order = 3
    nodes = (0.0, 0.5, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> RichardsonPlan:
        """Work out once what all periods share."""
        closed_form = BernoulliExponential()
        ends = np.array([part.nodes[0] for part in segments] + [segments[-1].nodes[-1]], np.intp)
        return RichardsonPlan(
            closed_form.plan(cell, queue, segments), closed_form.plan(cell, queue, halved(segments)), ends
        )

    def advance(self, plan: RichardsonPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        closed_form, cell = BernoulliExponential(), plan.coarse.cell
        coarse = driven.copy()
        closed_form.advance(plan.coarse, coarse, under.take(plan.ends, axis=0))
        closed_form.advance(plan.fine, driven, under)
        y = driven[: cell.rows]
        y += (y - coarse[: cell.rows]) / 3.0
        np.clip(y[0], 0.0, cell.actuator.stroke, out=y[0])
        cell.lag.settle(y[cell.lag_rows])


def halved(segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
    """Cut segments that have an instant in their middle in two."""
    return tuple(
        Segment(part.start + part.length * i / 2, part.length / 2, part.nodes[i : i + 2])
        for part in segments
        for i in (0, 1)
    )
