"""Counter of numpy calls: arrays that record their operations.

A control period's cost is the number of numpy calls in it, and not seconds on a shared
machine: the count is the same wherever it is taken.
"""

from __future__ import annotations

import dataclasses
import statistics
import sys
import timeit
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from digiclay.core.engine import simulation
from digiclay.core.engine.system import System
from digiclay.core.model.trajectory import Trajectory, sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene

from .report import table

#: Methods of arrays that make an array or bytes; reductions reach `__array_ufunc__` by themselves.
METHODS = ("take", "copy", "astype", "dot", "reshape", "tobytes", "__getitem__", "__setitem__")
#: Methods that reach `__array_ufunc__` by themselves, or make no array.
REDUCTIONS = ("any", "all", "sum", "min", "max", "item", "tolist", "view")
#: Where calls are numpy's own, or this counter's.
INSIDE = (str(Path(np.__file__).parent), __file__)


class Ledger:
    """Calls taken down: how often each, and one example to time.

    Attributes
    ----------
    calls : Counter
        By name and shapes.
    examples : dict
        For those noted with their arguments a function without arguments that makes the same call.
    """

    def __init__(self) -> None:
        self.calls: Counter[tuple[Any, ...]] = Counter()
        self.examples: dict[tuple[Any, ...], Callable[[], Any]] = {}

    def note(
        self, name: str, call: Callable[..., Any], arguments: tuple[Any, ...], known: dict[str, Any]
    ) -> None:
        """Take down a call.

        `arguments`: their shapes and types are part of the key; `known`: keyword arguments.
        """
        kinds = (one.shape if isinstance(one, np.ndarray) else type(one).__name__ for one in arguments)
        key = (name, *kinds)
        self.calls[key] += 1
        if key not in self.examples:
            own = [one.copy() if isinstance(one, np.ndarray) else one for one in arguments]
            self.examples[key] = lambda: call(*own, **known)


class Counted(np.ndarray[Any, Any]):
    """An array that notes every call with it in `ledger`; what comes of a call is one too."""

    # So that the product of a plain array with one of these is one too.
    __array_priority__ = 1.0
    ledger = Ledger()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **known: Any) -> Any:
        call, arguments = getattr(ufunc, method), _plain(inputs)
        name, known = ufunc.__name__ if method == "__call__" else f"{ufunc.__name__}.{method}", _plain(known)
        if out is not None:
            known["out"] = _plain(out)
        Counted.ledger.note(name, call, arguments, known)
        result = call(*arguments, **known)
        return out[0] if out is not None else _counted(result)

    def __array_function__(self, function: Any, types: Any, arguments: Any, known: Any) -> Any:
        plain = _plain(arguments)
        Counted.ledger.note(function.__name__, function, plain, _plain(known))
        return _counted(function(*plain, **_plain(known)))


def _method(name: str) -> Callable[..., Any]:
    """Return a method of `Counted` that notes the call."""
    original = getattr(np.ndarray, name)

    def noted(self: Any, *arguments: Any, **known: Any) -> Any:
        plain, inner = self.view(np.ndarray), _plain(arguments)
        Counted.ledger.note(name, original, (plain, *inner), _plain(known))
        return _counted(original(plain, *inner, **_plain(known)))

    return noted


for _name in METHODS:
    setattr(Counted, _name, _method(_name))


def _plain(value: Any) -> Any:
    """Return a value with every `Counted` in it as a plain array on the same memory."""
    if isinstance(value, Counted):
        return value.view(np.ndarray)
    if isinstance(value, (tuple, list)):
        return type(value)(_plain(one) for one in value)
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    return value


def _counted(value: Any) -> Any:
    """Return a result with every array in it as `Counted`."""
    if isinstance(value, np.ndarray):
        return value.view(Counted)
    if isinstance(value, (tuple, list)):
        return type(value)(_counted(one) for one in value)
    return value


def _fields_counted(value: Any) -> Any:
    """Return a dataclass with its arrays as `Counted`, also in dataclasses and tuples within."""
    if isinstance(value, np.ndarray):
        return value.view(Counted)
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        return tuple(_fields_counted(one) for one in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value) if field.name not in ("cell", "segments")]
        return dataclasses.replace(value, **{name: _fields_counted(getattr(value, name)) for name in names})
    return value


@contextmanager
def methods_noted() -> Iterator[None]:
    """Note methods of plain arrays and numpy's built-in functions too, for as long as the block lasts.

    `Counted` sees a call only if one of its own is asked: ``np.array(rows).dot(counted)`` is none, nor
    is a method that was bound to a plain array beforehand. What numpy's own modules call is not noted.
    """

    def noted(frame: FrameType, event: str, called: Any) -> None:
        if event != "c_call" or frame.f_code.co_filename.startswith(INSIDE):
            return
        owner = getattr(called, "__self__", None)
        if type(owner) is np.ndarray:
            if called.__name__ not in REDUCTIONS:
                Counted.ledger.calls[called.__name__, owner.shape] += 1
        elif not isinstance(owner, (np.ndarray, np.ufunc)) and str(called.__module__).startswith("numpy"):
            Counted.ledger.calls[called.__name__,] += 1

    former = sys.getprofile()
    sys.setprofile(noted)
    try:
        yield
    finally:
        sys.setprofile(former)


def period_calls(system: System, trajectories: Sequence[Trajectory], count: int) -> tuple[list[int], Ledger]:
    """Return how many numpy calls each of the first `count` control periods makes, and which.

    The finger's poses are not counted: they are worked out for many periods at once.

    `trajectories`: one a finger.
    """
    own = {name: _fields_counted(getattr(system, name)) for name in ("grid", "selection", "plan")}
    system = dataclasses.replace(system, **own)
    state = simulation.begin(system)
    several = {name: getattr(state, name).view(Counted) for name in ("rows", "modes", "aged")}
    starts = np.arange(count)[:, None] * system.period
    poses = sample_poses(trajectories, (starts + system.instants).ravel())
    ways = simulation.trace_fingers(system, poses.reshape(count, -1, len(trajectories), 7))
    Counted.ledger = ledger = Ledger()
    calls, before, state = [], 0, state._replace(**several)
    with methods_noted():
        for finger in ways:
            state = simulation.advance(system, state, finger)
            total = ledger.calls.total()
            calls.append(total - before)
            before = total
    return calls, ledger


def floor(ledger: Ledger) -> dict[tuple[Any, ...], float]:
    """Return what one call of each kind with an example takes by itself, s: the least of some repeats."""
    with np.errstate(all="ignore"):
        return {
            key: min(timeit.repeat(call, number=50, repeat=5)) / 50 for key, call in ledger.examples.items()
        }


def report(scene: Scene) -> Iterator[str]:
    """Give the lines of the table: calls a period by name, and what they alone take."""
    count = min(scene.periods, 2000)
    calls, ledger = period_calls(assemble(scene), scene.trajectories(), count)
    alone = floor(ledger)
    number: Counter[str] = Counter()
    spent: defaultdict[str, float] = defaultdict(float)
    for key, times in ledger.calls.items():
        number[key[0]] += times
        spent[key[0]] += times * alone.get(key, 0.0)
    yield f"numpy calls of the first {count} control periods: median {statistics.median(calls):g} a period"
    rows = [
        [name, f"{number[name] / count:.1f}", f"{spent[name] / count * 1e6:.1f}"]
        for name in sorted(spent, key=lambda one: -spent[one])
        if number[name] >= 0.05 * count
    ]
    rows.append(["all", f"{number.total() / count:.1f}", f"{sum(spent.values()) / count * 1e6:.1f}"])
    yield from table(("call", "a period", "alone, µs"), rows)
