"""Benchmark ``session``: time of a session and of its parts."""

from __future__ import annotations

import argparse
import cProfile
import statistics
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from time import perf_counter, process_time
from types import CodeType
from typing import NamedTuple

from digiclay import core
from digiclay.commands.arguments import scene_of
from digiclay.core.engine import simulation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder, RunRecording
from digiclay.core.scene.schema import Scene
from digiclay.core.session.memory_limit import check_memory

from .numpy_calls import list_calls
from .report import Report, Steps

#: Parts of a control period and what is in them.
PARTS = {
    "contact": "the fingertip's poses, its underside over the cells",
    "control": "locate, lead, blister, a command for each cell",
    "integrate": "valves, pins and the pulp over a period",
    "observe": "a row of the history",
    "the rest": "gathering the cells that move, and putting them back",
}
#: Part of the core's files, by the beginning of their path. A function's time counts for its file's part;
#: that of functions of other files (numpy's, small helpers) for their callers'.
FILES = {
    "model/trajectory": "contact", "model/touch": "contact", "model/fingertip": "contact",
    "control/": "control", "model/sensors": "control",
    "steppers/": "integrate", "model/": "integrate",
    "scene/recorder": "observe",
    "engine/": "the rest",
}  # fmt: skip
CORE = Path(core.__file__).parent


class Took(NamedTuple):
    """Elapsed time and processor time of a session, s; other processes hardly affect the latter."""

    elapsed: float
    processor: float


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Time the session, with the profiler and without."""
    scene, _ = scene_of(arguments)
    check_memory(scene, assemble(scene).rows)
    plain, split = [], []
    for _ in steps.through(range(arguments.repeats)):
        plain.append(time_session(scene))
        profile = cProfile.Profile(builtins=False)
        split.append(divide_time(profile, time_session(scene, profile).elapsed))
    lines = list(_list_lines(scene, plain, split))
    return Report([*lines, "", *list_calls(scene)] if arguments.calls else lines)


def _list_lines(scene: Scene, plain: list[Took], split: list[dict[str, float]]) -> Iterator[str]:
    """Give the lines of the report."""
    simulated = scene.periods * scene.simulation.control_period
    whole, processor = (statistics.median(times) for times in zip(*plain, strict=True))
    yield f"{scene.name}: {scene.cells} cells, {scene.periods} control periods, {scene.simulation.stepper}"
    factor = simulated / whole
    yield f"{simulated:.1f} s simulated in {whole:.3g} s ({factor:.3g} x real time), median of {len(split)}"
    yield f"processor time {processor:.3g} s ({simulated / processor:.3g} x real time)"
    yield f"\n  {'part':<10} {'µs a period':>11} {'share':>6}"
    medians = {part: statistics.median(times[part] for times in split) for part in PARTS}
    total = sum(medians.values())
    for part, meaning in PARTS.items():
        each, share = medians[part] / scene.periods * 1e6, medians[part] / total
        yield f"  {part:<10} {each:11.1f} {share:6.0%}  {meaning}"
    yield f"  {'all':<10} {total / scene.periods * 1e6:11.1f}         with the profiler running"
    yield f"  {'all':<10} {whole / scene.periods * 1e6:11.1f}         without it"


def time_session(scene: Scene, profile: cProfile.Profile | None = None) -> Took:
    """Run a session as `core.session.run_scene.run` does; return its times."""
    system, trajectories = assemble(scene), scene.trajectories()
    state = simulation.begin(system)
    observe = RunRecording(scene.recorder or Recorder(), system.rows, state, scene.periods).observe
    with profile or nullcontext():
        started = perf_counter(), process_time()
        for reached in simulation.periods(system, trajectories, state, scene.periods):
            observe(reached)
        return Took(perf_counter() - started[0], process_time() - started[1])


def divide_time(profile: cProfile.Profile, whole: float) -> dict[str, float]:
    """Return the time of each part, s; what no function of a part took of the `whole` is `the rest`."""
    spent = dict.fromkeys(PARTS, 0.0)
    for entry in profile.getstats():
        part = _find_part(entry.code)
        if part:
            called = sum(below.totaltime for below in entry.calls or () if not _find_part(below.code))
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
