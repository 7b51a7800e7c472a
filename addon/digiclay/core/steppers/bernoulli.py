"""The closed-form step: exact for an exponential spring behind a linear flow resistance.

The valve's opening is known in closed form all through a period. Over a physics step its
conductance, the force lost to relaxation and the finger's speed are frozen at mid step, and
what remains is solved exactly (`closed_form`). The step is therefore stable at any length and
stiffness, without iteration, and second order. A valve that changes reservoir within a step
needs no care (conductance and drive are averaged at Gauss points of the exact opening), and
a cell that meets or leaves the finger does so at the exact instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..absent import Unrelaxed
from ..closed_form import LARGE, TINY, careful, crossed, pressed
from ..contact import LARGEST_EXPONENT, Contact
from ..delay import Queue
from ..physics import GAUSS, Cell
from ..places import Segment

__all__ = ["BernoulliExponential", "BernoulliPlan"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BernoulliPlan:
    """What all periods share.

    Attributes
    ----------
    cell : Cell
    segments : tuple of Segment
        The s physics steps of a period.
    response : ndarray (2 s + 1, r)
        From opening and queued commands to the openings at all Gauss points, and at the end.
    means, stiffness : ndarray (s, 2 s)
        From conductances at the Gauss points to step times mean mobility, m/Pa; and to the
        decay of `closed_form`.
    halfway, transition : tuple of ndarray
        The relaxation's maps, one a step.
    unloaded : callable
        Conductance of a valve without load, m³/(s Pa), from opening and reservoir pressure.
    constants : ndarray (9,)
        The contact's m, 1/m, and x0, m; b/m, N, in which tensions are counted; the stroke, m;
        the largest exponent; 1, 1/2, 0; and what stands for zero in a ratio.
    to_load : float
        Pressure a unit (b/m) of tension makes, Pa.
    easy : float
        Below this exponent every flow is laminar and nothing overflows.
    """

    cell: Cell
    segments: tuple[Segment, ...]
    response: Floats
    means: Floats
    stiffness: Floats
    halfway: tuple[Floats, ...]
    transition: tuple[Floats, ...]
    unloaded: Callable[[Floats, Floats], Floats]
    constants: Floats
    to_load: float
    easy: float


@dataclass(frozen=True)
class BernoulliExponential:
    """Second order, stable at any step and stiffness, without iteration."""

    name = "bernoulli"
    order = 2
    nodes = (0.0, 1.0)

    def plan(self, cell: Cell, queue: Queue, segments: tuple[Segment, ...]) -> BernoulliPlan:
        """Work out once what all periods share."""
        times = [part.start + node * part.length for part in segments for node in GAUSS]
        end = segments[-1].start + segments[-1].length
        lengths = [part.length for part in segments]
        pulp, contact = (cell.touch.pulp, cell.touch.contact) if cell.touch else (Unrelaxed(), Contact())
        to_decay = contact.share * contact.stiffness / cell.actuator.area
        m, stroke = contact.exponent, cell.actuator.stroke
        to_load = to_decay / m
        # How far the load may drive up the drop before some flow could turn turbulent.
        spare = cell.flow.knee - cell.supply.largest
        means = np.kron(np.diag(lengths), [0.5, 0.5]) / cell.actuator.area
        return BernoulliPlan(
            cell,
            segments,
            cell.lag.response(queue, [*times, end]),
            means,
            to_decay * means,
            tuple(pulp.halfway(h) for h in lengths),
            tuple(pulp.transition(h) for h in lengths),
            (lambda opening, _: cell.flow.laminar_conductance(opening))
            if spare > 0.0
            else cell.flow.conductance,
            np.array(
                [m, contact.offset, contact.stiffness / m, stroke, LARGEST_EXPONENT, 1.0, 0.5, 0.0, TINY]
            ),
            to_load,
            min(LARGE, math.log1p(spare / to_load)) if spare > 0.0 else -math.inf,
        )

    def advance(self, plan: BernoulliPlan, driven: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place; see `places.Stepper`."""
        cell, k, height, stroke = plan.cell, under.shape[1], driven[0], plan.cell.actuator.stroke
        openings = np.dot(plan.response, driven[cell.lag_rows.start :])
        lag = driven[cell.lag_rows]
        lag[:] = openings[len(openings) - len(lag) :]
        cell.lag.settle(lag)
        openings = openings[:-1]
        pressure = cell.supply.pressure(openings)
        conductance = plan.unloaded(openings, pressure)
        pressure *= conductance
        free = np.dot(plan.means, pressure)
        if k:
            _under_finger(plan, driven[:, :k], under, openings[:, :k], conductance[:, :k], free[:, :k])
        untouched = height[k:]
        for rise in free[:, k:]:
            untouched += rise
            np.maximum(untouched, 0.0, out=untouched)
            np.minimum(untouched, stroke, out=untouched)


def _under_finger(
    plan: BernoulliPlan, y: Floats, under: Floats, openings: Floats, conductance: Floats, free: Floats
) -> None:
    """Move the cells under the finger on, step by step, and their pulp with them."""
    height, k, pulp = y[0], y.shape[1], plan.cell.pulp_rows.stop - 1
    # Numpy takes two operands of one shape three times as fast as an array and a number.
    m, offset, unit, stroke, most, one, half, zero, tiny = plan.constants.repeat(k).reshape(-1, k)
    decay = np.dot(plan.stiffness, conductance)
    decay += tiny
    lift = under[1:] - under[:-1]
    slip = free - lift
    slip *= m
    floor = under + offset
    floor *= m
    # Tensions in units of b/m: the filters, then T at the start, on average and at the end of a step.
    work = np.empty((pulp + 3, k))
    filters, first, mean, last = work[:pulp], work[pulp], work[pulp + 1], work[pulp + 2]
    np.divide(y[plan.cell.pulp_rows], unit, filters)
    np.maximum(filters, zero, out=filters)
    exponent = m * height
    exponent -= floor[0]
    grown = _grown(exponent, zero, most)
    easy = _easy(plan, exponent, slip, decay, filters)
    for s in range(len(plan.segments)):
        np.subtract(grown, one, first)
        relaxed = np.dot(plan.halfway[s], work[: pulp + 1])
        relaxed += one
        idle = grown <= relaxed
        if not easy:
            decay[s], free[s] = _loaded_valve(plan, s, openings, exponent, relaxed, lift[s])
            slip[s] = m * (free[s] - lift[s])
        growth = decay[s] * relaxed
        growth += slip[s]
        growth += tiny
        if easy:
            relief = pressed(grown, growth, decay[s])
            rate = relief / decay[s]
        else:
            relief, rate = careful(exponent, growth, decay[s])
        way = growth - relief
        np.putmask(way, idle, slip[s])
        crossing = (exponent + way <= np.log(relaxed)) != idle
        if np.count_nonzero(crossing):
            parts = (values[crossing] for values in (exponent, slip[s], decay[s], relaxed))
            way[crossing], rate[crossing] = crossed(*parts)
            idle[crossing] = False
        way -= slip[s]
        way /= m
        way += free[s]
        way += height
        np.maximum(way, zero, out=height)
        np.minimum(height, stroke, out=height)
        # The mean found above is that of a pin that no end stop holds.
        idle |= way != height
        np.multiply(m, height, exponent)
        exponent -= floor[s + 1]
        grown = _grown(exponent, zero, most)
        np.subtract(grown, one, last)
        np.add(first, last, mean)
        mean *= half
        rate -= one
        np.putmask(mean, ~idle, rate)
        # Of a tension that falls steeply a straight line would make a filter that pulls.
        np.maximum(np.dot(plan.transition[s], work), zero, out=filters)
    np.multiply(filters, unit, y[plan.cell.pulp_rows])


def _easy(plan: BernoulliPlan, exponent: Floats, slip: Floats, decay: Floats, filters: Floats) -> bool:
    """Tell whether all through the period every flow is laminar and no exponential overflows."""
    steepest = max(float(slip.max()), 0.0)
    highest = float(exponent.max()) + steepest * len(slip)
    if highest >= plan.easy:
        return False
    pulp = max(math.exp(max(highest, 0.0)), 1.0 + float(filters.max(initial=0.0)))
    return steepest + float(decay.max()) * pulp < LARGE


def _grown(exponent: Floats, zero: Floats | float = 0.0, most: Floats | float = LARGEST_EXPONENT) -> Floats:
    """Return exp(e), 1 where there is a gap."""
    grown: Floats = np.maximum(exponent, zero)
    np.minimum(grown, most, out=grown)
    np.exp(grown, grown)
    return grown


def _loaded_valve(
    plan: BernoulliPlan, s: int, openings: Floats, exponent: Floats, relaxed: Floats, lift: Floats
) -> tuple[Floats, Floats]:
    """Return decay and free rise of step s where the load decides on the valve's branch.

    The secant conductance is taken at the load of mid step, predicted with the one at the
    start: second order, like the rest.
    """
    part = slice(2 * s, 2 * s + 2)
    pressure = plan.cell.supply.pressure(openings[part])
    grown = middle = _grown(exponent)
    for _ in range(2):
        load = plan.to_load * np.maximum(middle - relaxed, 0.0)
        conductance = plan.cell.flow.conductance(openings[part], pressure - load)
        decay = plan.stiffness[s, part] @ conductance + TINY
        free = plan.means[s, part] @ (conductance * pressure)
        slip = plan.constants[0] * (free - lift)
        growth = slip + decay * relaxed + TINY
        relief, _ = careful(exponent, growth, decay)
        way = np.where(grown > relaxed, growth - relief, slip)
        middle = 0.5 * (grown + _grown(exponent + way))
    return decay, free
