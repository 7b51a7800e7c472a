"""``python -m benchmarks session``: time of a session and of its parts."""

from __future__ import annotations

import argparse
import cProfile
import statistics
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from time import perf_counter, process_time
from types import CodeType
from typing import Any, NamedTuple

from digiclay import core
from digiclay.commands.arguments import add_scene, scene_of
from digiclay.commands.progress import Bar
from digiclay.core.engine import simulation
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder, RunRecording
from digiclay.core.scene.schema import Scene
from digiclay.core.session.memory_limit import check_memory

from .report import made_with

#: Parts of a control period and what is in them.
PARTS = {
    "contact": "the finger's poses, its underside over the cells",
    "control": "locate, lead, blister, a command for each cell",
    "integrate": "valves, pins and the pulp over a period",
    "observe": "a row of the history",
    "the rest": "gathering the cells that move, and putting them back",
}
#: The part that files of the core belong to, by how their path below it begins. What a function takes counts
#: for its file's part; what functions of other files take (numpy's, small helpers) counts for who calls them.
FILES = {
    "model/trajectory": "contact", "model/touch": "contact", "model/fingertip": "contact",
    "control/": "control", "model/sensors": "control",
    "steppers/": "integrate", "model/": "integrate",
    "scene/recorder": "observe",
    "engine/": "the rest",
}  # fmt: skip
CORE = Path(core.__file__).parent
EXAMPLES = """\
examples:
  python -m benchmarks session
  python -m benchmarks session --scene tap --repeats 9
  python -m benchmarks session --calls
"""


class Took(NamedTuple):
    """Elapsed time and processor time of a session, s; other processes hardly affect the latter."""

    gone: float
    used: float


def add(kinds: Any) -> None:
    """Add the benchmark."""
    session = kinds.add_parser(
        "session", help="one session, on one core", description="Time one session.", epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    add_scene(session, default="ridge_mound_valley")
    session.add_argument(
        "--repeats",
        metavar="N",
        type=_repeats,
        default=3,
        help="number of runs, of which the median counts; default: 3",
    )
    session.add_argument(
        "--calls", action="store_true", help="count numpy's calls, and measure their time alone"
    )
    session.add_argument("--quiet", action="store_true", help="no progress")
    session.set_defaults(carry_out=carry_out)


def _repeats(text: str) -> int:
    """Read how often to repeat."""
    if not text.isdecimal() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to 1000 (got {text!r})")
    return int(text)


def carry_out(arguments: argparse.Namespace) -> int:
    """Time the session and print the table."""
    scene, _ = scene_of(arguments)
    check_memory(scene, assemble(scene).rows)
    plain: list[Took] = []
    split: list[dict[str, float]] = []
    with Bar(sys.stderr, "repeats", 1.0) as bar:
        for repeat in range(arguments.repeats):
            plain.append(measured(scene))
            profile = cProfile.Profile(builtins=False)
            split.append(shares(profile, measured(scene, profile).gone))
            if not arguments.quiet:
                bar(repeat + 1, arguments.repeats)
    print("\n".join(_table(scene, plain, split)))
    if arguments.calls:
        from .numpy_calls import report

        print("\n" + "\n".join(report(scene)))
    return 0


def _table(scene: Scene, plain: list[Took], split: list[dict[str, float]]) -> Iterator[str]:
    """Give the lines of the table."""
    simulated = scene.periods * scene.simulation.control_period
    whole, used = (statistics.median(times) for times in zip(*plain, strict=True))
    yield made_with()
    yield f"{scene.name}: {scene.cells} cells, {scene.periods} control periods, {scene.simulation.stepper}"
    factor = simulated / whole
    yield f"{simulated:.1f} s simulated in {whole:.3g} s ({factor:.3g} x real time), median of {len(split)}"
    yield f"processor time {used:.3g} s ({simulated / used:.3g} x real time)"
    yield f"\n  {'part':<10} {'µs a period':>11} {'share':>6}"
    medians = {part: statistics.median(one[part] for one in split) for part in PARTS}
    total = sum(medians.values())
    for part, meaning in PARTS.items():
        each, share = medians[part] / scene.periods * 1e6, medians[part] / total
        yield f"  {part:<10} {each:11.1f} {share:6.0%}  {meaning}"
    yield f"  {'all':<10} {total / scene.periods * 1e6:11.1f}         with the profiler running"
    yield f"  {'all':<10} {whole / scene.periods * 1e6:11.1f}         without it"


def measured(scene: Scene, profile: cProfile.Profile | None = None) -> Took:
    """Run a session as `core.session.run_scene.run` does and return how long it took.

    `profile`: takes down what each function took.
    """
    system, trajectories = assemble(scene), scene.trajectories()
    state = simulation.begin(system)
    observe = RunRecording(scene.recorder or Recorder(), system.rows, state, scene.periods).observe
    with profile or nullcontext():
        started = perf_counter(), process_time()
        for reached in simulation.periods(system, trajectories, state, scene.periods):
            observe(reached)
        return Took(perf_counter() - started[0], process_time() - started[1])


def shares(profile: cProfile.Profile, whole: float) -> dict[str, float]:
    """Return what each of the parts took, s.

    `profile`: of `measured`; `whole`: what all of it took, s; what no function of a part took is `the rest`.
    """
    spent = dict.fromkeys(PARTS, 0.0)
    for entry in profile.getstats():
        part = part_of(entry.code)
        if part:
            called = sum(below.totaltime for below in entry.calls or () if not part_of(below.code))
            spent[part] += entry.inlinetime + called
    spent["the rest"] = whole - sum(time for part, time in spent.items() if part != "the rest")
    return spent


def part_of(code: CodeType | str) -> str:
    """Return the part that a function's file belongs to; none: an empty text."""
    file = Path("" if isinstance(code, str) else code.co_filename)
    if not file.is_relative_to(CORE):
        return ""
    name = file.relative_to(CORE).as_posix()
    return next((part for beginning, part in FILES.items() if name.startswith(beginning)), "")
