"""Continuous physics of one cell, in the order of the paper: from touch to flow to motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats
from .actuator import Actuator, Supply
from .interfaces import Flow, Lag
from .touch import Touch, compute_force, relax_force

#: Two-point Gauss-Legendre nodes on [0, 1]: means over a step are exact for cubics.
GAUSS = (0.5 - 3.0**0.5 / 6.0, 0.5 + 3.0**0.5 / 6.0)


@dataclass(frozen=True, eq=False)
class Cell:
    """Parts of every cell.

    A block of n cells has state rows ``y`` of shape (r, n): height, m; the pulp's rows (used
    for the first k cells, which the fingertip may touch); the lag's rows.
    """

    actuator: Actuator
    flow: Flow
    supply: Supply
    lag: Lag
    touch: Touch | None

    @cached_property
    def lag_rows(self) -> slice[int, int, None]:
        """Rows of ``y`` of the valve lag."""
        first = self.pulp_rows.stop
        return slice(first, first + self.lag.rows)

    @cached_property
    def pulp_rows(self) -> slice[int, int, None]:
        """Rows of ``y`` of the relaxation."""
        return slice(1, 1 + (self.touch.pulp.rows if self.touch else 0))

    @cached_property
    def rows(self) -> int:
        """State rows per cell."""
        return self.pulp_rows.stop + self.lag.rows


@dataclass(frozen=True, eq=False)
class Speeds:
    """Speeds of a pin without load behind a fully open valve, m/s."""

    fall: Floats | float
    rise: Floats | float
    """Its velocities downwards, at most 0, and upwards, at least 0; a number or (b,)."""

    def reach(self, height: Floats, under: Floats, time: Floats | float) -> tuple[Floats, Floats]:
        """Return the lowest and the highest possible heights of pins after a time, (n, ..), m.

        A fingertip pushes a pin at most to its own underside, (p, k, ..), m, and a pin that is not
        pushed is no faster than its valve permits.
        """
        lowest = height.copy()
        near = lowest[: under.shape[1]]
        np.minimum(near, under.min(axis=0), out=near)
        lowest += time * self.fall
        return lowest, height + time * self.rise


def find_speeds(cell: Cell) -> Speeds:
    """Return the largest speeds of a pin without load."""
    openings = np.array([-1.0, 1.0])
    speeds = cell.flow.flow(openings, cell.supply.pressure(openings)) / cell.actuator.area
    return Speeds(min(float(speeds.min()), 0.0), max(float(speeds.max()), 0.0))


def find_contact_force(cell: Cell, y: Floats, under: Floats) -> Floats:
    """Return the force of undersides (k,), m, on the first k cells with rows y (r, n), shape (k,), N."""
    if cell.touch is None:
        return np.empty(0)
    return compute_force(cell.touch, y[0, : under.size], under, y[cell.pulp_rows, : under.size])


def compute_rates(cell: Cell, y: Floats, under: Floats, command: Floats) -> Floats:
    """Return dy/dt of rows y (r, n) under undersides (k,), m, and held valve commands (n,)."""
    height, lag, pulp, near = y[0], y[cell.lag_rows], y[cell.pulp_rows], under.size
    change = np.zeros_like(y) if len(pulp) else np.empty_like(y)
    opening = cell.lag.opening(lag, command)
    drop: Floats = cell.supply.pressure(opening)
    if cell.touch and near:
        tension = cell.touch.contact.tension(height[:near] - under)
        if len(pulp):
            change[cell.pulp_rows, :near] = cell.touch.pulp.rate(pulp[:, :near], tension)
        # The pressure of the reservoir may be one number for all pins.
        load = np.zeros(height.shape)
        load[:near] = cell.actuator.pressure(relax_force(cell.touch, tension, pulp[:, :near]))
        drop = drop - load
    # If no drop reaches the knee, all flow is laminar, and a third of the time is enough.
    laminar = drop.size > 0 and -cell.flow.knee < drop.min() and drop.max() < cell.flow.knee
    conductance = (
        cell.flow.laminar_conductance(opening) if laminar else cell.flow.conductance(opening, drop)
    )
    change[0] = cell.actuator.rate(conductance * drop, height)
    change[cell.lag_rows] = cell.lag.rate(lag, command)
    return change
