"""``digiclay benchmark session``: what a session costs, as a whole and by part."""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any, NamedTuple

from ..core import simulation
from ..core.assembly import assemble
from ..core.recorder import Recorder, Recording
from ..core.scene import Scene
from ..core.session import fits
from .arguments import add_scene, scene_of
from .benchmark_report import made_with
from .progress import Bar

__all__ = ["PARTS", "Clock", "Took", "add", "measured"]

#: Parts of a control period and what is in them.
PARTS = {
    "contact": "the finger's poses, the cells under it, their forces",
    "control": "locate, lead, blister, a command for each cell",
    "integrate": "valves, pins and the pulp over a period",
    "observe": "a row of the history",
    "the rest": "gathering the cells that move, and putting them back",
}
#: What the simulation's own functions belong to.
TIMED = {"approaches": "contact", "_underside": "contact", "_moved": "integrate"}
EXAMPLES = """\
examples:
  digiclay benchmark session
  digiclay benchmark session --scene tap --repeats 9
  digiclay benchmark session --calls
"""


class Took(NamedTuple):
    """What a session took, s: time gone by, and processor time, which other processes hardly add to."""

    gone: float
    used: float


class Clock:
    """Adds up the time spent in functions, by part."""

    def __init__(self) -> None:
        self.spent = dict.fromkeys(PARTS, 0.0)

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return `function`, timed."""
        spent = self.spent

        def counted(*arguments: Any) -> Any:
            started = perf_counter()
            try:
                return function(*arguments)
            finally:
                spent[part] += perf_counter() - started

        return counted

    def on(self, part: str, value: Any, *methods: str) -> Any:
        """Return a copy of `value` of which some methods are timed; it remains of the same class."""
        kind = type(value)
        own = {name: self.timed(part, getattr(kind, name)) for name in methods}
        copy: Any = object.__new__(type(kind.__name__, (kind,), own))
        vars(copy).update(vars(value))
        return copy


def add(kinds: Any) -> None:
    """Add the benchmark."""
    session = kinds.add_parser(
        "session", help="one session, on one core", description="Time one session.", epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    add_scene(session, default="ridge_mound_valley")
    session.add_argument(
        "--repeats", metavar="N", type=_repeats, default=3, help="the median counts; default 3"
    )
    session.add_argument("--calls", action="store_true", help="count numpy's calls, and what they alone cost")
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
    fits(scene, assemble(scene))
    plain: list[Took] = []
    split: list[dict[str, float]] = []
    with Bar(sys.stderr, "repeats", 1.0) as bar:
        for repeat in range(arguments.repeats):
            plain.append(measured(scene))
            clock = Clock()
            clock.spent["the rest"] = measured(scene, clock).gone - sum(clock.spent.values())
            split.append(clock.spent)
            if not arguments.quiet:
                bar(repeat + 1, arguments.repeats)
    print("\n".join(_table(scene, plain, split)))
    if arguments.calls:
        from .benchmark_calls import report

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
    yield f"  {'all':<10} {total / scene.periods * 1e6:11.1f}         with the clock running"
    yield f"  {'all':<10} {whole / scene.periods * 1e6:11.1f}         without it"


def measured(scene: Scene, clock: Clock | None = None) -> Took:
    """Run a session as `core.session.run` does and return how long it took.

    Parameters
    ----------
    scene : Scene
    clock : Clock, optional
        Takes down what each part took.
    """
    system, trajectory = assemble(scene), scene.trajectory.trajectory()
    state = simulation.begin(system)
    observe = Recording(scene.recorder or Recorder(), system.rows, state, scene.periods).observe
    if clock:
        if system.controller:
            system = replace(system, controller=clock.on("control", system.controller, "attend", "command"))
        trajectory = clock.on("contact", trajectory, "poses")
        observe = clock.timed("observe", observe)
    with _timed(clock):
        started = perf_counter(), process_time()
        for reached in simulation.periods(system, trajectory, state, scene.periods):
            observe(reached)
        return Took(perf_counter() - started[0], process_time() - started[1])


@contextmanager
def _timed(clock: Clock | None) -> Iterator[None]:
    """Time the simulation's own functions for as long as the block lasts."""
    if clock is None:
        yield
        return
    former = {name: getattr(simulation, name) for name in TIMED}
    try:
        for name, function in former.items():
            setattr(simulation, name, clock.timed(TIMED[name], function))
        yield
    finally:
        for name, function in former.items():
            setattr(simulation, name, function)
