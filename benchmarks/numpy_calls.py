"""Counter of numpy calls, the cost of a control period that is the same on every machine."""

import dataclasses
import statistics
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, ClassVar

import numpy as np
from digiclay.commands.progress import table
from digiclay.core.engine import simulation
from digiclay.core.engine.system import System
from digiclay.core.model.trajectory import Trajectory, sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene

#: Methods that make an array or bytes: Python's profiler does not see those that a `functools.partial` calls.
METHODS = ("take", "copy", "astype", "dot", "reshape", "tobytes", "__getitem__", "__setitem__")
#: Methods that reach `__array_ufunc__` by themselves, or make no array.
REDUCTIONS = ("any", "all", "sum", "min", "max", "item", "tolist", "view")
#: Files whose calls are numpy's own, or this counter's.
INSIDE = (str(Path(np.__file__).parent), __file__)

#: Number of calls by name.
Ledger = Counter[str]


class Counted(np.ndarray[Any, Any]):
    """An array that notes every operation with it in `ledger`; the results are counted arrays too."""

    # So that the product of a plain array with one of these is one too.
    __array_priority__ = 1.0
    ledger: ClassVar[Ledger] = Counter()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **named: Any) -> Any:
        name, named = ufunc.__name__ if method == "__call__" else f"{ufunc.__name__}.{method}", _plain(named)
        if out is not None:
            named["out"] = _plain(out)
        result = _call(name, getattr(ufunc, method), inputs, named)
        return out[0] if out is not None else result

    def __array_function__(self, function: Any, types: Any, arguments: Any, named: Any) -> Any:
        return _call(function.__name__, function, arguments, _plain(named))


def _note_method(name: str) -> Callable[..., Any]:
    """Return a method of `Counted` that notes the call."""
    original = getattr(np.ndarray, name)
    return lambda *arguments, **named: _call(name, original, arguments, _plain(named))


for _name in METHODS:
    setattr(Counted, _name, _note_method(_name))


def _call(name: str, function: Callable[..., Any], arguments: Any, named: dict[str, Any]) -> Any:
    """Note a call, and make it with plain arrays; its result is counted."""
    Counted.ledger[name] += 1
    return _counted(function(*_plain(arguments), **named))


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
    """Return a value with its arrays as `Counted`, also those in sequences and dataclasses."""
    if isinstance(value, np.ndarray):
        return value.view(Counted)
    if isinstance(value, (tuple, list)) and not hasattr(value, "_fields"):
        return type(value)(_counted(one) for one in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value) if field.name not in ("cell", "segments")]
        return dataclasses.replace(value, **{name: _counted(getattr(value, name)) for name in names})
    return value


@contextmanager
def note_methods() -> Iterator[None]:
    """Note methods of plain arrays and numpy's built-in functions too, but not what numpy's modules call."""

    def note(frame: FrameType, event: str, called: Any) -> None:
        if event != "c_call" or frame.f_code.co_filename.startswith(INSIDE):
            return
        owner = getattr(called, "__self__", None)
        if type(owner) is np.ndarray:
            if called.__name__ not in REDUCTIONS:
                Counted.ledger[called.__name__] += 1
        elif not isinstance(owner, (np.ndarray, np.ufunc)) and str(called.__module__).startswith("numpy"):
            Counted.ledger[called.__name__] += 1

    former = sys.getprofile()
    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(former)


def period_calls(system: System, trajectories: Sequence[Trajectory], count: int) -> tuple[list[int], Ledger]:
    """Return how many numpy calls each of the first `count` control periods makes, and which.

    The fingertips' poses are not counted: they are computed for many periods at once.
    """
    parts = {name: _counted(getattr(system, name)) for name in ("grid", "selection", "plan")}
    system = dataclasses.replace(system, **parts)
    state = simulation.begin(system)
    arrays = {name: getattr(state, name).view(Counted) for name in ("rows", "modes", "aged")}
    starts = np.arange(count)[:, None] * system.period
    poses = sample_poses(trajectories, (starts + system.instants).ravel())
    paths = simulation.trace_fingers(system, poses.reshape(count, -1, len(trajectories), 7))
    ledger: Ledger = Counter()
    Counted.ledger = ledger
    totals, state = [0], state._replace(**arrays)
    with note_methods():
        for path in paths:
            state = simulation.advance(system, state, path)
            totals.append(ledger.total())
    return np.diff(totals).tolist(), ledger


def list_calls(scene: Scene) -> Iterator[str]:
    """Give the lines of a table of the calls a period by name."""
    count = min(scene.periods, 2000)
    calls, ledger = period_calls(assemble(scene), scene.trajectories(), count)
    yield f"numpy calls of the first {count} control periods: median {statistics.median(calls):g} a period"
    rows = [[name, f"{n / count:.1f}"] for name, n in ledger.most_common() if n >= 0.05 * count]
    yield from table(("call", "a period"), [*rows, ["all", f"{ledger.total() / count:.1f}"]])
