"""Richardson extrapolation of the closed-form step: one step and two halves.

The closed-form step's error falls with the square of its length, so
``(4 fine - coarse) / 3`` is free of its leading term, and ``(fine - coarse) / 3`` is what the
finer one still had. It is done over a control period, in which the commands are held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.delay import Queue
from ..model.interfaces import Movement, Segment
from ..model.physics import Cell, Speeds, felt, speeds
from .bernoulli import BernoulliExponential, BernoulliPlan

__all__ = ["Richardson", "RichardsonPlan", "halved"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RichardsonPlan:
    """Constants of all periods.

    Attributes
    ----------
    coarse, fine : BernoulliPlan
        For the steps, and for their halves.
    speeds : Speeds
    period : float
        s.
    """

    coarse: BernoulliPlan
    fine: BernoulliPlan
    speeds: Speeds
    period: float


@dataclass(frozen=True)
class Richardson:
    """Order 3 for smooth problems, stability of the closed-form step."""

    name = "richardson"
    order = 3
    nodes = (0.0, 0.25, 0.5, 0.75, 1.0)
    bridges = False

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> RichardsonPlan:
        """Work out once what all periods share."""
        closed_form = BernoulliExponential()
        whole = tuple(Segment(part.start, part.length, part.nodes[::2]) for part in segments)
        return RichardsonPlan(
            closed_form.plan(cell, queue, whole),
            closed_form.plan(cell, queue, halved(segments)),
            speeds(cell),
            sum(part.length for part in segments),
        )

    def bind(self, plan: RichardsonPlan, driven: Floats, near: int) -> Movement:
        """Make ready to move a block of cells on; see `interfaces.Stepper`."""
        closed_form, cell = BernoulliExponential(), plan.coarse.cell
        coarse = np.empty_like(driven)
        once = closed_form.bind(plan.coarse, coarse, near)
        twice = closed_form.bind(plan.fine, driven, near)
        fine_rows, coarse_rows = driven[: cell.rows], coarse[: cell.rows]
        pulp = driven[cell.pulp_rows]

        def advance(under: Floats) -> Floats:
            coarse[:] = driven
            lowest, highest = plan.speeds.reach(driven[0], under, plan.period)
            once(under)
            twice(under)
            np.add(fine_rows, (fine_rows - coarse_rows) / 3.0, out=fine_rows)
            # Where the two have little in common the extrapolation lies beyond what there can be.
            np.clip(driven[0], lowest, highest, out=driven[0])
            np.clip(driven[0], 0.0, cell.actuator.stroke, out=driven[0])
            np.maximum(pulp, 0.0, out=pulp)
            return felt(cell, driven, under[-1])

        return advance


def halved(segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
    """Cut segments that have an instant in the middle of each half in two."""
    return tuple(
        Segment(part.start + part.length * i / 2, part.length / 2, part.nodes[2 * i : 2 * i + 3])
        for part in segments
        for i in (0, 1)
    )
