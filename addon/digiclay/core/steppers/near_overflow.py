"""Closed-form step under extreme loads, and with fingertip jumps.

`closed_form.solve_pressed` holds where every flow is laminar and no exponential overflows. Elsewhere the
secant conductance is taken at the load of mid step, all is solved on logarithms, and what comes out is held
within what the valve can do: a pin never goes farther than the flow under the largest load of the step takes
it, nor deeper than the finger comes. A valve that is shut moves nothing, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..model.contact import LARGEST_EXPONENT
from ..model.physics import Cell
from .closed_form import TINY, replace_zeros, solve_carefully, solve_crossing


class StepStart(NamedTuple):
    """Conditions at the start of a step, for k cells, (k,), or for k cells of b runs, (k, b).

    Attributes
    ----------
    openings : ndarray (g, ..)
        Of the valves, at the step's Gauss points.
    weights : ndarray (g, 1) or (g, 1, b)
        Of these points, over the piston's area, s/m².
    exponent : ndarray
        At the start of the step, see `closed_form`.
    deviation : ndarray
        Chord deviation of the path without load, see `closed_form.solve_crossing`.
    finger_deviation : ndarray
        The finger's part in it, with its sign changed.
    lift : ndarray
        Rise of the finger, in 1/m.
    relaxed : ndarray
        exp(e) at which the pulp begins to push.
    idle : ndarray of bool
        Cells that it does not push at the start.
    """

    openings: Floats
    weights: Floats
    exponent: Floats
    deviation: Floats
    finger_deviation: Floats
    lift: Floats
    relaxed: Floats
    idle: NDArray[np.bool_]


class LoadedPath(NamedTuple):
    """Result of a step.

    Attributes
    ----------
    rise : ndarray
        Of the pin, m, but for its stops.
    end : ndarray
        Exponent at the end.
    mean : ndarray
        Mean of the tension over the step, in units of b/m.
    """

    rise: Floats
    end: Floats
    mean: Floats


@dataclass(frozen=True, eq=False)
class _Valve:
    """Flow through the valves of a step.

    Attributes
    ----------
    openings, weights : ndarray
        See `StepStart`.
    pressure : ndarray
        At the far side of the valve, Pa.
    """

    cell: Cell
    openings: Floats
    weights: Floats
    pressure: Floats

    def conductance(self, load: Floats) -> Floats:
        """Return the secant conductance under a load, Pa, at each Gauss point."""
        return self.cell.flow.conductance(self.openings, self.pressure - load)

    def rises(self, load: Floats | float) -> Floats:
        """Return what flows through each Gauss point's share of the step under a load, Pa, as a rise, m."""
        drop = self.pressure - load
        rises: Floats = self.weights * (self.cell.flow.conductance(self.openings, drop) * drop)
        return rises


def find_loaded_path(
    cell: Cell, m: Floats | float, to_load: Floats | float, share: float, start: StepStart
) -> LoadedPath:
    """Return the paths of cells over a step in which some of them are near overflow.

    `m` (b,), the contact's exponent, 1/m; `to_load` (b,), pressure that a unit of tension makes, Pa; `share`
    (b,), share of the tension that pushes, the rest being lost to relaxation within the step.
    """
    valve = _Valve(cell, start.openings, start.weights, cell.supply.pressure(start.openings))
    decay, free = _mid_load(valve, m, to_load * share, start)
    slip = m * free - start.lift
    exponent, idle = start.exponent, start.idle
    bent = exponent + start.deviation
    push, mean = _press(bent, slip, np.where(idle, TINY, decay), start.relaxed)
    push[idle] = 0.0
    mean -= 1.0
    crossing = (_exponential(exponent + slip + push) <= start.relaxed) != idle
    if crossing.any():
        parts = (values[crossing] for values in (exponent, start.deviation, slip, decay, start.relaxed))
        push[crossing], mean[crossing] = solve_crossing(*parts)
    rise = _limit(valve, m, to_load, start, free + push / m)
    return LoadedPath(rise, exponent + (m * rise - start.lift), mean)


def _mid_load(
    valve: _Valve, m: Floats | float, to_load: Floats | float, start: StepStart
) -> tuple[Floats, Floats]:
    """Return decay and free rise, m, with the secant conductance at the load of mid step.

    It is predicted with the one at the start: second order, like the rest.
    """
    grown = middle = _exponential(start.exponent)
    for _ in range(2):
        conductance = valve.conductance(to_load * np.maximum(middle - start.relaxed, 0.0))
        decay = m * to_load * (valve.weights * conductance).sum(axis=0) + TINY
        free = (valve.weights * (conductance * valve.pressure)).sum(axis=0)
        slip = m * free - start.lift
        push, _ = _press(start.exponent, slip, decay, start.relaxed)
        way = np.where(grown > start.relaxed, slip + push, slip)
        middle = 0.5 * (grown + _exponential(start.exponent + way))
    return decay, free


def _press(exponent: Floats, slip: Floats, decay: Floats, relaxed: Floats) -> tuple[Floats, Floats]:
    """Return the load's part of the way, and the mean of exp(e), of cells that stay under load."""
    return solve_carefully(exponent, replace_zeros(slip + decay * relaxed), slip, decay, relaxed)


def _limit(
    valve: _Valve, m: Floats | float, to_load: Floats | float, start: StepStart, rise: Floats
) -> Floats:
    """Return a rise, m, held within what the valve can do.

    Upwards that is the flow without load. Downwards it is the flow under the largest load there is; and no
    finger pushes a pin deeper than it comes, what the pin falls by itself aside.
    """
    alone = valve.rises(0.0)
    highest, fall = np.maximum(alone, 0.0).sum(axis=0), np.minimum(alone, 0.0).sum(axis=0)
    # Along the parabola of the finger's way, at its middle and its end.
    middle = 0.5 * start.lift + 1.5 * start.finger_deviation
    deepest = np.maximum(start.exponent - np.minimum(np.minimum(middle, start.lift), 0.0), 0.0)
    most = _exponential(deepest + m * highest)
    pushed = np.minimum(valve.rises(to_load * (most - 1.0)), 0.0).sum(axis=0)
    lowest = np.maximum(pushed, fall - deepest / m)
    return np.minimum(np.maximum(rise, lowest), highest)


def _exponential(exponent: Floats) -> Floats:
    """Return exp(e), 1 where there is a gap."""
    grown: Floats = np.exp(np.minimum(np.maximum(exponent, 0.0), LARGEST_EXPONENT))
    return grown
