"""Cells that several fingertips press at once, by the closed form of their sum.

With one exponent m the forces of several fingertips are that of one: ``Σ exp(m (H - U_f)) = exp(m (H - U))``
with ``U = -(1/m) log Σ exp(-m U_f)``, less what each has lost to relaxation. A fingertip with another m is
taken as one with that of the strongest, of equal force and stiffness where a part of the step begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.contact import LARGEST_EXPONENT, ExponentialLaw
from ..model.delay import Queue
from ..model.interfaces import Segment
from ..model.physics import Cell
from .bernoulli import BernoulliExponential, BernoulliPlan
from .closed_form import TINY, StepStart, find_loaded_path

#: Parts of a physics step: which fingertips press changes within it.
PARTS = 2
#: Mean over a part by values at its start, middle and end.
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0
#: Logarithm of no force.
NONE = -1e300


@dataclass(frozen=True, eq=False)
class TogetherPlan:
    """Constants of cells under several fingertips; called, it moves them through a control period."""

    plans: tuple[BernoulliPlan, ...]
    """Of each finger, in parts of the physics steps."""
    between: Floats
    """(i, p): From undersides at the period's instants to those at the parts' instants."""

    @cached_property
    def _numbers(self) -> Floats:
        """Of each finger (4, f): m, 1/m; m x0; force of a unit of tension, N; pressure of it, Pa."""
        laws: list[ExponentialLaw] = [plan.cell.touch.contact for plan in self.plans if plan.cell.touch]
        rows = [
            (law.exponent, law.exponent * law.offset, law.share * law.stiffness / law.exponent)
            for law in laws
        ]
        return np.array([(*row, plan.to_load) for row, plan in zip(rows, self.plans, strict=True)]).T

    @cached_property
    def _maps(self) -> list[tuple[Floats, Floats, Floats]]:
        """Of each part the fingers' `mean_loss`, `propagator` and `shares`, with a first axis (f,)."""
        return [
            (
                np.array([plan.mean_loss[s] for plan in self.plans]),
                np.array([plan.propagator[s] for plan in self.plans]),
                np.array([plan.shares[s] for plan in self.plans]),
            )
            for s in range(len(self.plans[0].segments))
        ]

    def __call__(
        self, height: Floats, valves: Floats, filters: Floats, under: Floats, fingers: Cells
    ) -> tuple[Floats, Floats, Floats]:
        """Return heights (g,), filters (r, c, g), and forces (c, g), N, a control period later.

        `valves` (l, g): openings and commands; `under` (p, c, g): undersides at the period's instants, m.
        """
        plan, numbers = self.plans[0], self._numbers[:, fingers]
        cell, count = plan.cell, len(plan.segments)
        # A finger that is named again, to make up the number, presses once.
        again = np.zeros(fingers.shape, np.bool_)
        again[1:] = fingers[1:] == fingers[0]
        openings = plan.response[: len(plan.weights)].dot(valves)
        pressure = cell.supply.pressure(openings)
        size = cell.flow.conductance(openings, pressure)
        free = plan.moves[2 * count : 3 * count].dot(np.concatenate([size, np.copysign(size, openings)]))
        below = np.einsum("ip,pcg->icg", self.between, under)
        exponent, shift, unit, load = numbers
        work = np.zeros((len(filters) + 5, *fingers.shape))
        work[: len(filters)], work[-4] = filters, 1.0
        for s, part in enumerate(plan.segments):
            loss, propagator, shares = (each[fingers] for each in self._maps[s])
            level = exponent * (height - below[list(part.nodes)]) - shift
            first = _tension(level[0])
            work[-3] = first
            lost = np.einsum("cgj,jcg->cg", loss[:, :, 0], work[:-2])
            pushes = (first > lost) & ~again
            idle = ~pushes.any(axis=0)
            # Where none pushes yet, it is the one nearest to it.
            nearest = np.where(again, NONE, level[0] - np.log1p(lost)).argmax(axis=0)
            pushes |= idle & (np.arange(len(fingers))[:, None] == nearest)
            size_of = np.where(pushes, level + np.log(unit * exponent), NONE)
            strongest = size_of[0].argmax(axis=0) * height.size + np.arange(height.size)
            m, own = exponent.take(strongest), unit.take(strongest)
            # Exponentials in units of the strongest one's, at start, middle and end of the fingers' way.
            sizes = size_of - np.log(own * m)
            whole = np.logaddexp.reduce(sizes, axis=1)
            share = np.exp(sizes - whole[:, None])
            ratio = unit / own
            # Of another m what is left of its force when slope and force are those of an exponential with m.
            rest = np.where(
                exponent == m, -ratio, ratio * first - np.exp(np.minimum(sizes[0], LARGEST_EXPONENT))
            )
            relaxed = np.maximum(np.where(pushes, lost * ratio - rest, 0.0).sum(axis=0), TINY)
            bend = (whole[0] - 2.0 * whole[1] + whole[2]) / 3.0
            nodes = plan.nodes[s]
            start = StepStart(
                cell,
                openings[nodes],
                pressure[nodes],
                plan.weights[nodes, None] / cell.actuator.area,
                whole[0],
                free[s] * (m / plan.numbers[0]) - bend,
                finger_deviation=bend,
                lift=whole[0] - whole[2],
                relaxed=relaxed,
                idle=idle,
            )
            rise, _, mean = find_loaded_path(m, load.take(strongest), shares.take(strongest), start)
            after = np.clip(height + rise, 0.0, cell.actuator.stroke)
            last = _tension(exponent * (after - below[part.nodes[-1]]) - shift)
            pressed = (mean + 1.0) * np.einsum("i,icg->cg", SIMPSON, share) / (ratio * exponent / m) - 1.0
            straight = 0.5 * (first + last)
            held = after != height + rise
            work[-2] = np.maximum(np.where(pushes & ~held, pressed, straight), 0.0)
            work[-1] = last
            work[:-4] = np.maximum(np.einsum("cgij,jcg->icg", propagator, work), 0.0)
            height = after
        work = np.where(again, work[:, :1], work)
        return height, work[:-5], work[-5]


def _tension(exponent: Floats) -> Floats:
    """Return the elastic force in units of b/m; 0 where there is a gap."""
    tension: Floats = np.expm1(np.clip(exponent, 0.0, LARGEST_EXPONENT))
    return tension


def plan_together(cells: Sequence[Cell], queue: Queue, segments: tuple[Segment, ...]) -> TogetherPlan:
    """Work out once what all periods share, for the cells of all fingers."""
    count = segments[-1].nodes[-1] + 1
    parts: list[Segment] = []
    rows: list[Floats] = []
    for segment in segments:
        # A polynomial through the underside at the instants of a step.
        places = np.linspace(0.0, 1.0, len(segment.nodes))
        powers = np.arange(len(places))
        to_powers = np.linalg.inv(places[:, None] ** powers)
        for part in range(PARTS):
            first = len(rows)
            at = (part + np.array([0.0, 0.5, 1.0])) / PARTS
            for row in (at[:, None] ** powers) @ to_powers:
                rows.append(np.zeros(count))
                rows[-1][list(segment.nodes)] = row
            length = segment.length / PARTS
            parts.append(Segment(segment.start + part * length, length, (first, first + 1, first + 2)))
    stepper = BernoulliExponential()
    made: dict[int, BernoulliPlan] = {}
    for cell in cells:
        made[id(cell)] = made.get(id(cell)) or stepper.plan(cell, queue, tuple(parts))
    return TogetherPlan(tuple(made[id(cell)] for cell in cells), np.array(rows))
