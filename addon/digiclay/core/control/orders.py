"""Orders to the valves beside the control method: what brushes do to pins without a finger.

An order is a row of five numbers a control period: x, y and radius of a disc, m, a strength, and a `Verb`.

SMOOTH
    The commanded heights spread, ``dh/dt = ∇(w D ∇h)`` with ``D = strength r² / T``, and weights w from 1 in
    the middle of the disc to 0 at its rim: of two neighbors the lesser. So clay is moved and none is lost; no
    cell leaves the range of its neighbors, so that nothing swings; and cells outside the disc stay.
AVERAGE
    What smoothed before there was SMOOTH, for takes of that time: ``dh = w D ∇²h T_c``, where the greater of
    what rises and what sinks is scaled down to the other.
ERASE
    The commanded heights go back to rest with these weights, ``dh/dt = w strength (h_rest - h) / T``.
LOCK, UNLOCK, INVERT
    Pins in the disc get or lose the mode LOCKED, or change over: valve shut, whatever anything commands.
PLACE
    Pins go to the heights of a surface, the one of the number in column x; NaN is a pin that is left alone.

Of what has weights a strength of 0 changes no height more, and drives on those pins that have not arrived.
A radius of 0 is no order, but for PLACE: the method is on its own. Driven pins are in the mode BLISTER until
they have arrived.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..base.arrays import Flags, Floats, any_true
from ..base.modes import Mode
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Controller, Measurement, Memory
from ..model.layout import Disc, Grid, add_disc, widen_disc
from ..model.null_parts import Uncontrolled
from ..model.physics import Cell
from .drive import Drive, DriveParameters, make_drive
from .exchange import Exchange, make_exchange
from .servo import mark_formed
from .travel import measure_square

#: Numbers of an order.
ORDER = 5
#: How long strength 1 takes, s, to spread heights over the radius, SMOOTH and AVERAGE, and to erase all
#: but 1/e. At 100 mm/s one pass of SMOOTH leaves 15 to 45 % of what varies on the beds of `settings.devices`.
SPREADING, AVERAGING, ERASING = 0.25, 1.0, 5e-3
#: How far the neighbors of a cell are at most, in pitches or distances of rows: 1.12 where rows are shifted.
MARGIN = 1.5
#: Least radius of an order, m, the farthest number in one, m, and the largest strength.
SMALLEST, FARTHEST, STRONGEST = 1e-6, 1e3, 100.0
#: Height error that is none where pins are erased or placed, m: they stand within 1 µm.
BAND = 0.5e-6


class Verb(IntEnum):
    """What an order does."""

    AVERAGE = 0
    SMOOTH = 1
    ERASE = 2
    LOCK = 3
    UNLOCK = 4
    INVERT = 5
    PLACE = 6


LOCKING = (Verb.LOCK, Verb.UNLOCK, Verb.INVERT)


@dataclass(frozen=True, eq=False)
class Orders:
    """Orders of t control periods."""

    rows: Floats
    """(t, 5): x, y, radius, strength and verb in each."""
    surfaces: tuple[Floats, ...] = ()
    """(n,) each: Heights of pins, m; NaN: not driven."""

    def __len__(self) -> int:
        """Return the number of control periods."""
        return len(self.rows)

    @property
    def given(self) -> bool:
        """Whether there is an order in any period."""
        return bool(self.rows.any())


def repeat_order(
    periods: int, verb: Verb, x: float = 0.0, y: float = 0.0, radius: float = 0.0, strength: float = 0.0
) -> Floats:
    """Return the rows (t, 5) of one order in so many periods."""
    return np.tile((x, y, radius, strength, float(verb)), (periods, 1))


def place(periods: int, surface: Floats) -> Orders:
    """Return the orders that drive pins to a surface (n,), m, NaN: not driven, for so many periods."""
    return Orders(repeat_order(periods, Verb.PLACE), (surface,))


def add_verbs(rows: Floats) -> Floats:
    """Return orders (t, 5) of rows (t, 4) without verbs: all of them average."""
    return np.column_stack([rows, np.zeros(len(rows))])


@dataclass(frozen=True, eq=False)
class Around:
    """Controller around the method's, whose memory it has.

    Cells remember nothing of it: after any period the method alone can continue the session.
    """

    method: Controller

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.method.rows

    def begin(self) -> Memory:
        """Return the memory before a session."""
        return self.method.begin()


@dataclass(frozen=True, eq=False)
class DrivingControl(Around):
    """Controller of one control period with an order: the method's, but for the cells the valves drive."""

    free: bool
    """Whether the bed has no method."""
    drive: Drive
    actuator: Actuator
    reach: Disc
    """Cells to be driven, and those whose heights that takes, m."""

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Request the order's disc, and the method's; see `Controller`."""
        memory, disc = self.method.locate(memory, touched)
        return memory, add_disc(disc, self.reach)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Drive the pins of the order, and those still on their way; the method commands all others."""
        moved = seen.mode == Mode.BLISTER
        memory, orders = self.method.command(memory, seen)
        if self.free:
            # What has arrived holds: no method takes it over.
            orders = orders._replace(mode=np.where(moved, np.int8(Mode.HOLD), seen.mode))
        target, driven, busy = self.aim(seen)
        # What the method moves itself, as part of its blister, is not on its way from an order.
        own = driven | (moved & (orders.mode <= Mode.HOLD))
        error, band = target - seen.height, self.drive.dead_band
        # An error within the dead band of what is placed may be one of what forms pins.
        mode = mark_formed(target, self.actuator.rest_height, max(band, DriveParameters().dead_band))
        np.putmask(mode, busy | (np.abs(error) > band), np.int8(Mode.BLISTER))
        command = self.drive.command(self.drive.approach(error), seen.force)
        np.copyto(target, orders.target, where=~own)
        np.copyto(mode, orders.mode, where=~own)
        np.copyto(command, orders.command, where=~own)
        return memory, Commands(target, mode, command)

    def aim(self, seen: Measurement) -> tuple[Floats, Flags, Flags]:
        """Return new commanded heights, (m,), m, which pins are driven there, and which are under a brush."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class BrushControl(DrivingControl):
    """Controller of a control period in which the pins of a disc change with weights."""

    disc: Disc
    strength: float

    def aim(self, seen: Measurement) -> tuple[Floats, Flags, Flags]:
        """See `DrivingControl`."""
        weight = self._weigh(seen)
        under = weight > 0.0
        return (self.change(seen, weight) if any_true(under) else seen.target.copy()), under, under

    def _weigh(self, seen: Measurement) -> Floats:
        """Return the weights of cells, (m,): 1 in the disc's middle, falling smoothly to 0 at its rim."""
        x, y, radius = self.disc
        if self.strength == 0.0:
            return np.zeros(seen.height.size)
        left: Floats = np.maximum(1.0 - measure_square(x, y, seen.quadratic_basis) / radius**2, 0.0)
        np.putmask(left, seen.mode == Mode.LOCKED, 0.0)
        return left * left

    def change(self, seen: Measurement, weight: Floats) -> Floats:
        """Return the commanded heights after the period, (m,), m; some weight (m,) is not 0."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class SmoothingControl(BrushControl):
    """Controller of a control period in which a disc is smoothed."""

    exchange: Exchange
    """Of the commanded heights, in one period."""

    def change(self, seen: Measurement, weight: Floats) -> Floats:
        """See `BrushControl`."""
        return self.exchange.even_out(seen.cells, seen.target, weight)


@dataclass(frozen=True, eq=False)
class AveragingControl(SmoothingControl):
    """Controller of a control period in which a disc is averaged."""

    def change(self, seen: Measurement, weight: Floats) -> Floats:
        """See `BrushControl`."""
        change = weight * (self.exchange.even_out(seen.cells, seen.target) - seen.target)
        rise, fall = np.maximum(change, 0.0), np.maximum(-change, 0.0)
        risen, fallen = float(rise.sum()), float(fall.sum())
        same = min(risen, fallen)
        return seen.target + (rise * (same / risen) - fall * (same / fallen) if same > 0.0 else 0.0)


@dataclass(frozen=True, eq=False)
class ErasingControl(BrushControl):
    """Controller of a control period in which the pins of a disc go back to rest."""

    rate: float
    """Of what is left, in one period."""

    def change(self, seen: Measurement, weight: Floats) -> Floats:
        """See `BrushControl`."""
        left = (seen.target - self.actuator.rest_height) * np.exp(-self.rate * weight)
        np.putmask(left, (weight > 0.0) & (np.abs(left) <= self.drive.dead_band), 0.0)
        return np.where(weight > 0.0, self.actuator.rest_height + left, seen.target)


@dataclass(frozen=True, eq=False)
class PlacingControl(DrivingControl):
    """Controller of a control period in which pins go to the heights of a surface (n,), m."""

    surface: Floats

    def aim(self, seen: Measurement) -> tuple[Floats, Flags, Flags]:
        """See `DrivingControl`."""
        goal = self.surface.take(seen.cells)
        driven = ~np.isnan(goal) & (seen.mode != Mode.LOCKED)
        return np.where(driven, goal, seen.target), driven, np.zeros_like(driven)


@dataclass(frozen=True, eq=False)
class LockingControl(Around):
    """Controller of a bed with locked pins: the method's, which takes them for pins that hold or rest.

    A locked pin is commanded to where it is, so that it stays there when it is unlocked.
    """

    actuator: Actuator
    verb: Verb
    disc: Disc | None = None
    """Pins to be locked or unlocked; None: the locked ones stay as they are."""

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Request the disc, and the method's; see `Controller`."""
        memory, disc = self.method.locate(memory, self._mask(touched))
        return memory, disc if self.disc is None else add_disc(disc, self.disc)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Shut the valves of locked pins; the method commands all others. See `Controller`."""
        locked = self._choose(seen)
        memory, orders = self.method.command(memory, self._mask(seen))
        if not any_true(locked):
            return memory, orders
        target = np.where(locked, seen.height, orders.target)
        mode = np.where(locked, np.int8(Mode.LOCKED), orders.mode)
        return memory, Commands(target, mode, np.where(locked, 0.0, orders.command))

    def _choose(self, seen: Measurement) -> Flags:
        """Return which pins are locked after the period, (m,)."""
        locked: Flags = seen.mode == Mode.LOCKED
        if self.disc is None:
            return locked
        x, y, radius = self.disc
        inside = measure_square(x, y, seen.quadratic_basis) <= radius**2
        if self.verb is Verb.INVERT:
            return locked ^ inside
        return locked | inside if self.verb is Verb.LOCK else locked & ~inside

    def _mask(self, seen: Measurement) -> Measurement:
        """Return what a method sees that knows no locks."""
        locked = seen.mode == Mode.LOCKED
        if not any_true(locked):
            return seen
        formed = mark_formed(seen.target, self.actuator.rest_height, DriveParameters().dead_band)
        return seen._replace(mode=np.where(locked, formed, seen.mode))


def order_periods(
    method: Controller,
    grid: Grid,
    cell: Cell,
    period: float,
    orders: Orders,
    latency: float = 0.0,
    floor: float = 0.0,
    *,
    locked: bool = False,
) -> Iterator[Controller]:
    """Yield the controller of each control period, s.

    `latency`: from a command to what is measured of it, s; `floor`: distance from which on a height that is
    read is not the true one, m; `locked`: whether pins are locked at the start.
    """
    quick, plan = 2.0 * period, grid.layout
    # As quick as a display is, and never quicker than the control period allows.
    drive = make_drive(DriveParameters(max(DriveParameters().settling_time, quick)), cell, period)
    # A loop of the gain 1/T swings below T = e times its dead time; a control period adds half of its own.
    settling = max(quick, math.e * (latency + 0.5 * period))
    exact = make_drive(DriveParameters(settling, max(BAND, floor)), cell, period)
    margin, free = MARGIN * max(plan.pitch, plan.row_spacing), isinstance(method, Uncontrolled)
    circles: dict[int, Disc | None] = {}
    held: Controller = method
    for x, y, radius, strength, number in orders.rows.tolist():
        verb, disc = Verb(int(number)), (x, y, radius)
        locked |= radius > 0.0 and verb in LOCKING
        held = LockingControl(method, cell.actuator, verb) if locked else method
        if verb is Verb.PLACE:
            surface = orders.surfaces[int(x)]
            if int(x) not in circles:
                driven = grid.enclose(np.flatnonzero(~np.isnan(surface)))
                circles[int(x)] = widen_disc(driven, 0.1 * plan.pitch)
            circle = circles[int(x)]
            yield PlacingControl(held, free, exact, cell.actuator, circle, surface) if circle else held
        elif radius == 0.0:
            yield held
        elif verb in LOCKING:
            yield LockingControl(method, cell.actuator, verb, disc)
        elif verb is Verb.ERASE:
            rate = strength * period / ERASING
            yield ErasingControl(held, free, exact, cell.actuator, disc, disc, strength, rate)
        else:
            kind, time = (
                (SmoothingControl, SPREADING) if verb is Verb.SMOOTH else (AveragingControl, AVERAGING)
            )
            exchange = make_exchange(grid, strength * radius**2 / time, period)
            reach = (x, y, radius + margin)
            yield kind(held, free, drive, cell.actuator, reach, disc, strength, exchange)


def find_fault(orders: Orders, periods: int, pins: int, stroke: float) -> str:
    """Return what is wrong with orders for so many periods, pins and a stroke, m; empty when nothing is."""
    rows = orders.rows
    if rows.shape != (periods, ORDER) or rows.dtype != np.float64:
        return f"an array of the shape {rows.shape} of {rows.dtype}"
    x, _, radius, strength, verb = rows.T
    good = (np.abs(rows) <= FARTHEST).all(axis=1) & ((radius == 0.0) | (radius >= SMALLEST))
    good &= (strength >= 0.0) & (strength <= STRONGEST) & np.isin(verb, list(Verb))
    good &= (verb != Verb.PLACE) | np.isin(x, np.arange(len(orders.surfaces)))
    if not good.all():
        return f"row {int(good.argmin())} is {rows[good.argmin()].tolist()}"
    for number, surface in enumerate(orders.surfaces):
        if surface.shape != (pins,) or surface.dtype != np.float64:
            return f"surface {number} is an array of the shape {surface.shape} of {surface.dtype}"
        wrong = surface[~(np.isnan(surface) | ((surface >= 0.0) & (surface <= stroke)))]
        if wrong.size:
            return f"surface {number} has the height {wrong[0]:g} m"
    return ""
