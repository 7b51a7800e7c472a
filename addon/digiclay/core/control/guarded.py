"""Check of everything that a controller of unknown code gives: each error is one line with file and rule."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from ..base.errors import DigiclayError, MethodError
from ..model.control_interface import Commands, Controller, Measurement
from .own_method import check_array, check_modes, take_results

#: Control periods that the calls of one control period may take on average, in processor time; and how many
#: calls an average is taken over. A built-in method takes a tenth of one.
MOST_PERIODS, CALLS = 20.0, 20
#: Most numbers a method may keep of a cell.
MOST_ROWS = 1000


@dataclass(eq=False)
class Pace:
    """Processor time of the newest calls: the one thing of a session that is not its state.

    Attributes
    ----------
    spent : float
        Of `count` calls, s.
    count : int
    """

    spent: float = 0.0
    count: int = 0

    def add(self, spent: float) -> float | None:
        """Add a call; return the mean over `CALLS` of them, s, each time that these are complete."""
        self.spent, self.count = self.spent + spent, self.count + 1
        if self.count < CALLS:
            return None
        mean = self.spent / self.count
        self.spent, self.count = 0.0, 0
        return mean


@dataclass(frozen=True, eq=False)
class Guarded:
    """Controller that hands on to another one, and checks what that gives.

    Attributes
    ----------
    inner : Controller
    name : str
        Of the method in scene files.
    origin : str
        File and class, for messages.
    file : str
        As tracebacks have it.
    period : float
        Control period, s.
    rows : int
        State rows a cell needs.
    pace : Pace
    """

    inner: Controller
    name: str
    origin: str
    file: str
    period: float
    rows: int
    pace: Pace = field(default_factory=Pace)

    def begin(self) -> Any:
        """Return the memory before a session."""
        with self._told("begin"):
            memory = self.inner.begin()
            _check_memory(memory)
        return memory

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, tuple[float, float, float] | None]:
        """Let the method say which cells it commands; see `Controller`."""
        start = time.thread_time()
        with self._told("locate"), np.errstate(all="ignore"):
            given = _hand_out(touched)
            found = self.inner.locate(memory, given)
            after, disc = take_results(found, 2, "memory and a disc, or None")
            _check_alike(memory, after)
            touched.own[:] = given.own
            if disc is not None:
                disc = tuple(check_array(disc, "the disc", (3,)).tolist())
        self.pace.spent += time.thread_time() - start
        return after, disc

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Let the method command the cells; see `Controller`."""
        start, size = time.thread_time(), seen.height.shape
        with self._told("command"), np.errstate(all="ignore"):
            given = _hand_out(seen)
            after, orders = take_results(self.inner.command(memory, given), 2, "memory and orders")
            _check_alike(memory, after)
            target, mode, command = take_results(orders, 3, "target, mode and command")
            target = check_array(target, "target", size)
            mode = check_modes(check_array(mode, "mode", size, "iu"))
            command = check_array(command, "command", size)
            if command.size and not (command.max() <= 1.0 and command.min() >= -1.0):
                raise ValueError(f"must return commands from -1 to 1 (got {np.abs(command).max():.6g})")
            if self.rows:
                seen.own[:] = check_array(given.own, "rows", seen.own.shape)
        self._judge(time.thread_time() - start)
        return after, Commands(target, mode, command)

    def _judge(self, spent: float) -> None:
        """Refuse a method that is too slow: a live session would stand still."""
        mean = self.pace.add(spent)
        if mean is not None and mean > MOST_PERIODS * self.period:
            rule = f"must take at most {MOST_PERIODS:g} control periods of processor time a call"
            got = f"{mean / self.period:.3g} of {self.period:.3g} s on average over {CALLS}"
            raise MethodError(f"{self.origin}: command {rule} (got {got}).")

    @contextmanager
    def _told(self, function: str) -> Iterator[None]:
        """Turn whatever goes wrong into one line."""
        try:
            yield
        except (MethodError, MemoryError, KeyboardInterrupt):
            raise
        except BaseException as error:  # also SystemExit, which would end the program without a word
            raise MethodError(f"{self.origin}: {function} {describe_failure(error, self.file)}.") from error


def guard(build: Any, name: str, origin: str, file: str, period: float) -> Guarded:
    """Build a controller of unknown code, and guard it."""
    try:
        inner = build()
        for function in ("begin", "locate", "command"):
            if not callable(getattr(inner, function, None)):
                raise TypeError(f"must return a controller with {function} (got {type(inner).__name__})")
        rows = inner.rows
        if not isinstance(rows, int) or isinstance(rows, bool) or not 0 <= rows <= MOST_ROWS:
            raise TypeError(f"must have rows, a whole number from 0 to {MOST_ROWS} (got {rows!r})")
    except (DigiclayError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise MethodError(f"{origin}: build {describe_failure(error, file)}.") from error
    return Guarded(inner, name, origin, file, period, rows)


def describe_failure(error: BaseException, file: str) -> str:
    """Return what an error of unknown code breaks, with the line of its file.

    A rule that a check of ours found broken is the error's own text, ``must ...``.
    """
    said = str(error).rstrip(".")
    if said.startswith("must ") and isinstance(error, (TypeError, ValueError)):
        return said
    line = error.lineno if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    kind = type(error).__name__
    where = f" in line {line}" if line else ""
    return f"must not raise (got {kind}{where}{': ' + said if said else ''})"


def _hand_out(seen: Measurement) -> Measurement:
    """Return copies, so that no view leads to the bed's own arrays; read-only but the controller's rows."""
    rows: Any = seen[:-1]  # a method of unknown code is asked about one run at a time
    given = Measurement(*(array.copy() for array in rows))
    for array in given[:-1]:
        array.flags.writeable = array is given.own
    return given


def _check_memory(memory: Any) -> None:
    """Refuse a memory that a kept state could not hold; see `session.snapshot_memory`."""
    if isinstance(memory, tuple):
        for item in memory:
            _check_memory(item)
        return
    known = memory is None or isinstance(memory, (bool, int, float, np.number, np.bool_, Enum))
    if not known and not (isinstance(memory, np.ndarray) and memory.dtype.kind in "biuf"):
        rule = "must return a memory of numbers, arrays, enumerations and tuples of them, or None"
        raise TypeError(f"{rule} (got {type(memory).__name__})")


def _check_alike(before: Any, after: Any) -> None:
    """Refuse a memory of another structure than the one there was: a kept state could not be read back."""
    if after is before:
        return
    if isinstance(after, tuple) and type(after) is type(before) and len(after) == len(before):
        for old, new in zip(before, after, strict=True):
            if new is not old:
                _check_alike(old, new)
    elif isinstance(after, np.ndarray) and isinstance(before, np.ndarray):
        if (after.ndim, after.dtype.kind) != (before.ndim, before.dtype.kind):
            rule = f"must keep the memory's array of {before.ndim} dimensions and {before.dtype}"
            raise TypeError(f"{rule} (got {after.ndim} and {after.dtype})")
    elif type(after) is not type(before) and not _is_number_like(before, after):
        rule = f"must keep the kinds of its memory, here {type(before).__name__}"
        raise TypeError(f"{rule} (got {type(after).__name__})")
    elif isinstance(after, (float, np.floating)) and math.isnan(after):
        raise ValueError("must return a memory without NaN")


def _is_number_like(before: Any, after: Any) -> bool:
    """Return whether a number may stand where another one stood: a float may become any real number."""
    if isinstance(before, (float, np.floating)):
        return isinstance(after, (int, float, np.integer, np.floating)) and not isinstance(after, bool)
    whole = (int, np.integer)
    if isinstance(before, (bool, np.bool_)):
        return isinstance(after, (bool, np.bool_))
    return isinstance(before, whole) and isinstance(after, whole) and not isinstance(after, bool)
