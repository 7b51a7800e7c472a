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
from ..physics import Cell
from ..places import Segment
from ..touch import Touch

__all__ = ["BernoulliExponential", "BernoulliPlan"]

Floats = NDArray[np.float64]

#: Constants as arrays: numpy takes twice as long over Python's numbers.
ONE, HALF, NOT_ZERO = np.ones(1), np.full(1, 0.5), np.full(1, TINY)
#: Two-point Gauss-Legendre nodes on [0, 1]: means over a step are exact for cubics.
GAUSS = (0.5 - 3.0**0.5 / 6.0, 0.5 + 3.0**0.5 / 6.0)


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
    means : ndarray (s, 2 s)
        From conductances at the Gauss points to step times mean mobility, m/Pa.
    halfway, transition : tuple of ndarray
        The relaxation's maps, one a step.
    unloaded : callable
        Conductance of a valve without load, m³/(s Pa), from opening and reservoir pressure.
    exponent : float
        The contact's m, 1/m.
    to_load, to_decay : float
        Pressure a unit (b/m) of tension makes, Pa; stiffness ``f_d b / A_a``, Pa/m.
    easy : float
        Below this exponent every flow is laminar and nothing overflows.
    """

    cell: Cell
    segments: tuple[Segment, ...]
    response: Floats
    means: Floats
    halfway: tuple[Floats, ...]
    transition: tuple[Floats, ...]
    unloaded: Callable[[Floats, Floats], Floats]
    exponent: float
    to_load: float
    to_decay: float
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
        to_load = to_decay / contact.exponent
        # How far the load may drive up the drop before some flow could turn turbulent.
        spare = cell.flow.knee - max(abs(cell.supply.high), abs(cell.supply.low))
        return BernoulliPlan(
            cell,
            segments,
            cell.lag.response(queue, [*times, end]),
            np.kron(np.diag(lengths), [0.5, 0.5]) / cell.actuator.area,
            tuple(pulp.halfway(h) for h in lengths),
            tuple(pulp.transition(h) for h in lengths),
            (lambda opening, _: cell.flow.laminar_conductance(opening)) if spare > 0.0 else cell.flow.conductance,
            contact.exponent,
            to_load,
            to_decay,
            min(LARGE, math.log1p(spare / to_load)) if spare > 0.0 else -math.inf,
        )

    def advance(self, plan: BernoulliPlan, y: Floats, commands: Floats, under: Floats) -> None:
        """Move a block of cells on by one control period, in place.

        Parameters
        ----------
        plan : BernoulliPlan
        y : ndarray (r, n)
            State rows, see `physics.Cell`.
        commands : ndarray (q, n)
            Commands of the queue, oldest first.
        under : ndarray (p, k)
            Underside of the finger over the first k cells at the period's instants, m.
        """
        cell, k = plan.cell, under.shape[1]
        lag = y[cell.lag_rows]
        openings = plan.response @ np.concatenate([lag, commands])
        lag[:] = openings[-1:] if cell.lag.rows else lag
        cell.lag.settle(lag)
        openings = openings[:-1]
        pressure = cell.supply.pressure(openings)
        conductance = plan.unloaded(openings, pressure)
        free = plan.means @ (conductance * pressure)
        _freely(y[0, k:], free[:, k:], cell.actuator.stroke)
        if cell.touch and k:
            _under_finger(plan, cell.touch, y[:, :k], under, openings[:, :k], conductance[:, :k], free[:, :k])


def _freely(height: Floats, rise: Floats, stroke: float) -> None:
    """Move untouched pins by their rise (s, n) in each step, m, in place; end stops hold them."""
    for part in rise if _near_a_stop(height, rise, stroke) else [rise.sum(axis=0)]:
        height += part
        np.minimum(np.maximum(height, 0.0, height), stroke, height)


def _near_a_stop(height: Floats, rise: Floats, stroke: float) -> bool:
    """Tell whether some pin could meet an end stop within the period."""
    if not height.size:
        return False
    way = float(np.abs(rise).max()) * len(rise)
    return bool(height.min() < way or height.max() > stroke - way)


def _under_finger(
    plan: BernoulliPlan, touch: Touch, y: Floats, under: Floats, openings: Floats, conductance: Floats, free: Floats
) -> None:
    """Move the cells under the finger on, step by step, and their pulp with them."""
    contact, height, pulp = touch.contact, y[0], touch.pulp.rows
    m, unit = contact.exponent, contact.stiffness / contact.exponent
    decay = plan.to_decay * (plan.means @ conductance) + TINY
    slip = m * (free - (under[1:] - under[:-1]))
    floor = m * (under + contact.offset)
    # Tensions in units of b/m: the filters, then T at the start, on average and at the end of a step.
    work = np.empty((pulp + 3, height.size))
    filters, first, mean, last = work[:pulp], work[pulp], work[pulp + 1], work[pulp + 2]
    np.divide(y[plan.cell.pulp_rows], unit, filters)
    exponent = m * height - floor[0]
    grown = _grown(exponent)
    easy = _easy(plan, exponent, slip, decay, filters)
    for s in range(len(plan.segments)):
        np.subtract(grown, ONE, first)
        relaxed = plan.halfway[s] @ work[: pulp + 1]
        relaxed += ONE
        loaded = grown > relaxed
        if not easy:
            decay[s], free[s] = _loaded_valve(plan, s, openings, exponent, relaxed, under[s + 1] - under[s])
            slip[s] = m * (free[s] - (under[s + 1] - under[s]))
        growth = decay[s] * relaxed
        growth += slip[s]
        growth += NOT_ZERO
        if easy:
            relief = pressed(grown, growth, decay[s])
            rate = relief / decay[s]
        else:
            relief, rate = careful(exponent, growth, decay[s])
        way = np.where(loaded, growth - relief, slip[s])
        crossing = (exponent + way > np.log(relaxed)) != loaded
        if crossing.any():
            parts = (values[crossing] for values in (exponent, slip[s], decay[s], relaxed))
            way[crossing], rate[crossing] = crossed(*parts)
            loaded |= crossing
        way -= slip[s]
        way /= m
        way += free[s]
        height += way
        np.minimum(np.maximum(height, 0.0, height), plan.cell.actuator.stroke, height)
        exponent = m * height
        exponent -= floor[s + 1]
        grown = _grown(exponent)
        np.subtract(grown, ONE, last)
        rate -= ONE
        mean[:] = np.where(loaded, rate, (first + last) * HALF)
        filters[:] = plan.transition[s] @ work
    np.multiply(filters, unit, y[plan.cell.pulp_rows])


def _easy(plan: BernoulliPlan, exponent: Floats, slip: Floats, decay: Floats, filters: Floats) -> bool:
    """Tell whether all through the period every flow is laminar and no exponential overflows."""
    steepest = max(float(slip.max()), 0.0)
    highest = float(exponent.max()) + steepest * len(slip)
    if highest >= plan.easy:
        return False
    pulp = max(math.exp(max(highest, 0.0)), 1.0 + float(filters.max(initial=0.0)))
    return steepest + float(decay.max()) * pulp < LARGE


def _grown(exponent: Floats) -> Floats:
    """Return exp(e), 1 where there is a gap."""
    return np.exp(np.minimum(np.maximum(exponent, 0.0), LARGEST_EXPONENT))


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
        decay = plan.to_decay * (plan.means[s, part] @ conductance) + TINY
        free = plan.means[s, part] @ (conductance * pressure)
        slip = plan.exponent * (free - lift)
        growth = slip + decay * relaxed + TINY
        relief, _ = careful(exponent, growth, decay)
        way = np.where(grown > relaxed, growth - relief, slip)
        middle = 0.5 * (grown + _grown(exponent + way))
    return decay, free
