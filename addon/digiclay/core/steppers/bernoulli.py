"""The closed-form step: exact for an exponential spring behind a linear flow resistance.

With the valve's conductance, the relaxed force S and the finger's speed v frozen over a
step, u = exp(-m (x - x0)) obeys the linear equation ``du/dt = β - κ u``: a Bernoulli
equation for the indentation x. It is solved exactly, so the step is stable at any length;
freezing at mid step makes it second order. Where no force acts the cell moves freely, and
a cell that meets or leaves the finger within the step does so at the exact instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contact import LARGEST_EXPONENT, Contact
from ..physics import Cell, mean_mobility
from ..touch import Touch

__all__ = ["BernoulliExponential"]

Floats = NDArray[np.float64]

#: Above this exponent sums are done on logarithms.
LARGE = 300.0
TINY = 1e-300
ALL_BUT_GONE = float(np.nextafter(-1.0, 0.0))


@dataclass(frozen=True)
class BernoulliExponential:
    """Second order, stable at any step and stiffness, without iteration."""

    name = "bernoulli"
    order = 2
    nodes = (0.0, 1.0)

    def advance(self, cell: Cell, y: Floats, under: Floats, command: Floats, step: float) -> None:
        """Move a block of cells on by one step, in place.

        Parameters
        ----------
        cell : Cell
        y : ndarray (r, n)
            State rows, see `physics.Cell`.
        under : ndarray (2, k)
            Underside of the finger over the first k cells at the start and the end, m.
        command : ndarray (n,)
            Held valve commands.
        step : float
            Length of the step, s.
        """
        lag = y[cell.lag_rows]
        mobility, drive = mean_mobility(cell, lag, command, step)
        rise = step * drive
        k = under.shape[1]
        if cell.touch and k:
            rise[:k] = _pressed(cell, cell.touch, y[:, :k], under, mobility[:k], drive[:k], command[:k], step)
        y[0] += rise
        np.clip(y[0], 0.0, cell.actuator.stroke, out=y[0])
        cell.lag.advance(lag, command, step)


def _pressed(
    cell: Cell, touch: Touch, y: Floats, under: Floats, mobility: Floats, drive: Floats, command: Floats, step: float
) -> Floats:
    """Return how far cells under the finger rise in a step, m, and move their pulp on."""
    contact, pulp, filters = touch.contact, touch.pulp, y[cell.pulp_rows]
    depth, lift = y[0] - under[0], under[1] - under[0]
    first = contact.tension(depth)
    relaxed = pulp.halfway(filters, first, step)
    to_load = contact.share / cell.actuator.area
    # The largest pressure at which every flow in sight is still laminar.
    laminar = cell.flow.knee - max(abs(cell.supply.high), abs(cell.supply.low))

    def averaged(tension: Floats) -> tuple[Floats, Floats]:
        load = to_load * np.maximum(tension - relaxed, 0.0)
        return mean_mobility(cell, y[cell.lag_rows], command, step, load)

    if to_load * first.max() > laminar:
        mobility, drive = averaged(first)
    rise, mean = _closed_form(contact, depth, lift, relaxed, to_load * mobility, drive, step)
    last = contact.tension(depth + rise - lift)
    if to_load * max(first.max(), last.max()) > laminar:
        mobility, drive = averaged(0.5 * (first + last))
        rise, mean = _closed_form(contact, depth, lift, relaxed, to_load * mobility, drive, step)
    end = np.clip(y[0] + rise, 0.0, cell.actuator.stroke)
    pulp.advance(filters, mean, first, contact.tension(end - under[1]), step)
    return rise


def _closed_form(
    contact: Contact, depth: Floats, lift: Floats, relaxed: Floats, gain: Floats, drive: Floats, step: float
) -> tuple[Floats, Floats]:
    """Solve the frozen equation over a step.

    Parameters
    ----------
    contact : Contact
    depth : ndarray (k,)
        Indentation at the start, m; negative where there is a gap.
    lift : ndarray (k,)
        How far the finger's underside rises in the step, m.
    relaxed : ndarray (k,)
        Frozen force S lost to relaxation, N.
    gain : ndarray (k,)
        Speed lost a newton of elastic force, m/(s N).
    drive : ndarray (k,)
        Speed without load, m/s.
    step : float
        s.

    Returns
    -------
    rise : ndarray (k,)
        m.
    mean : ndarray (k,)
        Elastic force T averaged over the step, N.
    """
    m, b = contact.exponent, contact.stiffness
    pulp = m / b * relaxed
    threshold = contact.offset + np.log1p(pulp) / m
    free, decay = step * drive, (b * step) * gain
    growth = m * (free - lift) + decay * (1.0 + pulp)
    relief, spring = _relief(np.maximum(depth - contact.offset, 0.0) * m, growth, decay)
    loaded = depth > threshold
    rise = free + np.where(loaded, (decay * (1.0 + pulp) - relief) / m, 0.0)
    end = depth + rise - lift
    mean = np.where(loaded, (b / m) * (spring - 1.0), 0.5 * (contact.tension(depth) + contact.tension(end)))
    crossing = np.flatnonzero(loaded != (end > threshold))
    if crossing.size:
        known = (np.broadcast_to(a, depth.shape)[crossing] for a in (depth, lift, pulp, free, decay, growth))
        rise[crossing], mean[crossing] = _crossed(contact, *known)
    return rise, mean


def _crossed(
    contact: Contact, depth: Floats, lift: Floats, pulp: Floats, free: Floats, decay: Floats, growth: Floats
) -> tuple[Floats, Floats]:
    """Solve for cells that meet or leave the finger within the step: part of it loaded, part of it free."""
    m, b = contact.exponent, contact.stiffness
    threshold = contact.offset + np.log1p(pulp) / m
    way, slip = threshold - depth, free - lift
    meets = way >= 0.0
    # Leaving: u has grown from its start to 1/(1 + pulp); what is asked is when.
    shrunk = np.expm1(np.minimum(m * way, 0.0)) / (m * np.where(slip == 0.0, TINY, slip))
    leaving = np.log1p(np.maximum(growth * shrunk, ALL_BUT_GONE)) / np.where(growth == 0.0, TINY, growth)
    share = np.where(meets, 1.0 - way / np.where(slip == 0.0, TINY, slip), np.where(growth == 0.0, shrunk, leaving))
    share = np.clip(share, 0.0, 1.0)
    start = np.maximum(depth, threshold)
    relief, spring = _relief((start - contact.offset) * m, share * growth, share * decay)
    rise = free + np.where(meets, (share * decay * (1.0 + pulp) - relief) / m, way - share * slip)
    outside = contact.tension(np.where(meets, depth, depth + rise - lift))
    mean = share * (b / m) * (spring - 1.0) + (1.0 - share) * 0.5 * (b / m * pulp + outside)
    return rise, mean


def _relief(exponent: Floats, growth: Floats, decay: Floats) -> tuple[Floats, Floats]:
    """Solve ``du/ds = decay - growth u``, u = exp(-exponent) at s = 0, up to s = 1.

    Returns
    -------
    relief : ndarray (k,)
        ``log(1 + q)``, with which ``u(1) = exp(relief - growth - exponent)``;
        ``q = decay exp(exponent) φ(growth)``, ``φ(y) = (exp(y) - 1)/y``.
    mean : ndarray (k,)
        Mean of 1/u over s, ``exp(exponent) φ log(1 + q)/q``.
    """
    growth = np.where(np.abs(growth) < TINY, TINY, growth)
    if max(exponent.max(), growth.max()) < LARGE:
        grown = np.exp(exponent) * (np.expm1(growth) / growth)
        q = np.maximum(decay * grown, TINY)
        relief = np.log1p(q)
        return relief, grown * (relief / q)
    size = np.abs(growth)
    log_grown = exponent + np.maximum(growth, 0.0) + np.log(-np.expm1(-size) / size)
    log_q = np.log(np.maximum(decay, TINY)) + log_grown
    relief = np.logaddexp(0.0, log_q)
    # Where q is below rounding, log(1 + q) is q.
    log_mean = log_grown + np.where(log_q < -36.0, 0.0, np.log(np.maximum(relief, TINY)) - log_q)
    return relief, np.exp(np.minimum(log_mean, LARGEST_EXPONENT))
