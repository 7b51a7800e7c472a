"""Closed-form stepper: exact for an exponential spring behind a linear flow resistance.

The valve's opening is known in closed form all through a period. Over a physics step its
conductance, the force lost to relaxation and the finger's speed are frozen at their means, and
what remains is solved exactly (`closed_form`). The step is therefore stable at any length and
stiffness, without iteration, and second order. What the frozen speeds leave out most of, that
free pin and finger go bent paths, is put back by its mean, the chord deviation. A valve that changes
reservoir within a step needs no care (conductance and drive are averaged at Gauss points of the
exact opening), and a cell that meets or leaves the finger does so at the exact instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Constants, Flags, Floats, any_true, apply_map, per_row, prepare_map
from ..model.delay import Queue
from ..model.interfaces import Segment
from ..model.physics import Cell
from .bernoulli_plan import BernoulliPlan, make_plan
from .closed_form import LARGE, solve_crossing, solve_pressed
from .near_overflow import LoadedPath, StepStart, find_loaded_path

__all__ = ["BernoulliExponential", "BernoulliPlan", "StepWorkspace"]


@dataclass(frozen=True)
class BernoulliExponential:
    """Second order, stable at any step and stiffness, without iteration."""

    name = "bernoulli"
    order = 2
    nodes = (0.0, 0.5, 1.0)
    bridges = True

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> BernoulliPlan:
        """Work out once what all periods share."""
        return make_plan(cell, queue, segments)

    def prepare(self, plan: BernoulliPlan, rows: Floats, near: int) -> StepWorkspace:
        """Prepare to move a block of cells; see `interfaces.Stepper`."""
        return StepWorkspace(plan, rows, near)


class StepWorkspace:
    """A block of cells, prepared to be moved period by period: its rows, and the arrays to work in.

    The cells are those of one run, (n,), or of b runs, (n, b), and then the plan's numbers and maps may
    be each run's own. What is in the arrays before a period does not count. Linear maps are bound to
    the arrays they lead from and to.

    Parameters
    ----------
    plan, rows, near
        See `interfaces.Stepper.prepare`; k is short for `near` here.
    """

    def __init__(self, plan: BernoulliPlan, rows: Floats, near: int) -> None:
        cell, k = plan.cell, near
        every, touched = rows.shape[1:], (k, *rows.shape[2:])
        gauss, instants, steps = len(plan.weights), plan.path.shape[1], len(plan.segments)

        def empty(count: int, cells: tuple[int, ...]) -> Floats:
            return np.empty_like(rows, shape=(count, *cells))

        self.plan, self.height, self.near = plan, rows[0], rows[0, :k]
        self.pulp, self.lag = rows[cell.pulp_rows, :k], rows[cell.lag_rows]
        openings = empty(len(plan.response), every)
        self.opening, self.opening_after = openings[:gauss], openings[len(openings) - len(self.lag) :]
        self.open_valves = prepare_map(plan.response, rows[cell.lag_rows.start :], openings)
        # The valves' conductances, the same with the signs of the openings, underside, and ones.
        inputs = empty(2 * gauss + instants + 1, every)
        inputs[-1] = 1.0
        self.size, self.signed = inputs[:gauss], inputs[gauss : 2 * gauss]
        self.under = inputs[2 * gauss : -1, :k]
        # What the maps make of them: see `BernoulliPlan.moves`, of which the first rows, and `loaded`.
        self.free, loaded = empty(steps, every), empty(len(plan.loaded), touched)
        self.rise_freely = prepare_map(plan.moves[:steps], inputs[: 2 * gauss], self.free)
        self.meet_finger = prepare_map(plan.loaded, inputs[:, :k], loaded)
        self.start = loaded[0]
        begins = empty(2, touched)
        self.lost, self.relaxed = begins
        # What `BernoulliPlan.mean_loss` and `propagator` are maps of.
        work = empty(len(self.pulp) + 5, touched)
        work[-5], work[-4] = 0.0, 1.0
        self.filters: Floats = work[:-5]
        self.force: Floats = work[-5]
        self.moved, (self.first, self.mean, self.last) = work[:-4], work[-3:]
        self.propagated = empty(len(self.moved), touched)
        self.steps = tuple(
            (
                rise,
                rise[:k],
                *loaded[1 + 3 * s : 4 + 3 * s],
                prepare_map(plan.mean_loss[s], work[:-2], begins),
                prepare_map(plan.propagator[s], work, self.propagated),
            )
            for s, rise in enumerate(self.free)
        )
        self.constants, self.none = Constants(plan.numbers)[touched], np.zeros_like(self.moved)
        # What `pressed` is not for from the limits on.
        self.guarded, self.limits = empty(5, touched), empty(5, touched)
        self.limits[:] = per_row(plan.limits, rows.ndim)
        self.exponent, self.end, self.bent, self.growth, self.deviation = self.guarded
        self.stops = Constants((0.0, cell.actuator.stroke))[every]

    def __call__(self, under: Floats) -> Floats:
        """Move the block on by one control period, in place; see `interfaces.Movement`."""
        self.open_valves()
        self.lag[:] = self.opening_after
        self._conduct()
        self.rise_freely()
        if under.shape[1]:
            self.under[:] = under
            self.meet_finger()
            self._press()
            return self.force
        height, (lowest, highest) = self.height, self.stops
        for rise in self.free:
            rise += height
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
        return self.force

    def _conduct(self) -> None:
        """Work out the conductances of the valves without load; the sign picks the reservoir."""
        cell, opening, size = self.plan.cell, self.opening, self.size
        if self.plan.laminar:
            cell.flow.laminar_conductance(opening, size)
        else:
            size[:] = cell.flow.conductance(opening, cell.supply.pressure(opening))
        np.copysign(size, opening, self.signed)

    def _press(self) -> None:
        """Move the block on step by step, its first k cells under the finger, and their pulp with them."""
        height, near = self.height, self.near
        first, mean, last, lost, relaxed = self.first, self.mean, self.last, self.lost, self.relaxed
        m, offset, per_m, most, zero, one, half, tiny = self.constants
        guarded, exponent, growth = self.guarded, self.exponent, self.growth
        lowest, highest = self.stops
        self.filters[:] = self.pulp
        np.multiply(near, m, exponent)
        exponent -= self.start
        _tension(exponent, zero, most, first)
        end: Floats = exponent
        for s, (rise, risen, slip, deviation, decay, lose, propagate) in enumerate(self.steps):
            if s:
                first[:] = last
                exponent[:] = end
            lose()
            idle = first <= lost
            stiffness = decay.copy()
            np.putmask(stiffness, idle, tiny)
            push = stiffness * relaxed
            np.add(push, slip, growth)
            growth += tiny
            end = np.add(exponent, slip, self.end)
            bent = np.add(exponent, deviation, self.bent)
            self.deviation[:] = deviation
            beyond = guarded >= self.limits
            if any_true(beyond) and any_true(self._find_near_overflow(s, beyond)):
                risen[:], end, mean[:] = self._move_near_overflow(s, beyond, exponent, deviation, idle)
                _tension(end, zero, most, last)
                rise += height
            else:
                relief = solve_pressed(np.exp(bent), growth, stiffness)
                np.divide(relief, stiffness, mean)
                mean -= one
                push -= relief
                end += push
                _tension(end, zero, most, last)
                crossing = last <= lost
                crossing ^= idle
                if any_true(crossing):
                    parts = (values[crossing] for values in (exponent, deviation, slip, decay, relaxed))
                    push[crossing], mean[crossing] = solve_crossing(*parts)
                    end = exponent + slip + push
                    _tension(end, zero, most, last)
                push *= per_m
                rise += height
                risen += push
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
            stopped = risen != near
            if any_true(stopped):
                # The mean found above is that of a pin that no end stop holds.
                end = near * m - offset - self._seen(2 * len(self.steps) + s + 1)
                _tension(end, zero, most, last)
                np.putmask(mean, stopped, half * (first + last))
            # Where the finger is not touched all through the step the mean is that of no tension.
            np.maximum(mean, zero, out=mean)
            # Of a tension that falls steeply a straight line would make a filter that pulls.
            propagate()
            np.maximum(self.propagated, self.none, out=self.moved)
        self.pulp[:] = self.filters

    def _seen(self, row: int) -> Floats:
        """Return what one row of the plan's `path` makes of the finger's underside."""
        seen: Floats = apply_map(self.plan.path[row : row + 1], self.under)[0]
        return seen

    def _find_near_overflow(self, s: int, beyond: Flags) -> Flags:
        """Clear the cells (5, k[, b]) beyond the limits of step s that only a flow would take there."""
        # Through a shut valve none turns turbulent: its pin is locked, at any load that does not overflow.
        shut = ~self.opening[self.plan.nodes[s], : len(self.near)].any(axis=0)
        beyond[:3] &= ~shut | (self.guarded[:3] >= 0.5 * LARGE)
        return beyond

    def _move_near_overflow(
        self, s: int, beyond: Flags, exponent: Floats, deviation: Floats, idle: Flags
    ) -> LoadedPath:
        """Return the paths over step s, some of whose cells `solve_pressed` is not for."""
        plan, nodes, count = self.plan, self.plan.nodes[s], len(self.steps)
        # Their path bends with the load, not as it would without; or so much that its mean says nothing.
        deviation[beyond.any(axis=0)] = 0.0
        openings = self.opening[nodes, : len(self.near)]
        weights = per_row(plan.weights[nodes], openings.ndim) / plan.cell.actuator.area
        start = StepStart(
            openings,
            weights,
            exponent,
            deviation,
            finger_deviation=self._seen(count + s),
            lift=self._seen(s),
            relaxed=self.relaxed,
            idle=idle,
        )
        return find_loaded_path(plan.cell, plan.numbers[0], plan.to_load, plan.shares[s], start)


def _tension(exponent: Floats, zero: Floats, most: Floats, out: Floats) -> None:
    """Work out the elastic force in units of b/m, into `out`; 0 where there is a gap."""
    np.maximum(exponent, zero, out=out)
    np.minimum(out, most, out=out)
    np.expm1(out, out)
