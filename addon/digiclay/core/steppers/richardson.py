"""Richardson extrapolation of the closed-form step: one step and two halves.

The error of the closed-form step falls with the square of its length, so that
``(4 fine - coarse) / 3`` is free of its leading term, and ``(fine - coarse) / 3`` is the error
of the finer one. The extrapolation is over a control period, in which the commands are held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats
from ..model.delay import Queue
from ..model.interfaces import Alike, Movement, Segment
from ..model.physics import Cell, Speeds, find_contact_force, find_speeds
from .bernoulli import BernoulliExponential, BernoulliPlan


@dataclass(frozen=True, eq=False)
class RichardsonPlan:
    """Constants of all periods."""

    coarse: BernoulliPlan
    fine: BernoulliPlan
    """For the steps, and for their halves."""
    speeds: Speeds
    period: float
    """s."""


class Richardson(Alike):
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
            closed_form.plan(cell, queue, halve_segments(segments)),
            find_speeds(cell),
            sum(part.length for part in segments),
        )

    def prepare(self, plan: RichardsonPlan, rows: Floats, near: int) -> Movement:
        """Prepare to move a block of cells; see `interfaces.Stepper`."""
        closed_form, cell = BernoulliExponential(), plan.coarse.cell
        coarse = np.empty_like(rows)
        once = closed_form.prepare(plan.coarse, coarse, near)
        twice = closed_form.prepare(plan.fine, rows, near)

        def advance(under: Floats) -> Floats:
            coarse[:] = rows
            reach = plan.speeds.reach(rows[0], under, plan.period)
            once(under)
            twice(under)
            extrapolate(cell, rows, coarse, reach)
            return find_contact_force(cell, rows, under[-1])

        return advance


def extrapolate(cell: Cell, fine: Floats, coarse: Floats, reach: tuple[Floats, Floats]) -> None:
    """Remove the leading error from rows (r, n[, b]), in place, within the reachable heights."""
    rows = fine[: cell.rows]
    np.add(rows, (rows - coarse[: cell.rows]) / 3.0, out=rows)
    bound(cell, fine, reach)


def bound(cell: Cell, rows: Floats, reach: tuple[Floats, Floats]) -> None:
    """Limit extrapolated rows to reachable values, in place, for levels that differ much."""
    height, pulp = rows[0], rows[cell.pulp_rows]
    np.clip(height, *reach, out=height)
    np.clip(height, 0.0, cell.actuator.stroke, out=height)
    np.maximum(pulp, 0.0, out=pulp)


def halve_segments(segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
    """Return the halves of segments that have an instant in the middle of each half."""
    return tuple(
        Segment(part.start + part.length * i / 2, part.length / 2, part.nodes[2 * i : 2 * i + 3])
        for part in segments
        for i in (0, 1)
    )
