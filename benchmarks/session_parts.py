"""Benchmarks ``session`` and ``terms``: time of a session by part, and without parts of the model."""

import cProfile
import statistics
import sys
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from types import CodeType, FrameType
from typing import Any, ClassVar

import numpy as np
from digiclay import core
from digiclay.commands.arguments import scene_of
from digiclay.commands.progress import table
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import advance, begin, periods
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.files.tables import Record
from digiclay.core.model.trajectory import Trajectory, sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder, RunRecording
from digiclay.core.scene.schema import Scene
from digiclay.core.session.accuracy import Replay
from digiclay.core.session.memory_limit import check_memory

from .report import Report, Steps, tabulate, time_by_turns


def replaying(scene: Scene, commands: Floats) -> System:
    """Return a scene's system that plays commands, (t, n), one row a control period."""
    system = assemble(scene)
    return replace(
        system, controller=Replay(system.grid, commands), rows=replace(system.rows, control=0)
    )


def run(scene: Scene, commands: Floats | None = None) -> tuple[System, Iterator[State]]:
    """Return a scene's system, with its controller or under commands, (t, n), and its states to come."""
    system = assemble(scene) if commands is None else replaying(scene, commands)
    return system, periods(system, scene.trajectories(), begin(system), scene.periods)


def solve(scene: Scene, commands: Floats | None = None) -> list[Floats]:
    """Return heights, (t, n), m, total force, (t,), N, and commands, (t, n), at the ends of the periods."""
    system, states = run(scene, commands)
    rows = [
        (state.row(0), state.row(system.rows.force).sum(), state.row(system.rows.command))
        for state in states
    ]
    return [np.array(column) for column in zip(*rows, strict=True)]


def simulate(system: System, scene: Scene, count: int) -> None:
    """Simulate so many control periods of a scene, and keep nothing."""
    for _ in periods(system, scene.trajectories(), begin(system), count):
        pass


#: Methods that make an array or bytes: Python's profiler does not see those that a
#: `functools.partial` calls.
ARRAY_METHODS = (
    "take",
    "copy",
    "astype",
    "dot",
    "reshape",
    "tobytes",
    "__getitem__",
    "__setitem__",
)
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

    def __array_ufunc__(
        self, ufunc: Any, method: str, *inputs: Any, out: Any = None, **named: Any
    ) -> Any:
        name = ufunc.__name__ if method == "__call__" else f"{ufunc.__name__}.{method}"
        named = _plain(named)
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


for _name in ARRAY_METHODS:
    setattr(Counted, _name, _note_method(_name))


def _call(name: str, function: Callable[..., Any], arguments: Any, named: Record) -> Any:
    """Note a call, and make it with plain arrays; its result is counted."""
    Counted.ledger[name] += 1
    return _counted(function(*_plain(arguments), **named))


def _plain(value: Any) -> Any:
    """Return a value with every `Counted` in it as a plain array on the same memory."""
    if isinstance(value, Counted):
        return value.view(np.ndarray)
    if isinstance(value, (tuple, list)):
        return type(value)(_plain(part) for part in value)
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    return value


def _counted(value: Any) -> Any:
    """Return a value with its arrays as `Counted`, also those in sequences and dataclasses."""
    if isinstance(value, np.ndarray):
        return value.view(Counted)
    if isinstance(value, (tuple, list)) and not hasattr(value, "_fields"):
        return type(value)(_counted(part) for part in value)
    if is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in fields(value) if field.name not in ("cell", "segments")]
        return replace(value, **{name: _counted(getattr(value, name)) for name in names})
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
        elif not isinstance(owner, (np.ndarray, np.ufunc)) and str(called.__module__).startswith(
            "numpy"
        ):
            Counted.ledger[called.__name__] += 1

    former = sys.getprofile()
    sys.setprofile(note)
    try:
        yield
    finally:
        sys.setprofile(former)


def period_calls(
    system: System, trajectories: Sequence[Trajectory], count: int
) -> tuple[list[int], Ledger]:
    """Return how many numpy calls each of the first `count` control periods makes, and which.

    The fingertips' poses are not counted: they are computed for many periods at once.
    """
    parts = {name: _counted(getattr(system, name)) for name in ("grid", "selection", "plan")}
    system = replace(system, **parts)
    state = begin(system)
    arrays = {name: getattr(state, name).view(Counted) for name in ("rows", "modes", "aged")}
    starts = np.arange(count)[:, None] * system.period
    poses = sample_poses(trajectories, (starts + system.instants).ravel())
    paths = system.trace(poses.reshape(count, -1, len(trajectories), 7), 0)
    ledger: Ledger = Counter()
    Counted.ledger = ledger
    totals, state = [0], state._replace(**arrays)
    with note_methods():
        for path in paths:
            state = advance(system, state, path)
            totals.append(ledger.total())
    return np.diff(totals).tolist(), ledger


def list_calls(scene: Scene) -> Iterator[str]:
    """Give the lines of a table of the calls per period by name."""
    count = min(scene.periods, 2000)
    calls, ledger = period_calls(assemble(scene), scene.trajectories(), count)
    yield f"numpy calls of the first {count} control periods: median {statistics.median(calls):g} a period"
    rows = [[name, f"{n / count:.1f}"] for name, n in ledger.most_common() if n >= 0.05 * count]
    yield from table(("call", "a period"), [*rows, ["all", f"{ledger.total() / count:.1f}"]])


#: Parts of a control period and what is in them.
PARTS = {
    "contact": "the fingertip's poses, its underside over the cells",
    "control": "locate, lead, blister, a command for each cell",
    "integrate": "valves, pins and the pulp over a period",
    "observe": "a row of the history",
    "the rest": "gathering the cells that move, and putting them back",
}
#: Part of the core's files, by the beginning of their path. A function's time counts for its file's
#: part; that of functions of other files (numpy's, small helpers) for their callers'.
FILES = {
    "model/trajectory": "contact",
    "model/touch": "contact",
    "model/fingertip": "contact",
    "control/": "control",
    "model/sensors": "control",
    "steppers/": "integrate",
    "model/": "integrate",
    "scene/recorder": "observe",
    "engine/": "the rest",
}
CORE = Path(core.__file__).parent
#: What can be left out, and its section of the scene.
TERMS = {
    "conduit": "conduit",
    "valve lag": "valve_lag",
    "dead time": "delay",
    "relaxation": "relaxation",
    "sensors": "sensors",
}
#: Physics steps that are longer: they cost less too.
LONGER = "physics step = control period"
#: Columns of the tables.
SPENT = {"part": "part", "": "meaning", "µs a period": "period_s .1f 1e6", "share": "share .0%"}
EFFECTS = {
    "scene": "scene",
    "calls": "calls g",
    "µs a period": "seconds .0f 1e6",
    "bytes a pin": "bytes d",
    "replayed, µm": "replayed_m .3g 1e6",
    "mN": "replayed_N .3g 1e3",
    "live, µm": "live_m .3g 1e6",
    "live, mN": "live_N .3g 1e3",
}


def measure(arguments: Namespace, steps: Steps) -> Report:
    """Time the session, with the profiler and without."""
    scene, _ = scene_of(arguments)
    check_memory(scene, assemble(scene).rows)
    plain, split = [], []
    for _ in steps.through(range(1 if arguments.quick else arguments.repeats)):
        plain.append(time_session(scene))
        profile = cProfile.Profile(builtins=False)
        split.append(divide_time(profile, time_session(scene, profile)[0]))
    simulated = scene.periods * scene.simulation.control_period
    whole, processor = (statistics.median(times) for times in zip(*plain, strict=True))
    spent = {part: statistics.median(times[part] for times in split) for part in PARTS}
    spent |= {"profiled": sum(spent.values()), "all": whole}
    meanings = PARTS | {"profiled": "all, with the profiler running", "all": "without it"}
    rows = [
        {
            "part": part,
            "meaning": meanings[part],
            "period_s": time / scene.periods,
            "share": time / spent["profiled"],
        }
        for part, time in spent.items()
    ]
    factor = simulated / whole
    lines = [
        f"{scene.name}: {scene.cells} cells, {scene.periods} control periods, {scene.simulation.stepper}",
        f"{simulated:.1f} s simulated in {whole:.3g} s ({factor:.3g} x real time), median of {len(plain)}",
        f"processor time {processor:.3g} s ({simulated / processor:.3g} x real time)\n",
        *tabulate(rows, SPENT, left=2),
    ]
    return Report([*lines, "", *list_calls(scene)] if arguments.calls else lines, rows)


def time_session(scene: Scene, profile: cProfile.Profile | None = None) -> tuple[float, float]:
    """Run a session as `core.session.run_scene.run` does; return its elapsed and its processor time, s."""
    system, trajectories = assemble(scene), scene.trajectories()
    state = begin(system)
    observe = RunRecording(scene.recorder or Recorder(), system.rows, state, scene.periods).observe
    with profile or nullcontext():
        started = perf_counter(), process_time()
        for reached in periods(system, trajectories, state, scene.periods):
            observe(reached)
        return perf_counter() - started[0], process_time() - started[1]


def divide_time(profile: cProfile.Profile, whole: float) -> dict[str, float]:
    """Return the time of each part, s; what no function of a part took of the `whole` is `the rest`."""
    spent = dict.fromkeys(PARTS, 0.0)
    for entry in profile.getstats():
        part = _find_part(entry.code)
        if part:
            called = sum(
                below.totaltime for below in entry.calls or () if not _find_part(below.code)
            )
            spent[part] += entry.inlinetime + called
    spent["the rest"] = whole - sum(time for part, time in spent.items() if part != "the rest")
    return spent


def _find_part(code: CodeType | str) -> str:
    """Return the part of a function's file, or an empty text."""
    file = Path("" if isinstance(code, str) else code.co_filename)
    if not file.is_relative_to(CORE):
        return ""
    name = file.relative_to(CORE).as_posix()
    return next((part for beginning, part in FILES.items() if name.startswith(beginning)), "")


def without(scene: Scene, term: str) -> Scene | None:
    """Return a scene without a term; None where it has none. `term`: key of `TERMS`, or `LONGER`."""
    if term == LONGER:
        simulation = replace(scene.simulation, physics_step=scene.simulation.control_period)
        return None if simulation == scene.simulation else replace(scene, simulation=simulation)
    section = TERMS[term]
    return scene.with_sections(**{section: None}) if any(scene.list_parts(section)) else None


def measure_terms(arguments: Namespace, steps: Steps) -> Report:
    """Leave out every term by itself, then all of them."""
    scene, _ = scene_of(arguments)
    if arguments.quick:
        simulation = replace(scene.simulation, duration=min(scene.simulation.duration, 2.0))
        scene = replace(scene, simulation=simulation)
    full = solve(scene)
    scenes, rest = {"the full scene": scene}, scene
    for term in (*TERMS, LONGER):
        less = without(scene, term)
        if less is not None:
            scenes[f"without {term}" if term in TERMS else term] = less
            rest = without(rest, term) or rest
    if rest is not scene:
        scenes["all of these"] = rest
    repeats = 1 if arguments.quick else 3
    rows = [
        {"scene": name, **_compare(scenes[name], full, repeats)}
        for name in steps.through(list(scenes))
    ]
    title = (
        f"\n{scene.name}: {scene.cells} cells, {scene.periods} control periods of "
        f"{scene.simulation.control_period * 1e3:g} ms.\n"
        "Cost, and the largest difference of a height and of the total force from the full scene: under\n"
        "the commands recorded there, and live. The cost of the recorder is in `benchmarks session`.\n"
    )
    return Report([title, *tabulate(rows, EFFECTS)], rows, name=f"terms_{scene.name}")


def _compare(scene: Scene, full: list[Floats], repeats: int) -> Record:
    """Return a scene's cost, and its differences from the full one, m and N."""
    system = assemble(scene)
    calls = period_calls(system, scene.trajectories(), min(scene.periods, 400))[0]
    (spent,) = time_by_turns([partial(simulate, system, scene, scene.periods)], repeats)
    replayed, live = (
        [float(np.abs(values - exact).max()) for values, exact in zip(run[:2], full, strict=False)]
        for run in (solve(scene, full[2]), solve(scene))
    )
    return {
        "calls": statistics.median(calls),
        "seconds": spent / scene.periods,
        "bytes": 8 * system.rows.count,
        "replayed_m": replayed[0],
        "replayed_N": replayed[1],
        "live_m": live[0],
        "live_N": live[1],
    }
