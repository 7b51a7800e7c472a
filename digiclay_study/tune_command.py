"""``digiclay tune``: Pareto front of two metrics of a scene over ranges of its parameters."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.commands.arguments import add_command
from digiclay.commands.progress import format_duration
from digiclay.commands.stop import STOPPED, Stop, refuse_without
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.files.run_folder import write_whole
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.studies.axes import Point
from digiclay.core.studies.evaluation import FIGURES, Record, find_figure, make_bundles
from digiclay.core.studies.sweep_plan import Folder
from digiclay.plots.sweep import read_unit

from .point_series import (
    UNCHANGED,
    Subject,
    add_subject,
    describe_stop,
    make_points,
    open_evaluation,
    open_folder,
    read_count,
    read_subject,
    refuse_too_many,
    write_points,
)
from .trials import find_knee, judge_trials, propose_generations

EXAMPLES = """\
examples:
  digiclay tune slow_press --vary control.force_gain=0.5:8:log --vary control.travel=1e-3:4e-3 --out tuned
  digiclay tune my.toml --vary control.force_gain=1:6 --generations 20 --choose lag --out tuned
  digiclay run tuned/chosen.toml

NSGA-II minimizes both metrics. The folder holds front.png, front.csv, points.csv with every run,
chosen.toml, a scene file, and points/, a small file for each finished run. After Ctrl-C the same
command continues; with more --generations it goes on further.
"""
METRICS = "rfd,lag"
KNEE = "knee"


def add(commands: Any) -> None:
    """Add the command."""
    said = "Find the best trade-off of two metrics: their Pareto front over ranges of parameters."
    parser = add_command(commands, "tune", "find the best trade-off of two metrics", EXAMPLES, said)
    add_subject(parser, METRICS)
    parser.add_argument(
        "--population",
        metavar="N",
        type=read_count(4, 4096),
        default=64,
        help="runs a generation; default: 64",
    )
    parser.add_argument(
        "--generations", metavar="N", type=read_count(1, 4096), default=10, help="default: 10"
    )
    parser.add_argument(
        "--choose", metavar="M", default=KNEE,
        help="what is chosen on the front: knee, or the metric that is to be least; default: knee",
    )  # fmt: skip
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run what is not done yet, and write tables, plot and the chosen scene."""
    for module in ("optuna", "matplotlib"):
        refuse_without(module, "digiclay tune", "pip install digiclay[study]")
    subject = read_subject(arguments)
    if len(subject.names) != 2:
        raise ParameterError("--metric", "", "must name two metrics", repr(arguments.metric))
    choice = _read_choice(arguments.choose, subject.names)
    total = arguments.population * arguments.generations + 1
    refuse_too_many("--population times --generations", total)
    plan = {"metrics": list(subject.names), "population": arguments.population, "seed": arguments.seed}
    with open_folder(arguments.out, "tuning", subject, plan) as folder:
        with Stop() as stop:
            points, records = _evolve(arguments, subject, folder, total, stop)
            if len(points) + 1 < total:
                if not arguments.quiet:
                    print(describe_stop(folder.path, len(records), total))
                return STOPPED
        lines = _write(arguments, subject, points, records, choice)
        if not arguments.quiet:
            print(*lines, f"written to {arguments.out}", sep="\n")
    return 0


def _read_choice(word: str, names: Sequence[str]) -> str:
    """Return what is chosen on the front: the knee, or the least of a metric, by its full name."""
    with suppress(ParameterError):
        if word == KNEE or (word := find_figure(word)) in names:
            return word
    raise ParameterError("--choose", "", f"must be {KNEE}, {' or '.join(names)}", repr(word))


def _evolve(
    arguments: argparse.Namespace, subject: Subject, folder: Folder, total: int, stop: Stop
) -> tuple[list[Point], dict[int, Record]]:
    """Evaluate all generations, of which what is kept is not run again; return their points, and all records.

    After a stop the generation that is not complete is missing.

    Raises OutputError when no worker survives a point: without it the next generation would be another one.
    """
    size, done = arguments.population, list[Point]()
    generations = propose_generations(len(subject.ranges), size, arguments.seed)
    with open_evaluation(arguments, "tune", subject, folder, -(-size // 4), total, stop) as evaluation:
        unchanged = evaluation.evaluate_unchanged()
        if unchanged is None:
            return done, evaluation.records
        left = total - len(evaluation.records)
        if left > 0 and not arguments.quiet:
            time = format_duration(left * unchanged["figures"]["run_time"])
            print(
                f"{left} runs: about {time} of one core if each is run by itself, less in batches", flush=True
            )
        shares = next(generations)
        while True:
            points = make_points(subject, shares, len(done) + 1)
            _refuse_others(folder, subject, points, evaluation.records)
            bundles = make_bundles(points, errors=subject.errors)
            failed = evaluation.evaluate((*bundles.batches, *bundles.alone), subject.keys)
            if failed:
                why = next(iter(failed.values()))["error"]
                raise OutputError(f"{why} What is done is kept, and the same command goes on from there.")
            if any(point.index not in evaluation.records for point in points):
                return done, evaluation.records
            done += points
            if len(done) + 1 == total:
                return done, evaluation.records
            found = [evaluation.records[point.index] for point in points]
            shares = generations.send(judge_trials(subject.names, found, unchanged).outcomes)


def _refuse_others(
    folder: Folder, subject: Subject, points: Sequence[Point], records: Mapping[int, Record]
) -> None:
    """Refuse records of other points, as another version of optuna would have proposed them."""
    for point in points:
        own = dict(zip(subject.keys, point.words, strict=True))
        if records.get(point.index, {}).get("values", own) != own:
            rule = "holds points of another version of optuna"
            raise OutputError(f"{folder.path} {rule}: choose another folder with --out.")


def _write(
    arguments: argparse.Namespace,
    subject: Subject,
    points: Sequence[Point],
    records: Mapping[int, Record],
    choice: str,
) -> list[str]:
    """Write the files; return lines for a person."""
    from digiclay.plots.figure import save

    from .study_plots import draw_front

    every = (Point(UNCHANGED, (), subject.scene), *points)
    trials = judge_trials(subject.names, [records[point.index] for point in every], records[UNCHANGED])
    front = trials.find_front()
    knee = find_knee(trials.values[front])
    least = {name: int(np.argmin(trials.values[front, i])) for i, name in enumerate(subject.names)}
    chosen = int(front[{KNEE: knee, **least}[choice]])
    out: Path = arguments.out
    write_points(out / "points.csv", subject, every, records)
    write_points(out / "front.csv", subject, [every[index] for index in front], records)
    said = _describe(subject.names, trials.values[chosen])
    text = f"Chosen by digiclay tune from {len(points)} runs, {choice} of the front: {said}"
    scene = every[chosen].scene
    assert scene is not None  # a point on the front has been run
    scene = replace(scene, name=f"{subject.scene.name}_tuned", description=text)
    write_whole(out / "chosen.toml", format_scene(scene).encode())
    title = f"Force deviation and lag of {subject.scene.name}"
    if subject.names != tuple(find_figure(word) for word in METRICS.split(",")):
        title = f"{subject.names[0]} and {subject.names[1]} of {subject.scene.name}"
    figure = draw_front(subject.names, trials.values, trials.sound, front, chosen, title)
    save(figure, out / "front.png")
    worse = np.all(trials.values[front] <= trials.values[UNCHANGED], axis=1) & (front != UNCHANGED)
    own = _describe(subject.names, trials.values[UNCHANGED])
    values = ", ".join(
        f"{key} = {word}" for key, word in zip(subject.keys, every[chosen].words, strict=False)
    )
    lost = int(np.count_nonzero(~trials.sound[1:]))
    return [
        f"{len(points)} runs, {lost} of them failed or lost the fingertip; on the front: {len(front)}",
        f"unchanged scene: {own}; better in both: {np.count_nonzero(worse)} of the front",
        f"chosen ({choice}): {said}; {values or 'the unchanged scene'}",
    ]


def _describe(names: Sequence[str], values: Any) -> str:
    """Return two outputs in the units people read."""
    parts = []
    for name, value in zip(names, values, strict=True):
        factor, unit = read_unit(FIGURES[name].unit, [value])
        parts.append(f"{name} {value * factor:.4g} {unit}".strip())
    return ", ".join(parts)
