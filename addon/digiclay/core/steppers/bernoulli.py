"""The closed-form step: exact for an exponential spring behind a linear flow resistance.

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

from ..closed_form import TINY, careful, crossed, pressed
from ..contact import LARGEST_EXPONENT
from ..delay import Queue
from ..filled import filled
from ..physics import Cell
from ..places import Segment
from .bernoulli_plan import BernoulliPlan, bernoulli_plan

__all__ = ["BernoulliExponential", "BernoulliPlan"]

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

    def advance(self, plan: BernoulliPlan, driven: Floats, under: Floats) -> Floats:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        cell, k, count = plan.cell, under.shape[1], driven.shape[1]
        openings = plan.response.dot(driven[cell.lag_rows.start :])
        lag = driven[cell.lag_rows]
        lag[:] = openings[len(openings) - len(lag) :]
        openings = openings[:-1]
        # Below the openings' own conductances those with the openings' signs: the sign picks the reservoir.
        conductance = np.empty((2 * len(openings), count))
        size, signed = conductance[: len(openings)], conductance[len(openings) :]
        size[:] = plan.unloaded(openings)
        np.copysign(size, openings, signed)
        moves = plan.moves.dot(conductance)
        free = moves[: len(plan.segments)]
        if k:
            return _under_finger(plan, driven, under, openings[:, :k], free, moves[len(free) :, :k])
        height, (lowest, highest) = driven[0], filled((0.0, cell.actuator.stroke), count)
        for rise in free:
            rise += height
            np.maximum(rise, lowest, out=height)
            np.minimum(height, highest, out=height)
        return np.empty(0)


def _under_finger(
    plan: BernoulliPlan, driven: Floats, under: Floats, openings: Floats, free: Floats, loaded: Floats
) -> Floats:
    """Move a block on step by step, its first k cells under the finger and their pulp with them.

    Returns the forces at the end, see `places.Stepper`.

    Parameters
    ----------
    plan, driven, under
        See `places.Stepper`; all m cells.
    openings : ndarray (g, k)
        At the Gauss points.
    free : ndarray (s, m)
        Rise of each step without load, m; used up.
    loaded : ndarray (3 s, k)
        The other rows that `BernoulliPlan.moves` makes.
    """
    cell, k, rows, count = plan.cell, under.shape[1], plan.cell.pulp_rows, len(free)
    # Numpy takes two operands of one shape twice as fast as an array and a number.
    m, offset, most, zero, one, half, tiny, hard = filled(plan.numbers, k)
    lowest, highest = filled((0.0, cell.actuator.stroke), driven.shape[1])
    height, near = driven[0], driven[0, :k]
    path = plan.path.dot(under)
    exponent = m * near
    exponent -= offset
    exponent -= path[2 * count]
    # The filters, then the tension at the start of a step, on average and at its end.
    work = np.empty((rows.stop + 2, k))
    filters, first, mean, last = work[:-3], work[-3], work[-2], work[-1]
    pulp = driven[rows, :k]
    _tension(exponent, zero, most, last)
    for s, rise in enumerate(free):
        filters[:], first[:] = pulp, last
        lift = path[s]
        slip = loaded[s] - lift
        bow = loaded[count + s] - path[count + s]
        decay = loaded[2 * count + s] + tiny
        lost = plan.lost[s].dot(work[:-2])
        relaxed = lost + one
        idle = first <= lost
        stiffness = decay.copy()
        np.putmask(stiffness, idle, tiny)
        push = stiffness * relaxed
        growth = push + slip
        growth += tiny
        end, bent = exponent + slip, exponent + bow
        strained = np.maximum(bent, end) >= hard
        if not np.count_nonzero(strained):
            relief = pressed(np.exp(bent), growth, stiffness)
            np.divide(relief, stiffness, mean)
        else:
            decay, rise[:k] = _loaded_valve(plan, s, openings, exponent, relaxed, lift)
            slip = m * rise[:k] - lift
            stiffness = np.where(idle, tiny, decay)
            push = stiffness * relaxed
            # Their way bends with the load, not as it would without.
            np.putmask(bow, strained, zero)
            relief, mean[:] = careful(exponent + bow, push + slip + tiny, stiffness)
            end = exponent + slip
        push -= relief
        mean -= one
        end += push
        _tension(end, zero, most, last)
        crossing = (last <= lost) != idle
        if np.count_nonzero(crossing):
            parts = (values[crossing] for values in (exponent, bow, slip, decay, relaxed))
            push[crossing], mean[crossing] = crossed(*parts)
            end = exponent + slip + push
            _tension(end, zero, most, last)
        push /= m
        rise[:k] += push
        rise += height
        np.maximum(rise, lowest, out=height)
        np.minimum(height, highest, out=height)
        stopped = rise[:k] != near
        if np.count_nonzero(stopped):
            # The mean found above is that of a pin that no end stop holds.
            end = m * near - offset - path[2 * count + s + 1]
            _tension(end, zero, most, last)
            np.putmask(mean, stopped, half * (first + last))
        # Where the finger is not touched all through the step the mean is that of no tension.
        np.maximum(mean, zero, out=mean)
        # Of a tension that falls steeply a straight line would make a filter that pulls.
        moved: Floats = plan.transition[s].dot(work)
        np.maximum(moved, zero, out=moved)
        pulp[:] = moved[:-1]
        exponent = end
    force: Floats = moved[-1]
    return force


def _tension(exponent: Floats, zero: Floats, most: Floats, out: Floats) -> None:
    """Work out the elastic force in units of b/m, into `out`; 0 where there is a gap."""
    np.maximum(exponent, zero, out=out)
    np.minimum(out, most, out=out)
    np.expm1(out, out)


def _loaded_valve(
    plan: BernoulliPlan, s: int, openings: Floats, exponent: Floats, relaxed: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """Return decay and free rise of step s where the load decides on the valve's branch.

    The secant conductance is taken at the load of mid step, predicted with the one at the
    start: second order, like the rest.
    """
    m, area = plan.numbers[0], plan.cell.actuator.area
    opening, weights = openings[plan.nodes[s]], plan.weights[plan.nodes[s]] / area
    to_load = plan.to_load * plan.shares[s]
    pressure = plan.cell.supply.pressure(opening)
    grown = middle = _grown(exponent)
    for _ in range(2):
        load = to_load * np.maximum(middle - relaxed, 0.0)
        conductance = plan.cell.flow.conductance(opening, pressure - load)
        decay = m * to_load * (weights @ conductance) + TINY
        free = weights @ (conductance * pressure)
        slip = m * free - lift
        growth = slip + decay * relaxed + TINY
        relief, _ = careful(exponent, growth, decay)
        way = np.where(grown > relaxed, growth - relief, slip)
        middle = 0.5 * (grown + _grown(exponent + way))
    return decay, free


def _grown(exponent: Floats) -> Floats:
    """Return exp(e), 1 where there is a gap."""
    grown: Floats = np.exp(np.minimum(np.maximum(exponent, 0.0), LARGEST_EXPONENT))
    return grown
