"""Cells that several fingertips press at once, by the closed form of their sum.

With one exponent m the forces of several fingertips are that of one: ``Σ exp(m (H - U_f)) = exp(m
(H - U))`` with ``U = -(1/m) log Σ exp(-m U_f)``, less what each has lost to relaxation. A fingertip
with another m is replaced by one with the m of the strongest, of equal force and stiffness at the
start of a part of the step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.contact import LARGEST_EXPONENT
from ..model.delay import Queue
from ..model.interfaces import Segment
from ..model.physics import Cell
from .bernoulli import LARGEST_DEVIATION, BernoulliExponential, BernoulliPlan, divide_segments
from .closed_form import LARGE, TINY, StepStart, find_loaded_path

#: Parts of a physics step, within which different fingertips may press.
PARTS = 2
#: Mean over a part by values at its start, middle and end.
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0
#: Logarithm of no force.
NONE = -1e300


@dataclass(frozen=True, eq=False)
class TogetherPlan:
    """Constants of cells under several fingertips; a call moves them through a control period."""

    plans: tuple[BernoulliPlan, ...]
    """Of each finger, for parts of the physics steps."""
    between: Floats
    """(i, p): From undersides at the period's instants to those at the parts' instants."""
    beside: Cells
    """(2, i): The period's instants before and after each of those."""

    @cached_property
    def _numbers(self) -> Floats:
        """Of each finger (5, f): m, 1/m; m x0; force per unit of tension, N; its pressure, Pa; exponent above
        which a flow may be turbulent."""
        rows = []
        for plan in self.plans:
            assert plan.cell.touch is not None
            law = plan.cell.touch.contact
            unit = law.share * law.stiffness / law.exponent
            rows.append(
                [law.exponent, law.exponent * law.offset, unit, plan.to_load, plan.limits[0]]
            )
        return np.array(rows).T

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

        `valves` (l, g): openings and commands; `under` (p, c, g): undersides at the period's
        instants, m.
        """
        plan, numbers = self.plans[0], self._numbers[:, fingers]
        cell, count = plan.cell, len(plan.segments)
        # A finger that is repeated, to fill the columns, presses only once.
        again = np.zeros(fingers.shape, np.bool_)
        again[1:] = fingers[1:] == fingers[0]
        openings = plan.response[: len(plan.weights)].dot(valves)
        pressure = cell.supply.pressure(openings)
        size = cell.flow.conductance(openings, pressure)
        steered = np.empty_like(size)
        cell.supply.steer(size, openings, steered)
        free = plan.moves[count : 3 * count].dot(np.concatenate([size, steered]))
        openings, pressure = (
            rows[:, None].repeat(len(fingers) + 1, axis=1) for rows in (openings, pressure)
        )
        # A polynomial oscillates at a jump: a finger is limited to its undersides at the instants
        # around.
        ends = under[self.beside]
        below = np.einsum("ip,pcg->icg", self.between, under).clip(
            ends.min(axis=0), ends.max(axis=0)
        )
        exponent, shift, unit, *_ = numbers
        work = np.zeros((len(filters) + 5, *fingers.shape))
        work[: len(filters)], work[-4] = filters, 1.0
        for s, part in enumerate(plan.segments):
            loss, propagator, shares = (each[fingers] for each in self._maps[s])
            underside, nodes = below[list(part.nodes)], plan.nodes[s]
            level = exponent * (height - underside) - shift
            first = _tension(level[0])
            work[-3] = first
            lost = np.einsum("cgj,jcg->cg", loss[:, :, 0], work[:-2])
            waits = first <= lost
            pushes = ~(waits | again)
            idle = ~pushes.any(axis=0)
            united = pushes | idle & ~again
            size_of = np.where(united, level[0] + np.log(unit * exponent), NONE)
            strongest = size_of.argmax(axis=0), np.arange(height.size)
            m, strongest_unit = exponent[strongest], unit[strongest]
            # Exponentials in units of the strongest one, at start, middle and end of the fingers'
            # paths.
            sizes = size_of - np.log(strongest_unit * m) - m * (underside - underside[0])
            whole = np.logaddexp.reduce(sizes, axis=1)
            share = np.exp(sizes - whole[:, None])
            ratio = unit / strongest_unit
            # Force of a finger with another m, less that of the exponential with m of the same
            # slope.
            bounded = np.exp(np.minimum(sizes[0], LARGEST_EXPONENT))
            rest = np.where(exponent == m, -ratio, ratio * first - bounded)
            relaxed = np.maximum(np.where(united, lost * ratio - rest, 0.0).sum(axis=0), TINY)
            # Rows of each finger alone, then of those that push at the start as one. That one lacks
            # fingers that begin to push later, but no pin is higher under all fingers than under
            # any of them.
            paths = _append(level, whole)
            bend, lift = (paths[0] - 2.0 * paths[1] + paths[2]) / 3.0, paths[0] - paths[2]
            rates, _, _, to_load, hard = _append(numbers, numbers[:, *strongest])
            slip, deviation = free[s::count, None] * (rates / plan.numbers[0]) - (lift, bend)
            # See `bernoulli.BernoulliPlan.limits`; a pin behind a shut valve is locked.
            hard = np.where(openings[nodes].any(axis=0), hard, 0.5 * LARGE)
            beyond = paths[0] + np.maximum(np.maximum(slip, deviation), 0.0) >= hard
            deviation[beyond | (deviation >= LARGEST_DEVIATION)] = 0.0
            start = StepStart(
                cell,
                openings[nodes],
                pressure[nodes],
                plan.weights[nodes, None, None] / cell.actuator.area,
                paths[0],
                deviation,
                finger_deviation=bend,
                lift=lift,
                relaxed=_append(lost + 1.0, relaxed),
                idle=_append(waits, idle),
            )
            rises, _, means = find_loaded_path(
                rates, to_load, _append(shares, shares[strongest]), start
            )
            rises[-1, idle] = np.inf
            rise = rises.min(axis=0)
            after = np.clip(height + rise, 0.0, cell.actuator.stroke)
            last = _tension(exponent * (after - underside[-1]) - shift)
            straight = 0.5 * (first + last)
            pressed = ((means[-1] + 1.0) * np.einsum("i,icg->cg", SIMPSON, share) + rest) / ratio
            # No finger is pressed harder than alone.
            mean = np.minimum(np.where(pushes, pressed, straight), means[:-1])
            work[-2] = np.maximum(np.where(after == height + rise, mean, straight), 0.0)
            work[-1] = last
            work[:-4] = np.maximum(np.einsum("cgij,jcg->icg", propagator, work), 0.0)
            work = np.where(again, work[:, :1], work)
            height = after
        return height, work[:-5], work[-5]


def _append(rows: Any, row: Any) -> Any:
    """Return arrays (.., c, g) and (.., g) as one (.., c + 1, g)."""
    return np.concatenate([rows, row[..., None, :]], axis=-2)


def _tension(exponent: Floats) -> Floats:
    """Return the elastic force in units of b/m; 0 in a gap."""
    return np.expm1(np.clip(exponent, 0.0, LARGEST_EXPONENT))


def plan_together(
    cells: Sequence[Cell], queue: Queue, segments: tuple[Segment, ...]
) -> TogetherPlan:
    """Compute once what all periods share, for the cells of all fingers."""
    parts, between = divide_segments(segments, PARTS)
    last = segments[-1].nodes[-1]
    beside: list[tuple[int, int]] = []
    for segment in segments:
        for place in np.arange(2 * PARTS) * (len(segment.nodes) - 1) / (2 * PARTS):
            before, after = math.floor(place), math.ceil(place)
            beside.append((segment.nodes[before], segment.nodes[after]))
    beside.append((last, last))
    stepper = BernoulliExponential()
    plans: dict[int, BernoulliPlan] = {}
    for cell in cells:
        plans[id(cell)] = plans.get(id(cell)) or stepper.plan(cell, queue, parts)
    return TogetherPlan(tuple(plans[id(cell)] for cell in cells), between, np.array(beside).T)
