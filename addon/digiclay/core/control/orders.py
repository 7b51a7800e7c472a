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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import partial

import numpy as np

from ..base.arrays import Flags, Floats, any_true
from ..base.modes import BLISTER, HOLD, LOCKED
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


#: Returns, of measured cells, new commanded heights, (m,), m, which pins are driven there, and which a brush
#: changes.
Aim = Callable[[Measurement], tuple[Floats, Flags, Flags]]
#: Returns the commanded heights after a period, (m,), m, of measured cells by weights, (m,), not all 0.
Change = Callable[[Measurement, Floats], Floats]


@dataclass(frozen=True, eq=False)
class DrivingControl(Around):
    """Controller of one control period with an order: the method's, but for the cells the valves drive."""

    free: bool
    """Whether the bed has no method."""
    drive: Drive
    actuator: Actuator
    reach: Disc
    """Cells to be driven, and those whose heights that takes, m."""
    aim: Aim

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Request the order's disc, and the method's; see `Controller`."""
        memory, disc = self.method.locate(memory, touched)
        return memory, add_disc(disc, self.reach)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Drive the pins of the order, and those that have not arrived; the method commands all others."""
        moved = seen.mode == BLISTER
        memory, orders = self.method.command(memory, seen)
        if self.free:
            # Pins that have arrived hold: no method takes them over.
            orders = orders._replace(mode=np.where(moved, HOLD, seen.mode))
        target, driven, busy = self.aim(seen)
        # Pins that the method moves as part of its blister are not driven by an order.
        ordered = driven | (moved & (orders.mode <= HOLD))
        error, band = target - seen.height, self.drive.dead_band
        # An error within the dead band of what is placed may be one of what forms pins.
        mode = mark_formed(target, self.actuator.rest_height, max(band, DriveParameters().dead_band))
        np.putmask(mode, busy | (np.abs(error) > band), BLISTER)
        command = self.drive.command(self.drive.approach(error), seen.force)
        np.copyto(target, orders.target, where=~ordered)
        np.copyto(mode, orders.mode, where=~ordered)
        np.copyto(command, orders.command, where=~ordered)
        return memory, Commands(target, mode, command)


def brush(disc: Disc, strength: float, change: Change) -> Aim:
    """Return the aim of a disc whose pins change with weights: 1 in its middle, 0 from its rim on."""
    x, y, radius = disc

    def aim(seen: Measurement) -> tuple[Floats, Flags, Flags]:
        share = np.maximum(1.0 - measure_square(x, y, seen.quadratic_basis) / radius**2, 0.0)
        share[seen.mode == LOCKED] = 0.0
        weight = share * share if strength else np.zeros_like(share)
        under = weight > 0.0
        return (change(seen, weight) if any_true(under) else seen.target.copy()), under, under

    return aim


def smooth(exchange: Exchange, seen: Measurement, weight: Floats) -> Floats:
    """Spread the heights of a disc, see `SMOOTH`; `exchange`: of heights, in one period."""
    return exchange.even_out(seen.cells, seen.target, weight)


def average(exchange: Exchange, seen: Measurement, weight: Floats) -> Floats:
    """Average the heights of a disc, see `AVERAGE`."""
    change = weight * (exchange.even_out(seen.cells, seen.target) - seen.target)
    rise, fall = np.maximum(change, 0.0), np.maximum(-change, 0.0)
    risen, fallen = float(rise.sum()), float(fall.sum())
    same = min(risen, fallen)
    return seen.target + (rise * (same / risen) - fall * (same / fallen) if same > 0.0 else 0.0)


def erase(rate: float, rest: float, band: float, seen: Measurement, weight: Floats) -> Floats:
    """Bring the pins of a disc back to rest, m; `rate`: of the rest in one period, `band`: no height, m."""
    left = (seen.target - rest) * np.exp(-rate * weight)
    np.putmask(left, (weight > 0.0) & (np.abs(left) <= band), 0.0)
    return np.where(weight > 0.0, rest + left, seen.target)


def approach(surface: Floats, seen: Measurement) -> tuple[Floats, Flags, Flags]:
    """Return the aim of pins that go to the heights of a surface (n,), m; see `Aim`."""
    goal = surface.take(seen.cells)
    driven = ~np.isnan(goal) & (seen.mode != LOCKED)
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
        mode = np.where(locked, LOCKED, orders.mode)
        return memory, Commands(target, mode, np.where(locked, 0.0, orders.command))

    def _choose(self, seen: Measurement) -> Flags:
        """Return which pins are locked after the period, (m,)."""
        locked: Flags = seen.mode == LOCKED
        if self.disc is None:
            return locked
        x, y, radius = self.disc
        inside = measure_square(x, y, seen.quadratic_basis) <= radius**2
        if self.verb is Verb.INVERT:
            return locked ^ inside
        return locked | inside if self.verb is Verb.LOCK else locked & ~inside

    def _mask(self, seen: Measurement) -> Measurement:
        """Return what a method sees that knows no locks."""
        locked = seen.mode == LOCKED
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
    actuator, held = cell.actuator, method
    for x, y, radius, strength, number in orders.rows.tolist():
        verb, disc = Verb(int(number)), (x, y, radius)
        locked |= radius > 0.0 and verb in LOCKING
        held = LockingControl(method, actuator, verb) if locked else method
        if verb is Verb.PLACE:
            surface = orders.surfaces[int(x)]
            if int(x) not in circles:
                driven = grid.enclose(np.flatnonzero(~np.isnan(surface)))
                circles[int(x)] = widen_disc(driven, 0.1 * plan.pitch)
            circle, goal = circles[int(x)], partial(approach, surface)
            yield DrivingControl(held, free, exact, actuator, circle, goal) if circle else held
        elif radius == 0.0:
            yield held
        elif verb in LOCKING:
            yield LockingControl(method, actuator, verb, disc)
        elif verb is Verb.ERASE:
            change = partial(erase, strength * period / ERASING, actuator.rest_height, exact.dead_band)
            yield DrivingControl(held, free, exact, actuator, disc, brush(disc, strength, change))
        else:
            even, time = (smooth, SPREADING) if verb is Verb.SMOOTH else (average, AVERAGING)
            exchange = make_exchange(grid, strength * radius**2 / time, period)
            aim, reach = brush(disc, strength, partial(even, exchange)), (x, y, radius + margin)
            yield DrivingControl(held, free, drive, actuator, reach, aim)


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
