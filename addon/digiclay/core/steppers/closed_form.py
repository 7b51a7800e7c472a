"""Exact solution of a loaded cell's equation over a step with frozen coefficients.

An exponential spring behind a linear flow resistance. All is dimensionless: the exponent
``e = m (x - x0)`` of the indentation x, time s in steps (0 to 1). While the finger presses,

    de/ds = slip + decay (pulp - exp(e)),

where `slip` is m times the way the pin and the finger approach without load, `decay` the
hydraulic stiffness, and ``pulp = 1 + S m/b`` the exponent at which the relaxed pulp begins
to push. ``u = exp(-e)`` obeys the linear equation ``du/ds = decay - growth u`` with
``growth = slip + decay pulp``: a Bernoulli equation. Where no force acts, ``de/ds = slip``.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import Floats

#: Above this exponent sums have to be done on logarithms: `solve_carefully` instead of `solve_pressed`.
LARGE = 300.0
#: Replaces zero in 0/0 limits.
TINY = 1e-200
#: Below this logarithm log(1 + q) is q, to the last bit.
_ROUNDED_AWAY = -36.8
#: Stands for zero where a way so short is divided by, and what comes of it is multiplied by a growth.
_STILL = 1e-100
_ALL_BUT_GONE = float(np.nextafter(-1.0, 0.0))


def solve_pressed(grown: Floats, growth: Floats, decay: Floats) -> Floats:
    """Return the relief of cells that stay under load: ``e(1) - e(0) = growth - relief``.

    `grown` (k,), ``exp(e(0))``; `growth`, `decay` (k,), neither may be zero (`TINY` will do); neither
    exponent may pass `LARGE`. Returns (k,), ``log(1 + q)``, ``q = decay exp(e) (exp(growth) - 1)/growth``.
    The mean of exp(e) over the step is relief / decay.
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
    """Return the load's part of the way, and the mean of exp(e), of cells that stay under load, at any size.

    `exponent` (k,), e(0); `growth`, `slip`, `decay`, `pulp` (k,), see the module; `decay` not below `TINY`,
    `growth` not zero (`TINY` will do). Returns `push` (k,), ``e(1) - e(0) - slip``, never above 0 where e(0)
    is above ``log(pulp)``; `mean` (k,).
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
        # Relief and growth are both so large that their difference has lost its digits: e(1) without them.
        after = np.minimum(growth, 0.0) - np.logaddexp(-np.maximum(growth, 0.0), log_decay + exponent + part)
        np.putmask(push, vast, after - slip)
        lasting = vast & (log_q >= _ROUNDED_AWAY)
        np.putmask(log_mean, lasting, np.log(np.maximum(relief, TINY)) - log_decay)
    return push, np.exp(np.minimum(log_mean, LARGE))


def solve_crossing(
    exponent: Floats, deviation: Floats, slip: Floats, decay: Floats, pulp: Floats
) -> tuple[Floats, Floats]:
    """Solve for cells that meet or leave the finger within the step.

    `exponent`, `slip`, `decay`, `pulp` (k,), see the module. Below ``log(pulp)`` at the start means meeting,
    above it leaving; `deviation` (k,), chord deviation of the path without load: its mean above the straight
    line between its ends. Returns `push` (k,), ``e(1) - e(0) - slip``, the load's part; the instant of
    meeting or leaving is found exactly on a straight way, and to second order on a bent one; `mean` (k,),
    mean of ``max(exp(e) - 1, 0)``.
    """
    growth = replace_zeros(slip + decay * pulp)
    slip = np.where(np.abs(slip) < _STILL, _STILL, slip)
    threshold = np.log(pulp)
    share = _loaded_share(threshold - exponent, slip, growth)
    # A parabola's mean height over the loaded part, from its mean over all of it.
    exponent = exponent + deviation * share * (3.0 - 2.0 * share)
    share = _loaded_share(threshold - exponent, slip, growth)
    start = np.maximum(exponent, threshold)
    few = np.maximum(share * decay, TINY)
    push, mean = solve_carefully(start, replace_zeros(share * growth), share * slip, few, pulp)
    # Without load the exponent goes straight, up to the threshold or down from it; below 0 is a gap.
    apart = np.maximum(np.abs((1.0 - share) * slip), TINY)
    closed = np.minimum(apart, np.maximum(threshold, 0.0))
    alone = (pulp * -np.expm1(-closed) - closed) / apart
    return push, share * (mean - 1.0) + (1.0 - share) * alone


def _loaded_share(gap: Floats, slip: Floats, growth: Floats) -> Floats:
    """Return the share of the step in which a cell is loaded; `gap` is the way up to the threshold."""
    # Leaving: u grows from exp(-e(0)) to 1/pulp; the linear equation tells when.
    shrunk = np.expm1(np.minimum(gap, 0.0)) / slip
    leaving = np.log1p(np.maximum(growth * shrunk, _ALL_BUT_GONE)) / growth
    share: Floats = np.clip(np.where(gap >= 0.0, 1.0 - gap / slip, leaving), 0.0, 1.0)
    return share


def replace_zeros(values: Floats) -> Floats:
    """Return `values` with `TINY` for zeros."""
    return np.where(np.abs(values) < TINY, TINY, values)
