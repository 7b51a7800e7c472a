"""Orders to the valves beside the control method: what brushes do to pins without a finger.

An order is a row of five numbers a control period: x, y and radius of a disc, m, a strength, and a
`Verb`.

SMOOTH
    The commanded heights diffuse, ``dh/dt = ∇(w D ∇h)`` with ``D = strength r² / T``. The weight w
    falls from 1 in the middle of the disc to 0 at its rim; between two neighbors the smaller one
    holds. Clay is moved, but not lost. No cell leaves the range of its neighbors, so that nothing
    oscillates, and cells outside the disc do not change.
AVERAGE
    Predecessor of SMOOTH, for older takes: ``dh = w D ∇²h T_c``, with the larger of the total rise
    and the total fall scaled down to the other.
ERASE
    The commanded heights return to rest with these weights, ``dh/dt = w strength (h_rest - h) /
    T``.
LOCK, UNLOCK, INVERT
    Pins in the disc get, lose or toggle the mode LOCKED: their valves are shut, whatever is
    commanded.
SHARE
    Pins get the shares of a surface, whose number is in column x: 1 locks a pin, 0 unlocks it, less
    than 1 locks it in part, which only brushes obey.
PLACE
    Pins go to the heights of a surface, whose number is in column x; NaN: the pin is not driven.

A weighted order of strength 0 changes no height, but pins that have not arrived are driven further.
A radius of 0 is no order, except for PLACE: the method commands all pins. Driven pins have the mode
BLISTER until they arrive.
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
from .exchange import Exchange, make_exchange
from .pin_motion import MotionParameters, PinMotion, make_pin_motion
from .servo import mark_formed
from .travel import measure_square

#: Numbers of an order.
ORDER = 5
#: Time in which strength 1 spreads heights over the radius, SMOOTH and AVERAGE, and erases all but
#: 1/e, s. One pass of SMOOTH at 100 mm/s leaves 15 to 45 % of the variation on the beds of
#: `settings.devices`.
SPREADING, AVERAGING, ERASING = 0.25, 1.0, 5e-3
#: Largest distance of neighbors, in pitches or distances of rows: 1.12 if rows are shifted.
MARGIN = 1.5
#: Least radius, m, largest number, and largest strength of an order.
SMALLEST, FARTHEST, STRONGEST = 1e-6, 1e3, 100.0
#: Dead band of heights while pins are erased or placed, m: they stand within 1 µm.
BAND = 0.5e-6


class Verb(IntEnum):
    """Effect of an order."""

    AVERAGE = 0
    SMOOTH = 1
    ERASE = 2
    LOCK = 3
    UNLOCK = 4
    INVERT = 5
    PLACE = 6
    SHARE = 7


LOCKING = (Verb.LOCK, Verb.UNLOCK, Verb.INVERT, Verb.SHARE)
#: Those with the number of a surface.
SURFACED = (Verb.PLACE, Verb.SHARE)


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
    periods: int,
    verb: Verb,
    x: float = 0.0,
    y: float = 0.0,
    radius: float = 0.0,
    strength: float = 0.0,
) -> Floats:
    """Return the rows (t, 5) of an order that lasts for `periods` control periods."""
    return np.tile((x, y, radius, strength, float(verb)), (periods, 1))


def place(periods: int, surface: Floats) -> Orders:
    """Return the orders that drive pins to a surface (n,), m, for `periods`; NaN: not driven."""
    return Orders(repeat_order(periods, Verb.PLACE), (surface,))


def share(shares: Floats) -> Orders:
    """Return the order of one period that locks pins by shares (n,), from 0 to 1."""
    return Orders(repeat_order(1, Verb.SHARE, radius=FARTHEST), (shares,))


def add_verbs(rows: Floats) -> Floats:
    """Return orders (t, 5) for rows (t, 4) without verbs, which all average."""
    return np.column_stack([rows, np.zeros(len(rows))])


@dataclass(frozen=True, eq=False)
class Around:
    """Controller around that of the method, with the same memory.

    It has no rows of cells: after any period the method alone can continue the session.
    """

    method: Controller

    @property
    def rows(self) -> int:
        """State rows per cell."""
        return self.method.rows

    def begin(self) -> Memory:
        """Return the memory before a session."""
        return self.method.begin()


#: Returns, of measured cells, new commanded heights, (m,), m, which pins are driven there, and
#: which a brush changes.
Aim = Callable[[Measurement], tuple[Floats, Flags, Flags]]
#: Returns the commanded heights after a period, (m,), m, of measured cells by weights, (m,), not
#: all 0.
Change = Callable[[Measurement, Floats], Floats]


@dataclass(frozen=True, eq=False)
class DrivingControl(Around):
    """Controller of a period with an order, which drives some cells; the method commands the others."""

    free: bool
    """Whether the bed has no method."""
    motion: PinMotion
    actuator: Actuator
    reach: Disc
    """Disc of the driven cells, and of those whose heights they depend on, m."""
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
        error, band = target - seen.height, self.motion.dead_band
        # An error within the dead band of what is placed may be one of what forms pins.
        mode = mark_formed(
            target, self.actuator.rest_height, max(band, MotionParameters().dead_band)
        )
        np.putmask(mode, busy | (np.abs(error) > band), BLISTER)
        command = self.motion.command(self.motion.approach(error), seen.force)
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
    """Controller of a bed with locked pins, which the method sees as holding or at rest.

    A locked pin is commanded to its height, so that it stays there when unlocked.
    """

    cell: Cell
    verb: Verb
    disc: Disc | None = None
    """Pins to be locked or unlocked; None: locked pins do not change."""
    shares: Floats | None = None
    """(n,): Shares by which all pins are locked from now on; None: another verb."""

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Request the disc, and the method's; see `Controller`."""
        memory, disc = self.method.locate(memory, self._mask(touched))
        return memory, disc if self.disc is None else add_disc(disc, self.disc)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Shut the valves of locked pins, or balance their loads; the method commands all others."""
        locked = self._choose(seen)
        memory, orders = self.method.command(memory, self._mask(seen))
        if not any_true(locked):
            return memory, orders
        target = np.where(locked, seen.height, orders.target)
        mode = np.where(locked, LOCKED, orders.mode)
        held = self.cell.supply.balance(self.cell.actuator.pressure(seen.force))
        return memory, Commands(target, mode, np.where(locked, held, orders.command))

    def _choose(self, seen: Measurement) -> Flags:
        """Return which pins are locked after the period, (m,)."""
        locked: Flags = seen.mode == LOCKED
        if self.disc is None:
            return locked
        if self.shares is not None:
            return self.shares.take(seen.cells) == 1.0
        x, y, radius = self.disc
        inside = measure_square(x, y, seen.quadratic_basis) <= radius**2
        if self.verb is Verb.INVERT:
            return locked ^ inside
        return locked | inside if self.verb is Verb.LOCK else locked & ~inside

    def find_locks(self, grid: Grid, locks: Floats | None) -> Floats | None:
        """Return the shares of pins locked in part, (n,), after the period; see `State.locks`."""
        if self.shares is not None:
            partly = np.where(self.shares < 1.0, self.shares, 0.0)
            return partly if partly.any() else None
        if locks is None or self.disc is None:
            return locks
        rest = locks.copy()
        rest[grid.disc(*self.disc)] = 0.0
        return rest

    def _mask(self, seen: Measurement) -> Measurement:
        """Return the measurement for a method without locks."""
        locked = seen.mode == LOCKED
        if not any_true(locked):
            return seen
        formed = mark_formed(
            seen.target, self.cell.actuator.rest_height, MotionParameters().dead_band
        )
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

    `latency`: time from a command to the measurement of its effect, s; `floor`: largest error of a
    height reading, m; `locked`: whether pins are locked at the start.
    """
    quick, plan = 2.0 * period, grid.layout
    # As fast as a display, within the limit of the control period.
    motion = make_pin_motion(
        MotionParameters(max(MotionParameters().settling_time, quick)), cell, period
    )
    # A loop of gain 1/T oscillates if T is below e times its dead time; sampling adds half a
    # control period.
    settling = max(quick, math.e * (latency + 0.5 * period))
    exact = make_pin_motion(MotionParameters(settling, max(BAND, floor)), cell, period)
    margin, free = MARGIN * max(plan.pitch, plan.row_spacing), isinstance(method, Uncontrolled)
    circles: dict[int, Disc | None] = {}
    actuator, held = cell.actuator, method
    for x, y, radius, strength, number in orders.rows.tolist():
        verb, disc = Verb(int(number)), (x, y, radius)
        locked |= radius > 0.0 and verb in LOCKING
        held = LockingControl(method, cell, verb) if locked else method
        if verb is Verb.PLACE:
            surface = orders.surfaces[int(x)]
            if int(x) not in circles:
                driven = grid.enclose(np.flatnonzero(~np.isnan(surface)))
                circles[int(x)] = widen_disc(driven, 0.1 * plan.pitch)
            circle, goal = circles[int(x)], partial(approach, surface)
            yield DrivingControl(held, free, exact, actuator, circle, goal) if circle else held
        elif radius == 0.0:
            yield held
        elif verb is Verb.SHARE:  # its x is no place
            shares = orders.surfaces[int(x)]
            yield LockingControl(method, cell, verb, (0.0, 0.0, radius), shares)
        elif verb in LOCKING:
            yield LockingControl(method, cell, verb, disc)
        elif verb is Verb.ERASE:
            change = partial(
                erase, strength * period / ERASING, actuator.rest_height, exact.dead_band
            )
            yield DrivingControl(held, free, exact, actuator, disc, brush(disc, strength, change))
        else:
            even, time = (smooth, SPREADING) if verb is Verb.SMOOTH else (average, AVERAGING)
            exchange = make_exchange(grid, strength * radius**2 / time, period)
            aim, reach = brush(disc, strength, partial(even, exchange)), (x, y, radius + margin)
            yield DrivingControl(held, free, motion, actuator, reach, aim)


def find_fault(orders: Orders, periods: int, pins: int, stroke: float) -> str:
    """Return the fault of orders for numbers of periods and pins and a stroke, m; empty if there is none."""
    rows = orders.rows
    if rows.shape != (periods, ORDER) or rows.dtype != np.float64:
        return f"an array of the shape {rows.shape} of {rows.dtype}"
    x, _, radius, strength, verb = rows.T
    good = (np.abs(rows) <= FARTHEST).all(axis=1) & ((radius == 0.0) | (radius >= SMALLEST))
    good &= (strength >= 0.0) & (strength <= STRONGEST) & np.isin(verb, list(Verb))
    good &= ~np.isin(verb, SURFACED) | np.isin(x, np.arange(len(orders.surfaces)))
    if not good.all():
        return f"row {int(good.argmin())} is {rows[good.argmin()].tolist()}"
    shares = x[verb == Verb.SHARE]
    for number, surface in enumerate(orders.surfaces):
        if surface.shape != (pins,) or surface.dtype != np.float64:
            return f"surface {number} is an array of the shape {surface.shape} of {surface.dtype}"
        if number in shares and not ((surface >= 0.0) & (surface <= 1.0)).all():
            return f"surface {number} has shares that are not from 0 to 1"
        top = 1.0 if number in shares else stroke
        wrong = surface[~(np.isnan(surface) | ((surface >= 0.0) & (surface <= top)))]
        if wrong.size:
            return f"surface {number} has the height {wrong[0]:g} m"
    return ""
