"""Control methods of users: base class, measurements and orders, and the guard around their code.

An own method is a frozen dataclass: its fields are the parameters, its methods are pure functions.
`begin` returns the memory before a session, `locate` the cells to be commanded, and `command`
converts forces and heights to commanded heights or valve openings. A method with a controller of
its own overrides `build`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..base.arrays import Cells as Numbers
from ..base.arrays import Floats, Modes
from ..base.errors import DigiclayError, MethodError
from ..base.modes import FORCE_FOLLOW, Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Controller, Measurement, Memory
from ..model.layout import Disc
from .device_info import DeviceInfo, suppress_noise
from .pin_motion import MotionParameters, PinMotion, make_pin_motion

#: The highest code of a mode; the lowest is 0.
HIGHEST = int(Mode.FROZEN)


class Cells(NamedTuple):
    """Cells of a period, m of them, as an own method sees them; the arrays are read-only."""

    x: Floats
    y: Floats
    """(m,): Positions, m."""
    height: Floats
    force: Floats
    """(m,): Measured heights, m, and forces, N."""
    target: Floats
    """(m,): Last commanded heights, m."""
    mode: Modes
    """(m,): Their modes, see `Mode`."""
    rows: Floats
    """(rows, m): State rows of the method, 0 at first; see `OwnMethod.rows`."""
    number: Numbers
    """(m,): Their numbers in the bed."""


class Orders(NamedTuple):
    """Orders of an own method; a field that is None gets its default."""

    height: Any = None
    """(m,): Commanded heights, m, limited to the stroke; by default those before."""
    opening: Any = None
    """(m,): Valve openings from -1 (down) to 1 (up), limited to these; by default those that take the pins to
    their commanded heights, with the time constant `settling_time`."""
    mode: Any = None
    """(m,): By default FORCE_FOLLOW where there is force, else HOLD at a formed height, else REST."""
    rows: Any = None
    """(rows, m): What is remembered of each cell; by default what was."""


@dataclass(frozen=True, eq=False, repr=False)
class OwnMethod(MotionParameters):
    """Base of the control methods of one's own; a subclass is a frozen dataclass with fields of `quantity`.

    Its first line of documentation is what Blender shows of it. What is no field, below, a subclass
    may set to another value.
    """

    #: Numbers the method remembers of each cell, whether or not it is among the cells of a period.
    rows: ClassVar[int] = 0
    #: Defaults for the section [blister] where they differ; None: the method has no such section.
    blister: ClassVar[Mapping[str, float] | None] = None
    #: Whether cells go back to the height they had at rest: then a displayed shape is what they go
    #: back to.
    recovers: ClassVar[bool] = False

    reach: float = quantity(
        20e-3,
        "radius around the middle of the forces within which all cells are commanded",
        unit="m",
        symbol="r_reach",
        at_least=0.0,
    )

    def begin(self, device: DeviceInfo) -> Memory:
        """Return the memory before a session: None, numbers, arrays, and (named) tuples of them."""

    def locate(
        self, memory: Memory, touched: Cells, device: DeviceInfo
    ) -> tuple[Memory, Disc | None]:
        """Return memory and the disc x, y, radius of the cells to command, m; None: those that move.

        `memory`: from `begin`, or `command` a period before; `touched`: those the fingertip may
        touch.
        """
        force = suppress_noise(touched.force, device.force_floor)
        total = float(force.sum())
        if not self.reach or not total > 0.0:
            return memory, None
        return memory, (
            float(force.dot(touched.x)) / total,
            float(force.dot(touched.y)) / total,
            self.reach,
        )

    def command(self, memory: Memory, cells: Cells, device: DeviceInfo) -> tuple[Any, Orders]:
        """Return memory and orders for the cells of the disc and all that still move.

        `memory`: from `locate`; `device`: control period, cylinders, fluid and noise; see
        `DeviceInfo`.
        """
        raise NotImplementedError("command must be defined")

    def build(self, device: DeviceInfo) -> Controller:
        """Return the controller for a device; a method with a controller of its own overrides this."""
        return OwnControl(self, device, make_pin_motion(self, device.cell, device.period))


@dataclass(frozen=True, eq=False)
class OwnControl:
    """Controller of an own method that orders heights or openings."""

    parameters: OwnMethod
    device: DeviceInfo
    motion: PinMotion

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.parameters.rows

    def begin(self) -> Memory:
        """Return the memory before a session."""
        return self.parameters.begin(self.device)

    def locate(self, memory: Memory, touched: Measurement) -> Any:
        """Let the method choose the cells it commands; see `Controller`."""
        return self.parameters.locate(memory, show_cells(touched), self.device)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Check the method's orders, and add defaults; see `Controller`."""
        given = self.parameters.command(memory, show_cells(seen), self.device)
        memory, orders = take_results(given, 2, "memory and orders")
        if not isinstance(orders, Orders):
            raise TypeError(
                f"must return Orders as its second result (got {type(orders).__name__})"
            )
        size, actuator = seen.height.shape, self.device.cell.actuator
        mode = None if orders.mode is None else check_modes(orders.mode, size)
        height, opening, rows = (
            None if order is None else check_array(order, name, shape)
            for order, name, shape in (
                (orders.height, "height", size),
                (orders.opening, "opening", size),
                (orders.rows, "rows", seen.own.shape),
            )
        )
        if height is None and opening is not None and self.device.servos:
            raise ValueError("must order heights with drive.kind = servo, not openings alone")
        target = np.clip(seen.target if height is None else height, 0.0, actuator.stroke)
        if opening is None:
            command = self.motion.command(self.motion.approach(target - seen.height), seen.force)
        else:
            command = np.clip(opening, -1.0, 1.0)
        if mode is None:
            touched = suppress_noise(seen.force, self.device.force_floor) > 0.0
            formed = self.motion.mark_formed(target, actuator.rest_height)
            mode = np.where(touched, FORCE_FOLLOW, formed)
        if rows is not None:
            seen.own[:] = rows
        return memory, Commands(target, mode, command)


def show_cells(seen: Measurement) -> Cells:
    """Return a measurement for an own method, with read-only rows."""
    basis, rows = seen.quadratic_basis, seen.own[:]
    rows.flags.writeable = False
    return Cells(
        basis[1], basis[2], seen.height, seen.force, seen.target, seen.mode, rows, seen.cells
    )


def take_results(given: Any, count: int, wanted: str) -> Any:
    """Return the results of a function, a tuple of `count`, or raise the broken rule."""
    if not isinstance(given, tuple) or len(given) != count:
        got = f"{len(given)} results" if isinstance(given, tuple) else type(given).__name__
        raise TypeError(f"must return {('two', 'three')[count - 2]} results, {wanted} (got {got})")
    return given


def check_array(values: Any, name: str, shape: tuple[int, ...], kinds: str = "fiu") -> Any:
    """Return values as an array of a shape and kinds of numbers, or raise the rule."""
    array = np.asarray(values)
    if array.shape != shape:
        raise ValueError(
            f"must return {name} of the shape {shape} of the cells (got {array.shape})"
        )
    if array.dtype.kind not in kinds:
        wanted = "real numbers" if "f" in kinds else "whole numbers"
        raise TypeError(f"must return {name} as {wanted} (got {array.dtype})")
    if "f" not in kinds:
        return array
    array = array.astype(np.float64, copy=False)
    if not math.isfinite(array.sum()):  # one call, where all is well
        finite = np.isfinite(array)
        if not finite.all():
            raise ValueError(f"must return {name} as finite numbers (got {array[~finite][0]})")
    return array


def check_modes(values: Any, size: tuple[int, ...]) -> Modes:
    """Return modes as stored, or raise the rule if they are no codes of `Mode`."""
    modes = check_array(values, "mode", size, "iu")
    if modes.size and not (modes.min() >= 0 and modes.max() <= HIGHEST):
        raise ValueError(
            f"must return mode as codes of Mode, from 0 to {HIGHEST} (got {modes.max()})"
        )
    return modes.astype(np.int8, copy=False)


#: Largest mean processor time of the calls of a control period, in control periods, and number of
#: calls in the mean. A built-in method takes a tenth of a period.
MOST_PERIODS, CALLS = 20.0, 20
#: Most state rows of a method.
MOST_ROWS = 1000


@dataclass(eq=False)
class Pace:
    """Processor time of the `count` newest calls, s; the only part of a session outside its state."""

    spent: float = 0.0
    count: int = 0

    def add(self, spent: float) -> float | None:
        """Add a call; return the mean over `CALLS` calls, s, once they are complete."""
        self.spent, self.count = self.spent + spent, self.count + 1
        if self.count < CALLS:
            return None
        mean = self.spent / self.count
        self.spent, self.count = 0.0, 0
        return mean


@dataclass(frozen=True, eq=False)
class Guarded:
    """Controller that delegates to another one, and checks its results."""

    inner: Controller
    origin: str
    file: str
    """File and class, for messages; file as tracebacks have it."""
    period: float
    rows: int
    """Control period, s; state rows a cell needs."""
    pace: Pace = field(default_factory=Pace)

    def begin(self) -> Memory:
        """Return the memory before a session."""
        with self._report("begin"):
            memory = self.inner.begin()
            _check_memory(memory)
        return memory

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Memory, Disc | None]:
        """Let the method choose the cells it commands; see `Controller`."""
        start = time.thread_time()
        with self._report("locate"), np.errstate(all="ignore"):
            given = _copy_read_only(touched)
            wanted = "memory and a disc, or None"
            after, disc = take_results(self.inner.locate(memory, given), 2, wanted)
            _check_alike(memory, after)
            touched.own[:] = given.own
            if disc is not None:
                disc = tuple(check_array(disc, "the disc", (3,)).tolist())
        self.pace.spent += time.thread_time() - start
        return after, disc

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Let the method command the cells; see `Controller`."""
        start = time.thread_time()
        with self._report("command"), np.errstate(all="ignore"):
            given = _copy_read_only(seen)
            after, orders = take_results(self.inner.command(memory, given), 2, "memory and orders")
            _check_alike(memory, after)
            commands = orders if type(self.inner) is OwnControl else self._check(orders, given)
            seen.own[:] = given.own
        mean = self.pace.add(time.thread_time() - start)
        # Otherwise a live session would stop.
        if mean is not None and mean > MOST_PERIODS * self.period:
            rule = f"must take at most {MOST_PERIODS:g} control periods of processor time per call"
            got = f"{mean / self.period:.3g} of {self.period:.3g} s on average over {CALLS}"
            raise MethodError(f"{self.origin}: command {rule} (got {got}).")
        return after, commands

    def _check(self, orders: Any, given: Measurement) -> Commands:
        """Return the commands of a controller of unknown code, or raise the broken rule."""
        target, mode, command = take_results(orders, 3, "target, mode and command")
        size = given.height.shape
        target, command = check_array(target, "target", size), check_array(command, "command", size)
        if command.size and not (command.max() <= 1.0 and command.min() >= -1.0):
            raise ValueError(f"must return commands from -1 to 1 (got {np.abs(command).max():.6g})")
        check_array(given.own, "rows", given.own.shape)
        return Commands(target, check_modes(mode, size), command)

    @contextmanager
    def _report(self, function: str) -> Iterator[None]:
        """Turn any error into one line."""
        try:
            yield
        except (MethodError, MemoryError, KeyboardInterrupt):
            raise
        except BaseException as error:
            # Also SystemExit, which would end the program without a word.
            raise MethodError(
                f"{self.origin}: {function} {describe_failure(error, self.file)}."
            ) from error


def guard(build: Any, origin: str, file: str, period: float) -> Guarded:
    """Build a controller of unknown code, and guard it."""
    try:
        inner = build()
        for function in ("begin", "locate", "command"):
            if function not in dir(inner):
                raise TypeError(
                    f"must return a controller with {function} (got {type(inner).__name__})"
                )
        rows = inner.rows
        if not isinstance(rows, int) or isinstance(rows, bool) or not 0 <= rows <= MOST_ROWS:
            raise TypeError(f"must have rows, a whole number from 0 to {MOST_ROWS} (got {rows!r})")
    except (DigiclayError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise MethodError(f"{origin}: build {describe_failure(error, file)}.") from error
    return Guarded(inner, origin, file, period, rows)


def describe_failure(error: BaseException, file: str) -> str:
    """Return the rule that an error of unknown code breaks, one of ours or *must not raise* with its line."""
    text = str(error).rstrip(".")
    if text.startswith("must ") and isinstance(error, (TypeError, ValueError)):
        return text
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    where = f" in line {line}" if line else ""
    return f"must not raise (got {type(error).__name__}{where}{': ' + text if text else ''})"


def _copy_read_only(seen: Measurement) -> Measurement:
    """Return copies, so that no view leads to arrays of the bed; read-only except the controller's rows."""
    arrays: Any = seen[:-3]  # a method of unknown code is called for one run at a time
    given = Measurement(*(array.copy() for array in arrays))
    for array in given[:-3]:
        array.flags.writeable = array is given.own
    return given


def _check_memory(memory: Memory) -> None:
    """Refuse a memory that cannot be stored; see `session.snapshot`."""
    if isinstance(memory, tuple):
        for item in memory:
            _check_memory(item)
        return
    single = memory is None or isinstance(memory, (bool, int, float, np.number, np.bool_, Enum))
    if not single and not (isinstance(memory, np.ndarray) and memory.dtype.kind in "biuf"):
        rule = "must return a memory of numbers, arrays, enumerations and tuples of them, or None"
        raise TypeError(f"{rule} (got {type(memory).__name__})")


def _check_alike(before: Any, after: Any) -> None:
    """Refuse a memory of another structure than before: a stored state could not be read."""
    if after is before:
        return
    if isinstance(after, tuple) and type(after) is type(before) and len(after) == len(before):
        for old, new in zip(before, after, strict=True):
            _check_alike(old, new)
    elif isinstance(after, np.ndarray) and isinstance(before, np.ndarray):
        if (after.ndim, after.dtype.kind) != (before.ndim, before.dtype.kind):
            rule = f"must keep the memory's array of {before.ndim} dimensions and {before.dtype}"
            raise TypeError(f"{rule} (got {after.ndim} and {after.dtype})")
    elif type(after) is not type(before) and (_rank(before), _rank(after)) not in ALIKE:
        rule = f"must keep the kinds of its memory, here {type(before).__name__}"
        raise TypeError(f"{rule} (got {type(after).__name__})")
    elif isinstance(after, (float, np.floating)) and math.isnan(after):
        raise ValueError("must return a memory without NaN")


#: Kinds of numbers by rank, and permitted ranks before and after: a float may become a whole
#: number.
NUMBERS = ((bool, np.bool_), (int, np.integer), (float, np.floating))
ALIKE = ((0, 0), (1, 1), (2, 2), (2, 1))


def _rank(value: Any) -> int:
    """Return the rank of a number in `NUMBERS`, -1 for anything else."""
    return next((rank for rank, kinds in enumerate(NUMBERS) if isinstance(value, kinds)), -1)
