"""Exact solution of a loaded cell's equation over a step with frozen coefficients.

An exponential spring behind a linear flow resistance. All is dimensionless: the exponent
``e = m (x - x0)`` of the indentation x, time s in steps (0 to 1). While the fingertip presses,

    de/ds = slip + decay (pulp - exp(e)),

where `slip` is m times the approach of pin and fingertip without load, `decay` the hydraulic
stiffness, and ``pulp = 1 + S m/b`` the value of exp(e) at which the relaxed pulp begins to
push. ``u = exp(-e)`` obeys the linear equation ``du/ds = decay - growth u`` with
``growth = slip + decay pulp``: a Bernoulli equation. Where no force acts, ``de/ds = slip``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Flags, Floats
from ..model.contact import LARGEST_EXPONENT
from ..model.physics import Cell

#: Above this exponent, logarithms of sums are computed: `solve_carefully` instead of
#: `solve_pressed`.
LARGE = 300.0
#: Replaces zero in 0/0 limits.
TINY = 1e-200
#: Logarithm of q below which log(1 + q) is q, to the last bit.
_ROUNDED_AWAY = -36.8
#: Replaces a slip of zero in a quotient that is then multiplied by a growth.
_STILL = 1e-100
#: Least load at which the slope of a flow is computed, Pa.
LEAST = 1.0
_ALL_BUT_GONE = float(np.nextafter(-1.0, 0.0))


def solve_pressed(grown: Floats, growth: Floats, decay: Floats) -> Floats:
    """Return the relief of cells that stay under load: ``e(1) - e(0) = growth - relief``.

    It is ``log(1 + q)``, ``q = decay grown (exp(growth) - 1)/growth``, with `grown` =
    ``exp(e(0))``. The mean of exp(e) is ``relief / decay``. Growth and decay must not be zero (use
    `TINY`), nor an exponent above `LARGE`.
    """
    q: Floats = np.expm1(growth)
    q /= growth
    q *= grown
    q *= decay
    np.log1p(q, q)
    return q


def solve_carefully(
    exponent: Floats, growth: Floats, slip: Floats, decay: Floats, pulp: Floats
) -> tuple[Floats, Floats]:
    """Return the change of e by the load, and the mean of exp(e), of cells that stay under load, of any size.

    `decay` must be at least `TINY`, `growth` not zero (use `TINY`). The first, ``e(1) - e(0) -
    slip``, is at most 0 if e(0) is above ``log(pulp)``.
    """
    size = np.abs(growth)
    part, log_decay = np.log(-np.expm1(-size) / size), np.log(decay)
    log_grown = exponent + np.maximum(growth, 0.0) + part
    log_q = log_decay + log_grown
    relief = np.logaddexp(0.0, log_q)
    ratio = np.where(log_q < _ROUNDED_AWAY, 0.0, np.log(np.maximum(relief, TINY)) - log_q)
    push, log_mean = decay * pulp - relief, log_grown + ratio
    vast = size > LARGE
    if np.count_nonzero(vast):
        # The difference of such large relief and growth has lost its digits: e(1) is computed
        # without them.
        after = np.minimum(growth, 0.0) - np.logaddexp(
            -np.maximum(growth, 0.0), log_decay + exponent + part
        )
        np.putmask(push, vast, after - slip)
        lasting = vast & (log_q >= _ROUNDED_AWAY)
        np.putmask(log_mean, lasting, np.log(np.maximum(relief, TINY)) - log_decay)
    return push, np.exp(np.minimum(log_mean, LARGE))


def solve_crossing(
    exponent: Floats, deviation: Floats, slip: Floats, decay: Floats, pulp: Floats, idle: Flags
) -> tuple[Floats, Floats]:
    """Return ``e(1) - e(0) - slip`` and the mean of ``max(exp(e) - 1, 0)`` as contact begins or ends.

    Contact begins at ``log(pulp)`` where the pin is `idle` at the start, and ends there where it is
    not; the instant is exact on a straight path, and of second order on a curved one. `deviation`:
    chord deviation of the path without load, its mean above the straight line between its ends.
    """
    growth = replace_zeros(slip + decay * pulp)
    slip = np.where(np.abs(slip) < _STILL, _STILL, slip)
    threshold = np.log(pulp)
    share = _loaded_share(threshold - exponent, slip, growth, idle)
    # Mean height of a parabola over the loaded part, from its mean over the whole step.
    exponent = exponent + deviation * share * (3.0 - 2.0 * share)
    share = _loaded_share(threshold - exponent, slip, growth, idle)
    start = np.maximum(exponent, threshold)
    loaded_decay = np.maximum(share * decay, TINY)
    push, mean = solve_carefully(
        start, replace_zeros(share * growth), share * slip, loaded_decay, pulp
    )
    # Without load the exponent is linear, up to the threshold or down from it; below 0 is a gap.
    apart = np.maximum(np.abs((1.0 - share) * slip), TINY)
    closed = np.minimum(apart, np.maximum(threshold, 0.0))
    alone = (pulp * -np.expm1(-closed) - closed) / apart
    return push, share * (mean - 1.0) + (1.0 - share) * alone


def _loaded_share(gap: Floats, slip: Floats, growth: Floats, idle: Flags) -> Floats:
    """Return the share of the step in which a cell is loaded; `gap`: threshold less e(0).

    An idle cell that touches at the start may have a gap below 0 by rounding: it meets the finger
    then.
    """
    # At the end of contact u has grown from exp(-e(0)) to 1/pulp, by the linear equation.
    shrunk = np.expm1(np.minimum(gap, 0.0)) / slip
    leaving = np.log1p(np.maximum(growth * shrunk, _ALL_BUT_GONE)) / growth
    share: Floats = np.where(idle, 1.0 - gap / slip, leaving)
    return np.minimum(np.maximum(share, 0.0), 1.0)


def replace_zeros(values: Floats) -> Floats:
    """Return `values` with `TINY` for zeros."""
    return np.where(np.abs(values) < TINY, TINY, values)


class StepStart(NamedTuple):
    """Conditions at the start of a step, for k cells, (k,), or for k cells of b runs, (k, b)."""

    cell: Cell
    openings: Floats
    pressure: Floats
    """(g, ..): Openings of the valves at the step's Gauss points, and pressures behind them, Pa."""
    weights: Floats
    """(g, 1) or (g, 1, b): Weights of these points over the piston's area, s/m²."""
    exponent: Floats
    """At the start of the step, see `closed_form`."""
    deviation: Floats
    """Chord deviation of the path without load, see `closed_form.solve_crossing`."""
    finger_deviation: Floats
    """The fingertip's part of it, with the opposite sign."""
    lift: Floats
    """Rise of the fingertip, in 1/m."""
    relaxed: Floats
    """exp(e) at which the pulp begins to push."""
    idle: NDArray[np.bool_]
    """Cells that the pulp does not push at the start."""

    def rises(self, load: Floats | float) -> Floats:
        """Return the rise, m, by the flow at each Gauss point, times its weight, under a load, Pa."""
        return self.weights * self.cell.flow.flow(self.openings, self.pressure - load)


def find_loaded_path(
    m: Floats | float, to_load: Floats | float, share: Floats | float, start: StepStart
) -> tuple[Floats, Floats, Floats]:
    """Return the paths of cells over a step in which some of them are near overflow.

    They are the rise of the pin, m, without its end stops; the exponent at the end; and the mean
    tension over the step, in units of b/m. The contact's exponent m is in 1/m, the pressure
    `to_load` per unit of tension in Pa; `share` of the tension pushes, and the rest is lost to
    relaxation within the step.
    """
    decay, free = _mid_load(m, to_load * share, start)
    slip = m * free - start.lift
    exponent, idle = start.exponent, start.idle
    bent = exponent + start.deviation
    push, mean = _press(bent, slip, np.where(idle, TINY, decay), start.relaxed)
    push[idle] = 0.0
    mean -= 1.0
    crossing = (_exponential(exponent + slip + push) <= start.relaxed) != idle
    if crossing.any():
        parts = (
            values[crossing]
            for values in (exponent, start.deviation, slip, decay, start.relaxed, idle)
        )
        push[crossing], mean[crossing] = solve_crossing(*parts)
    rise = _limit(m, to_load, start, free + push / m)
    return rise, exponent + (m * rise - start.lift), mean


def _mid_load(
    m: Floats | float, to_load: Floats | float, start: StepStart
) -> tuple[Floats, Floats]:
    """Return decay and free rise, m, by the chord of the flow from no load to that predicted in mid step."""
    grown = middle = _exponential(start.exponent)
    alone = start.rises(0.0)
    free = alone.sum(axis=0)
    slip = m * free - start.lift
    for _ in range(2):
        load = to_load * np.maximum(middle - start.relaxed, 0.0)
        # A pin that is still to meet the fingertip stops at the pressure that drives it.
        load = np.where(start.idle, np.minimum(load, np.abs(start.pressure)), load) + LEAST
        decay = m * to_load * ((alone - start.rises(load)) / load).sum(axis=0) + TINY
        push, _ = _press(start.exponent, slip, decay, start.relaxed)
        change = np.where(grown > start.relaxed, slip + push, slip)
        middle = 0.5 * (grown + _exponential(start.exponent + change))
    return decay, free


def _press(exponent: Floats, slip: Floats, decay: Floats, relaxed: Floats) -> tuple[Floats, Floats]:
    """Return the change of e by the load, and the mean of exp(e), of cells that stay under load."""
    return solve_carefully(exponent, replace_zeros(slip + decay * relaxed), slip, decay, relaxed)


def _limit(m: Floats | float, to_load: Floats | float, start: StepStart, rise: Floats) -> Floats:
    """Return a rise, m, limited to the flow of the valve.

    Upwards that is the flow without load, downwards the flow under the largest load; and no finger
    pushes a pin below itself, apart from what the pin falls without load.
    """
    alone = start.rises(0.0)
    highest, fall = np.maximum(alone, 0.0).sum(axis=0), np.minimum(alone, 0.0).sum(axis=0)
    # The fingertip's parabola at its middle and its end.
    middle = 0.5 * start.lift + 1.5 * start.finger_deviation
    deepest = np.maximum(start.exponent - np.minimum(np.minimum(middle, start.lift), 0.0), 0.0)
    most = _exponential(deepest + m * highest)
    pushed = np.minimum(start.rises(to_load * (most - 1.0)), 0.0).sum(axis=0)
    lowest = np.maximum(pushed, fall - deepest / m)
    return np.minimum(np.maximum(rise, lowest), highest)


def _exponential(exponent: Floats) -> Floats:
    """Return exp(e); 1 in a gap."""
    return np.exp(np.minimum(np.maximum(exponent, 0.0), LARGEST_EXPONENT))
