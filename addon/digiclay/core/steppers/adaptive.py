"""Adaptive stepper: sub-steps chosen cell by cell within a height tolerance.

Each control period is integrated with whole steps and with half steps. A cell in which the two
differ by more than its share of the tolerance is integrated again with quarter steps, and so
on. Under the fingertip the result is the extrapolation of the two finest levels, whose error is
smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base.arrays import Floats, any_true
from ..model.delay import Queue
from ..model.interfaces import Movement, Segment
from ..model.physics import Cell, Speeds, find_contact_force, find_speeds
from .bernoulli import BernoulliExponential, BernoulliPlan, divide_segments
from .richardson import bound

#: A working block, the map to the fingertip's underside at the instants of a level's steps, and the
#: movement of the block.
Bound = tuple[Floats, Floats, Movement]

#: Most halvings of a step.
FINEST = 7
#: Share of the tolerance per control period: of a cell under the fingertip, where errors decay
#: within a few periods, and of any other, where they add up over the session.
PRESSED, FREE = 0.1, 0.001


@dataclass(frozen=True, eq=False)
class AdaptivePlan:
    """Constants of all periods."""

    levels: tuple[BernoulliPlan, ...]
    """For whole steps, half steps, quarter steps and so on."""
    between: tuple[Floats, ...]
    """(i, p): From the fingertip's underside at the period's instants to that at the ends and in the middle
    of a level's steps: exact at the instants, by parabolas between them."""
    allowed: float
    allowed_tension: float
    """Difference between two levels that is allowed over the whole run: of heights, m, and of the pulp's
    filters, N, from that of heights by the stiffness at first touch, where the pulp is softest."""
    speeds: Speeds
    period: float
    """s."""


@dataclass(frozen=True)
class Adaptive:
    """Error within a tolerance, stability of the closed-form step."""

    tolerance: float
    """Error of the heights over a run, m."""

    name = "adaptive"
    order = 3
    nodes = (0.0, 0.5, 1.0)
    bridges = False

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> AdaptivePlan:
        """Compute once what all periods share."""
        closed_form = BernoulliExponential()
        levels, between = [], []
        for level in range(FINEST + 1):
            parts, rows = divide_segments(segments, 2**level)
            levels.append(closed_form.plan(cell, queue, parts))
            between.append(rows)
        allowed = 3.0 * self.tolerance
        stiffness = cell.touch.contact.stiffness if cell.touch else 0.0
        period = sum(part.length for part in segments)
        return AdaptivePlan(
            tuple(levels), tuple(between), allowed, stiffness * allowed, find_speeds(cell), period
        )

    def prepare(self, plan: AdaptivePlan, rows: Floats, near: int) -> Movement:
        """Prepare to move a block of cells; see `interfaces.Stepper`."""
        # All cells are integrated at these two levels in every period.
        coarse, fine = (_prepare(plan, level, rows.shape, near) for level in (0, 1))
        return partial(self._advance, plan, rows, coarse, fine)

    def _advance(
        self, plan: AdaptivePlan, rows: Floats, whole: Bound, halves: Bound, under: Floats
    ) -> Floats:
        """Move a block of cells by one control period, in place; see `interfaces.Movement`."""
        cell, k = plan.levels[0].cell, under.shape[1]
        start, share = rows.copy(), np.full(rows.shape[1], FREE)
        share[:k][start[0, :k] > under.min(axis=0)] = PRESSED
        coarse = _advance_copy(whole, start, under)
        open_cells = np.arange(rows.shape[1])
        for level in range(1, FINEST + 1):
            near = open_cells[open_cells < k]
            if level > 1:
                halves = _prepare(plan, level, (len(rows), open_cells.size), near.size)
            fine = _advance_copy(halves, start[:, open_cells], under[:, near])
            # Extrapolation is for errors of second order; that of a free cell is of fourth.
            gain = (fine[: cell.rows] - coarse[: cell.rows]) / 3.0
            rows[: cell.rows, open_cells] = fine[: cell.rows] + gain * (
                share[open_cells] == PRESSED
            )
            off = np.abs(fine - coarse)
            wide = off[0] > plan.allowed * share[open_cells]
            wide |= (off[cell.pulp_rows] > plan.allowed_tension * PRESSED).any(axis=0)
            # If a flow becomes turbulent or contact begins within a step, two levels may agree by
            # accident.
            wide |= level < 2 and not plan.levels[0].laminar
            if not any_true(wide):
                break
            open_cells, coarse = open_cells[wide], fine[:, wide]
        bound(cell, rows, plan.speeds.reach(start[0], under, plan.period))
        return find_contact_force(cell, rows, under[-1])


def _prepare(plan: AdaptivePlan, level: int, shape: tuple[int, ...], near: int) -> Bound:
    """Return the working block of a shape, and its movement with the steps of a level."""
    block = np.empty(shape)
    return (
        block,
        plan.between[level],
        BernoulliExponential().prepare(plan.levels[level], block, near),
    )


def _advance_copy(bound: Bound, start: Floats, under: Floats) -> Floats:
    """Return rows moved by one control period, in the arrays of `bound`."""
    block, between, advance = bound
    block[:] = start
    advance(np.dot(between, under))
    return block
