"""Benchmark ``stack``: sessions a second, alone and in a batch."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from digiclay.commands.arguments import scene_of
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.evaluation import evaluate

from .report import Curves, Report, Row, Steps, tabulate

#: Runs in one call; a sweep puts 32 to 63 together.
COUNTS = (1, 4, 16, 32, 64, 128)
#: Simulated time of a run, s.
DURATION = 4.0
#: Time between two measurements, s: the linear algebra library keeps its threads busy for a while.
REST = 0.15
#: Goal of the runs a second, over those of one run at a time.
GOAL = 6.0
#: What varies from run to run: section, key, and from which to which share of its value. The first leaves the
#: cells alike, the second does not.
STUDIES: dict[str, tuple[str, str, float, float]] = {
    "control": ("control", "force_gain", 0.5, 1.2),
    "device": ("valve", "stroke", 0.9, 1.2),
}
#: Processor time of a run, s, alone and in one call: simulated only; recorded and judged, as in a sweep; with
#: the integration's errors estimated too.
TIMES = ("alone", "stacked", "judged_alone", "judged_stacked", "errors_alone", "errors_stacked")
#: What the text says of each pair of them, and the picture.
PAIRS = {"": "simulated", "judged": "recorded and judged", "errors": "errors estimated too"}


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


def _compare(scene: Scene, name: str, count: int, repeats: int) -> dict[str, Any]:
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
    medians = map(statistics.median, zip(*spent, strict=True))
    return {"study": name, "runs": count, **dict(zip(TIMES, medians, strict=True))}


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every study and size."""
    scene, _ = scene_of(arguments)
    duration = min(scene.simulation.duration, 1.0 if arguments.quick else DURATION)
    scene = replace(scene, simulation=replace(scene.simulation, duration=duration))
    counts, repeats = (COUNTS[:3], 1) if arguments.quick else (COUNTS, 5)
    jobs = [(name, count) for name in STUDIES for count in counts]
    sizes = [_compare(scene, *job, repeats) for job in steps.through(jobs, lambda job: f"{job[1]} runs")]
    panels = {
        f"{section}.{key} varies": _list_points([size for size in sizes if size["study"] == name])
        for name, (section, key, _, _) in STUDIES.items()
    }
    curves = Curves(panels, "runs in one call", "runs a second, to one at a time")
    return Report(list(_list_lines(scene, sizes)), sizes, curves)


def _list_points(sizes: Sequence[Row]) -> dict[str, list[tuple[float, float]]]:
    """Return the runs in one call, and their rate over that of one run alone, by pair of times, and goal."""
    lines = {
        label: [(size["runs"], size[alone] / size[stacked]) for size in sizes]
        for label, alone, stacked in zip(PAIRS.values(), TIMES[::2], TIMES[1::2], strict=True)
    }
    return lines | {"goal": [(size["runs"], GOAL) for size in sizes]}


def _list_lines(scene: Scene, sizes: Sequence[Row]) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"\nThe first {scene.simulation.duration:g} s of {scene.name}: {scene.periods} control periods,"
    yield f"{scene.cells} cells; CPU time of one core, runs a second; medians, taken in turns."
    yield "judged: recorded and judged, as digiclay sweep does;"
    yield "errors: the integration's errors estimated as well."
    columns = {"runs": "runs d"}
    for pair, alone, stacked in zip(PAIRS, TIMES[::2], TIMES[1::2], strict=True):
        label = f"{pair}: " if pair else ""
        columns |= {f"{label}alone": f"{alone} .3g", f"{label}in one call": f"{stacked} .3g"}
        columns |= {f"{label}times": f"{alone}/{stacked} .1f"}
    for name, (section, key, _, _) in STUDIES.items():
        yield f"\n{section}.{key} varies"
        yield from tabulate([_rates(size) for size in sizes if size["study"] == name], columns, left=0)


def _rates(size: Row) -> dict[str, float]:
    """Return the runs a second of each kind, and the ratio of each pair."""
    rates = {"runs": size["runs"], **{name: 1.0 / size[name] for name in TIMES}}
    return rates | {f"{a}/{b}": size[a] / size[b] for a, b in zip(TIMES[::2], TIMES[1::2], strict=True)}
