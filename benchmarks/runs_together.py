"""Benchmark ``stack``: sessions a second, alone and in a batch."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from digiclay.commands.arguments import scene_of
from digiclay.commands.progress import table
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.evaluation import evaluate
from digiclay.plots.figure import empty

from .report import BLUE, RED, STYLE, Report, Steps, list_records

#: Runs in one call; a sweep puts 32 to 63 together.
COUNTS = (1, 4, 16, 32, 64, 128)
#: Simulated time of a run, s.
DURATION = 4.0
#: Time between two measurements, s: the linear algebra library keeps its threads busy for a while.
REST = 0.15
#: What varies from run to run: section, key, and from which to which share of its value. The first leaves the
#: cells alike, the second does not.
STUDIES: dict[str, tuple[str, str, float, float]] = {
    "control": ("control", "force_gain", 0.5, 1.2),
    "device": ("valve", "stroke", 0.9, 1.2),
}


@dataclass(frozen=True)
class Size:
    """CPU time of a run, alone and in a batch of one size, s.

    Attributes
    ----------
    alone, stacked : float
        Simulated only.
    judged_alone, judged_stacked : float
        Recorded and judged, as in a sweep.
    errors_alone, errors_stacked : float
        The same with the integration's errors estimated, as in a sweep that is asked for them.
    """

    study: str
    runs: int
    alone: float
    stacked: float
    judged_alone: float
    judged_stacked: float
    errors_alone: float
    errors_stacked: float

    @property
    def pairs(self) -> tuple[tuple[float, float], ...]:
        """Times alone and in the batch: simulated, judged, errors estimated."""
        judged, errors = (self.judged_alone, self.judged_stacked), (self.errors_alone, self.errors_stacked)
        return (self.alone, self.stacked), judged, errors


def study(scene: Scene, name: str, count: int) -> list[Scene]:
    """Return `count` runs of a study, a key of `STUDIES`: a parameter of the scene spread evenly."""
    section, key, low, high = STUDIES[name]
    part: Any = scene.section(section)
    shares = [low + (high - low) * (i + 0.5) / count for i in range(count)]
    return [scene.with_sections(**{section: replace(part, **{key: getattr(part, key) * s})}) for s in shares]


def _time(work: Callable[[], Any]) -> float:
    """Return the CPU time of some work, s, once what was before it has come to rest."""
    time.sleep(REST)
    started = time.process_time()
    work()
    return time.process_time() - started


def _compare(scene: Scene, name: str, count: int, repeats: int) -> Size:
    """Run a study; the medians of the repeats count.

    One run alone and all in one call take turns, so that what else the machine does befalls both alike.
    """
    scenes = study(scene, name, count)
    plain = study(replace(scene, recorder=None), name, count)
    middle, bare = scenes[count // 2], plain[count // 2]
    works: list[tuple[Callable[[], Any], int]] = [
        (lambda: run(bare), 1),
        (lambda: list(run_together(plain)), count),
        (lambda: evaluate(middle), 1),
        (lambda: list(measure_together(scenes)), count),
        (lambda: evaluate(middle, errors=True), 1),
        (lambda: list(measure_together(scenes, errors=True)), count),
    ]
    spent = [[_time(work) / runs for work, runs in works] for _ in range(repeats)]
    return Size(name, count, *(statistics.median(column) for column in zip(*spent, strict=True)))


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every study and size."""
    scene, _ = scene_of(arguments)
    duration = min(scene.simulation.duration, 1.0 if arguments.quick else DURATION)
    scene = replace(scene, simulation=replace(scene.simulation, duration=duration))
    counts, repeats = (COUNTS[:3], 1) if arguments.quick else (COUNTS, 5)
    jobs = [(name, count) for name in STUDIES for count in counts]
    sizes = [_compare(scene, *job, repeats) for job in steps.through(jobs, lambda job: f"{job[1]} runs")]
    return Report(_list_lines(scene, sizes), *list_records(sizes), lambda: _draw(sizes))


def _draw(sizes: Sequence[Size]) -> Any:
    """Draw the runs a second in a batch over those of one at a time, by the runs of the batch."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        for study, color, marker in (("control", BLUE, "o"), ("device", RED, "s")):
            chosen = [size for size in sizes if size.study == study]
            runs = [size.runs for size in chosen]
            gains = zip(*([alone / stacked for alone, stacked in size.pairs] for size in chosen), strict=True)
            labels = ("simulated", "recorded and judged", "errors estimated too")
            for values, line, label in zip(gains, ("-", "--", ":"), labels, strict=True):
                panel.loglog(
                    runs, values, line, color=color, marker=marker,
                    markerfacecolor=color if line == "-" else "white", label=f"{study} varies, {label}",
                )  # fmt: skip
        panel.axhline(6.0, color="#777777", linewidth=1.0, label="the goal")
        panel.set_xticks(runs, [str(count) for count in runs])
        panel.set_yticks([1, 2, 4, 6, 10, 20], ["1", "2", "4", "6", "10", "20"])
        panel.minorticks_off()
        panel.set(xlabel="runs in one call", ylabel="runs a second, to one at a time")
        panel.set_title("Many sessions in one call")
        panel.legend(loc="lower right", fontsize=8.5)
        return figure


def _list_lines(scene: Scene, sizes: Sequence[Size]) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"\nThe first {scene.simulation.duration:g} s of {scene.name}: {scene.periods} control periods,"
    yield f"{scene.cells} cells; CPU time of one core, runs a second; medians, taken in turns."
    yield "judged: recorded and judged, as digiclay sweep does;"
    yield "errors: the integration's errors estimated as well."
    three = ("alone", "in one call", "times")
    head = ("runs", *three, "judged: alone", *three[1:], "errors: alone", *three[1:])
    for name, (section, key, _, _) in STUDIES.items():
        yield f"\n{section}.{key} varies"
        yield from table(head, [_list_cells(size) for size in sizes if size.study == name], left=0)


def _list_cells(size: Size) -> list[str]:
    """Return a row of the table."""
    triples = (
        (f"{1.0 / alone:.3g}", f"{1.0 / stacked:.3g}", f"{alone / stacked:.1f}")
        for alone, stacked in size.pairs
    )
    return [str(size.runs), *(cell for triple in triples for cell in triple)]
