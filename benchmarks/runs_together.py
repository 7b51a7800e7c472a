"""Benchmark ``stack``: sessions a second, alone and in a batch."""

import argparse
from dataclasses import replace
from typing import Any

from digiclay.commands.arguments import scene_of
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.evaluation import evaluate

from .report import Curves, Report, Row, Steps, Work, tabulate, time_by_turns

#: Runs in one call; a sweep puts 32 to 63 together.
COUNTS = (1, 4, 16, 32, 64, 128)
#: Simulated time of a run, s.
DURATION = 4.0
#: Goal of the runs a second, over those of one run at a time.
GOAL = 8.0
#: What varies from run to run: section, key, and from which to which share of its value. The first
#: leaves the cells alike, the second does not.
STUDIES: dict[str, tuple[str, str, float, float]] = {
    "control": ("control", "force_gain", 0.5, 1.2),
    "device": ("valve", "stroke", 0.9, 1.2),
}
#: Columns of the tables: runs a second.
COLUMNS = {
    "": "what",
    "runs": "runs d",
    "alone": "alone .3g",
    "in one call": "together .3g",
    "times": "times .1f",
}


def study(scene: Scene, name: str, count: int) -> list[Scene]:
    """Return `count` runs of a study, a key of `STUDIES`: a parameter of the scene spread evenly."""
    section, key, low, high = STUDIES[name]
    part: Any = scene.section(section)
    shares = [low + (high - low) * (i + 0.5) / count for i in range(count)]
    return [
        scene.with_sections(**{section: replace(part, **{key: getattr(part, key) * s})})
        for s in shares
    ]


def _compare(scene: Scene, name: str, count: int, repeats: int) -> list[Row]:
    """Run a study; return the runs a second of each kind of work, one run alone and all in one call."""
    scenes = study(scene, name, count)
    plain = study(replace(scene, recorder=None), name, count)
    middle, bare = scenes[count // 2], plain[count // 2]
    works: dict[str, tuple[Work, Work]] = {
        "simulated": (lambda: run(bare), lambda: list(run_together(plain))),
        "recorded and judged": (lambda: evaluate(middle), lambda: list(measure_together(scenes))),
        "errors estimated too": (
            lambda: evaluate(middle, errors=True),
            lambda: list(measure_together(scenes, errors=True)),
        ),
    }
    rows: list[Row] = []
    for what, pair in works.items():
        single, all_runs = time_by_turns(pair, repeats)
        speeds = {
            "alone": 1.0 / single,
            "together": count / all_runs,
            "times": count * single / all_runs,
        }
        rows.append({"study": name, "runs": count, "what": what, **speeds})
    return rows


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every study and size."""
    scene, _ = scene_of(arguments)
    duration = min(scene.simulation.duration, 1.0 if arguments.quick else DURATION)
    scene = replace(scene, simulation=replace(scene.simulation, duration=duration))
    counts, repeats = (COUNTS[:3], 1) if arguments.quick else (COUNTS, 3)
    jobs = [(name, count) for name in STUDIES for count in counts]
    rows = [
        row
        for job in steps.through(jobs, lambda job: f"{job[1]} runs")
        for row in _compare(scene, *job, repeats)
    ]
    lines = [
        f"\nThe first {duration:g} s of {scene.name}: {scene.periods} control periods,",
        f"{scene.cells} cells; CPU time of one core, runs a second; medians, taken in turns.",
        "recorded and judged: as digiclay sweep does.",
    ]
    panels = {}
    for name, (section, key, _, _) in STUDIES.items():
        of_study = [row for row in rows if row["study"] == name]
        lines += [f"\n{section}.{key} varies", *tabulate(of_study, COLUMNS)]
        panels[f"{section}.{key} varies"] = {"goal": [(float(count), GOAL) for count in counts]} | {
            what: [(row["runs"], row["times"]) for row in of_study if row["what"] == what]
            for what in dict.fromkeys(row["what"] for row in rows)
        }
    return Report(
        lines, rows, Curves(panels, "runs in one call", "runs a second, to one at a time")
    )
