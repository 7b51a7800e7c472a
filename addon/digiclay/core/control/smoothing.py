"""Smoothing of the displayed heights in a disc of the bed, beside the control method.

In each control period the commanded heights of the disc's cells come nearer to the mean of their neighbors',
``dh = w D ∇²h T_c`` with weights w from 1 in the middle of the disc to 0 at its rim, and the valves drive the
pins there, no faster than pins rise and sink. What rises and what sinks in the disc are made equal: the
greater of the two is scaled down. So clay is moved and none is lost; no cell leaves the range of its
neighbors, so that nothing swings; the sum of squared differences of neighbors only falls; and cells outside
the disc stay.

A period's order is a row of four numbers: the disc's x, y and radius, m, and the strength. A strength of 0
averages nothing more, and drives on those pins that have not arrived. A radius of 0 is no order: the control
method is on its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Floats
from ..base.modes import Mode
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Controller, Measurement
from ..model.layout import Disc, Grid, enclose_discs
from ..model.null_parts import Uncontrolled
from ..model.physics import Cell
from .drive import Drive, DriveParameters, make_drive
from .exchange import Exchange, make_exchange
from .travel import measure_square

#: Numbers of an order.
ORDER = 4
#: How long the diffusion of strength 1 takes to spread over the disc's radius, ``D = r² / T``, s.
SPREADING = 1.0
#: How far the neighbors of a cell are at most, in pitches or distances of rows: 1.12 where rows are shifted.
MARGIN = 1.5
#: Least radius of an order, m, and the farthest number in one, m.
SMALLEST, FARTHEST = 1e-6, 1e3


@dataclass(frozen=True, eq=False)
class SmoothingControl:
    """Controller of one control period with an order: the method's, but for the cells that are smoothed.

    Its memory is the method's, and its cells remember nothing of their own: one that is smoothed, or has not
    arrived yet, is in the mode BLISTER. After any period the method alone can continue the session.
    """

    method: Controller
    drive: Drive
    exchange: Exchange
    """Of the commanded heights, in one period."""
    actuator: Actuator
    disc: Disc
    reach: Disc
    """Cells to be smoothed, and these with their neighbors, m."""
    strength: float
    """From 0 to 1."""

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.method.rows

    def begin(self) -> Any:
        """Return the memory before a session."""
        return self.method.begin()

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, Disc | None]:
        """Request the disc and the neighbors of its cells, and the method's disc; see `Controller`."""
        memory, disc = self.method.locate(memory, touched)
        return memory, self.reach if disc is None else enclose_discs(disc, self.reach)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Smooth, and drive the pins there; the method commands all others. See `Controller`."""
        moved = seen.mode == Mode.BLISTER
        memory, orders = self.method.command(memory, seen)
        if isinstance(self.method, Uncontrolled):
            # What has arrived holds: no method takes it over.
            orders = orders._replace(mode=np.where(moved, np.int8(Mode.HOLD), seen.mode))
        weight = self._weigh(seen)
        # What the method moves itself, as part of its blister, is not on its way from a disc.
        own = (weight > 0.0) | (moved & (orders.mode <= Mode.HOLD))
        target = self._smooth(seen, weight)
        error, band = target - seen.height, self.drive.dead_band
        mode = self.drive.mark_formed(target, self.actuator.rest_height)
        np.putmask(mode, (weight > 0.0) | (np.abs(error) > band), np.int8(Mode.BLISTER))
        command = self.drive.command(self.drive.approach(error), seen.force)
        np.copyto(target, orders.target, where=~own)
        np.copyto(mode, orders.mode, where=~own)
        np.copyto(command, orders.command, where=~own)
        return memory, Commands(target, mode, command)

    def _weigh(self, seen: Measurement) -> Floats:
        """Return the weights of cells, (m,): 1 in the disc's middle, falling smoothly to 0 at its rim."""
        x, y, radius = self.disc
        if self.strength == 0.0:
            return np.zeros(seen.height.size)
        left: Floats = np.maximum(1.0 - measure_square(x, y, seen.quadratic_basis) / radius**2, 0.0)
        return left * left

    def _smooth(self, seen: Measurement, weight: Floats) -> Floats:
        """Return the commanded heights after the period, (m,), m."""
        if not weight.any():
            return seen.target.copy()
        change = weight * (self.exchange.even_out(seen.cells, seen.target) - seen.target)
        rise, fall = np.maximum(change, 0.0), np.maximum(-change, 0.0)
        risen, fallen = float(rise.sum()), float(fall.sum())
        same = min(risen, fallen)
        return seen.target + (rise * (same / risen) - fall * (same / fallen) if same > 0.0 else 0.0)


def order_periods(
    method: Controller, grid: Grid, cell: Cell, period: float, orders: Floats
) -> Iterator[Controller]:
    """Yield the controller of each control period, s, by its row of orders (t, 4)."""
    # As quick as a display is, and never quicker than the control period allows.
    parameters = DriveParameters(settling_time=max(DriveParameters().settling_time, 2.0 * period))
    drive = make_drive(parameters, cell, period)
    margin = MARGIN * max(grid.layout.pitch, grid.layout.row_spacing)
    for x, y, radius, strength in orders.tolist():
        if radius == 0.0:
            yield method
            continue
        exchange = make_exchange(grid, strength * radius**2 / SPREADING, period)
        disc, reach = (x, y, radius), (x, y, radius + margin)
        yield SmoothingControl(method, drive, exchange, cell.actuator, disc, reach, strength)


def find_fault(orders: Floats, periods: int) -> str:
    """Return what is wrong with orders for so many periods; empty when nothing is. `orders` (t, 4)."""
    if orders.shape != (periods, ORDER) or orders.dtype != np.float64:
        return f"an array of the shape {orders.shape} of {orders.dtype}"
    radius, strength = orders[:, 2], orders[:, 3]
    good = (np.abs(orders) <= FARTHEST).all(axis=1) & ((radius == 0.0) | (radius >= SMALLEST))
    good &= (strength >= 0.0) & (strength <= 1.0)
    return "" if good.all() else f"row {int(good.argmin())} is {orders[good.argmin()].tolist()}"
