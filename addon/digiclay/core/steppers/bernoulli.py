"""Closed-form stepper: exact for an exponential spring behind a linear flow resistance.

The valve's opening is known in closed form all through a period. Over a physics step its
conductance, the force lost to relaxation and the finger's speed are frozen at their means, and
what remains is solved exactly (`closed_form`). The step is therefore stable at any length and
stiffness, without iteration, and second order. What the frozen speeds leave out most of, that
free pin and finger go bent ways, is put back by its mean, the bow. A valve that changes
reservoir within a step needs no care (conductance and drive are averaged at Gauss points of the
exact opening), and a cell that meets or leaves the finger does so at the exact instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.constants import filled
from ..base.counting import some
from ..model.delay import Queue
from ..model.interfaces import Segment
from ..model.physics import Cell
from .bernoulli_plan import BernoulliPlan, bernoulli_plan
from .closed_form import crossed, pressed
from .near_overflow import Strain, Way, loaded_way

__all__ = ["BernoulliExponential", "BernoulliPlan", "Block"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BernoulliExponential:
    """Second order, stable at any step and stiffness, without iteration."""

    name = "bernoulli"
    order = 2
    nodes = (0.0, 0.5, 1.0)
    bridges = True

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> BernoulliPlan:
        """Work out once what all periods share."""
        return bernoulli_plan(cell, queue, segments)

    def bind(self, plan: BernoulliPlan, driven: Floats, near: int) -> Block:
        """Make ready to move a block of cells on; see `interfaces.Stepper`."""
        return Block(plan, driven, near)


class Block:
    """Block of cells for integration over many periods: its rows, and work arrays.

    What is in the arrays before a period does not count. Numpy takes two operands of one shape
    twice as fast as an array and a number, so constants are arrays as well.

    Parameters
    ----------
    plan, driven, near
        See `interfaces.Stepper.bind`; k is short for `near` here.
    """

    def __init__(self, plan: BernoulliPlan, driven: Floats, near: int) -> None:
        cell, count, k = plan.cell, driven.shape[1], near
        gauss, instants = len(plan.weights), plan.path.shape[1]

        def empty(*shape: int) -> Floats:
            return np.empty_like(driven, shape=shape)

        self.plan, self.height, self.near = plan, driven[0], driven[0, :k]
        self.pulp, self.lag = driven[cell.pulp_rows, :k], driven[cell.lag_rows]
        self.opened_by = driven[cell.lag_rows.start :]
        self.openings = empty(len(plan.response), count)
        self.opening = self.openings[:gauss]
        self.opening_after = self.openings[len(self.openings) - len(self.lag) :]
        # The valves' conductances, the same with the signs of the openings, underside, and ones.
        inputs = empty(2 * gauss + instants + 1, count)
        inputs[-1] = 1.0
        self.conductances, self.inputs = inputs[: 2 * gauss], inputs[:, :k]
        self.size, self.signed = inputs[:gauss], inputs[gauss : 2 * gauss]
        self.under = inputs[2 * gauss : -1, :k]
        # What the maps make of them: see `BernoulliPlan.moves`, of which the first rows, and `loaded`.
        self.rises = plan.moves[: len(plan.segments)]
        self.free, self.loaded = empty(len(self.rises), count), empty(len(plan.loaded), k)
        self.steps = tuple(
            (rise, rise[:k], *self.loaded[at : at + 3])
            for rise, at in zip(self.free, range(1, len(self.loaded), 3), strict=True)
        )
        self.start = self.loaded[0]
        self.begins = empty(2, k)
        self.lost, self.relaxed = self.begins
        # What `BernoulliPlan.begin` and `finish` are maps of.
        self.work = empty(len(self.pulp) + 5, k)
        self.work[-5], self.work[-4] = 0.0, 1.0
        self.filters = self.work[:-5]
        self.force: Floats = self.work[-5]
        self.begun, self.moved = self.work[:-2], self.work[:-4]
        self.first, self.mean, self.last = self.work[-3:]
        self.constants, self.none = filled(plan.numbers, k), np.zeros_like(self.moved)
        # What `pressed` is not for from the limits on.
        self.guarded, self.limits = empty(5, k), np.array(filled(plan.limits, k))
        self.exponent, self.end, self.bent, self.growth, self.bow = self.guarded
        self.stops = filled((0.0, cell.actuator.stroke), count)

    def __call__(self, under: Floats) -> Floats:
        """Move the block on by one control period, in place; see `interfaces.Movement`."""
        plan = self.plan
        plan.response.dot(self.opened_by, self.openings)
        self.lag[:] = self.opening_after
        plan.unloaded(self.opening, self.size)
        # The sign picks the reservoir.
        np.copysign(self.size, self.opening, self.signed)
        self.rises.dot(self.conductances, self.free)
        if under.shape[1]:
            self.under[:] = under
            plan.loaded.dot(self.inputs, self.loaded)
            self._under_finger()
            return self.force
        height, (lowest, highest) = self.height, self.stops
        for rise in self.free:
            rise += height
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
        return self.force

    def _under_finger(self) -> None:
        """Move the block on step by step, its first k cells under the finger, and their pulp with them."""
        plan, height, near = self.plan, self.height, self.near
        first, mean, last, lost, relaxed = self.first, self.mean, self.last, self.lost, self.relaxed
        m, offset, per_m, most, zero, one, half, tiny = self.constants
        guarded, exponent, growth = self.guarded, self.exponent, self.growth
        lowest, highest = self.stops
        self.filters[:] = self.pulp
        np.multiply(near, m, exponent)
        exponent -= self.start
        _tension(exponent, zero, most, first)
        end: Floats = exponent
        for s, (rise, risen, slip, bow, decay) in enumerate(self.steps):
            if s:
                first[:] = last
                exponent[:] = end
            plan.begin[s].dot(self.begun, self.begins)
            idle = first <= lost
            stiffness = decay.copy()
            np.putmask(stiffness, idle, tiny)
            push = stiffness * relaxed
            np.add(push, slip, growth)
            growth += tiny
            end = np.add(exponent, slip, self.end)
            bent = np.add(exponent, bow, self.bent)
            self.bow[:] = bow
            if some(guarded >= self.limits):
                risen[:], end, mean[:] = self._strained(s, exponent, bow, idle)
                _tension(end, zero, most, last)
                rise += height
            else:
                relief = pressed(np.exp(bent), growth, stiffness)
                np.divide(relief, stiffness, mean)
                mean -= one
                push -= relief
                end += push
                _tension(end, zero, most, last)
                crossing = last <= lost
                crossing ^= idle
                if some(crossing):
                    parts = (values[crossing] for values in (exponent, bow, slip, decay, relaxed))
                    push[crossing], mean[crossing] = crossed(*parts)
                    end = exponent + slip + push
                    _tension(end, zero, most, last)
                push *= per_m
                rise += height
                risen += push
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
            stopped = risen != near
            if some(stopped):
                # The mean found above is that of a pin that no end stop holds.
                end = near * m - offset - plan.path[2 * len(self.steps) + s + 1].dot(self.under)
                _tension(end, zero, most, last)
                np.putmask(mean, stopped, half * (first + last))
            # Where the finger is not touched all through the step the mean is that of no tension.
            np.maximum(mean, zero, out=mean)
            # Of a tension that falls steeply a straight line would make a filter that pulls.
            np.maximum(plan.finish[s].dot(self.work), self.none, out=self.moved)
        self.pulp[:] = self.filters

    def _strained(self, s: int, exponent: Floats, bow: Floats, idle: NDArray[np.bool_]) -> Way:
        """Return the way of step s, some of whose cells `pressed` is not for."""
        plan, under, nodes = self.plan, self.under, self.plan.nodes[s]
        # Their way bends with the load, not as it would without; or so much that its mean says nothing.
        bow[(self.guarded >= self.limits).any(axis=0)] = 0.0
        weights, count = plan.weights[nodes, None] / plan.cell.actuator.area, len(self.steps)
        finger_bow, lift = plan.path[count + s].dot(under), plan.path[s].dot(under)
        openings = self.opening[nodes, : self.near.size]
        seen = Strain(openings, weights, exponent, bow, finger_bow, lift, self.relaxed, idle)
        return loaded_way(plan.cell, plan.numbers[0], plan.to_load, plan.shares[s], seen)


def _tension(exponent: Floats, zero: Floats, most: Floats, out: Floats) -> None:
    """Work out the elastic force in units of b/m, into `out`; 0 where there is a gap."""
    np.maximum(exponent, zero, out=out)
    np.minimum(out, most, out=out)
    np.expm1(out, out)
