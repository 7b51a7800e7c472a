"""``digiclay tune``: Pareto front of two metrics over ranges of parameters, searched by optuna's NSGA-II."""

import warnings
from argparse import Namespace
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from digiclay.commands.arguments import add_command, add_options, whole_number
from digiclay.commands.evaluation_pool import Evaluation, run_series
from digiclay.commands.refusals import refuse_without
from digiclay.core.base.arrays import Cells, Flags, Floats
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.files.run_folder import write_whole
from digiclay.core.files.tables import Record
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.studies.axes import Point, find_ends
from digiclay.core.studies.evaluation import FIGURES, describe_effort, find_figure, make_bundles
from digiclay.plots.sweep import read_unit

from .indices import find_excess_losses, get_figure
from .point_series import UNCHANGED, Subject, add_subject, read_subject, refuse_too_many

EXAMPLES = """\
examples:
  digiclay tune slow_press --vary control.force_gain=0.5:8:log --vary control.travel=1e-3:4e-3 --out tuned
  digiclay tune my.toml --vary control.force_gain=1:6 --generations 20 --choose lag --out tuned
  digiclay run tuned/chosen.toml

NSGA-II minimizes both metrics. The folder holds front.png, front.csv, points.csv with every run,
chosen.toml, a scene file, and points/, a small file for each finished run. After Ctrl-C the same
command continues; with more --generations it goes further.
"""
METRICS = "rfd,lag"
KNEE = "knee"


def add(commands: Any) -> None:
    """Add the command."""
    description = (
        "Find the best trade-off of two metrics: their Pareto front over ranges of parameters."
    )
    purpose = "find the best trade-off of two metrics"
    parser = add_command(commands, "tune", purpose, EXAMPLES, description, carry_out=carry_out)
    add_subject(parser, METRICS)
    chosen = "run chosen on the front: knee, or the metric to minimize; default: knee"
    add_options(
        parser,
        {
            "--population N": (whole_number(4, 4096), "runs per generation; default: 64", 64),
            "--generations N": (whole_number(1, 4096), "default: 10", 10),
            "--choose M": (None, chosen, KNEE),
        },
    )


def carry_out(arguments: Namespace) -> int:
    """Run what is not done yet, and write tables, plot and the chosen scene."""
    refuse_without("digiclay tune", "study", "optuna", "matplotlib")
    subject = read_subject(arguments)
    if len(subject.names) != 2:
        raise ParameterError("--metric", "", "must name two metrics", repr(arguments.metric))
    for name in subject.names:
        if FIGURES[name].worse == "lower":
            rule = "must be metrics whose lower values are better: both are minimized"
            raise ParameterError("--metric", "", rule, name)
    choice = _read_choice(arguments.choose, subject.names)
    total = arguments.population * arguments.generations + 1
    refuse_too_many("--population times --generations", total)
    plan = {
        "metrics": list(subject.names),
        "population": arguments.population,
        "seed": arguments.seed,
    }
    points: list[Point] = []

    def write(records: dict[int, Record]) -> list[str]:
        return [*_write(arguments, subject, points, records, choice), f"written to {arguments.out}"]

    def evaluate(evaluation: Evaluation) -> None:
        _evolve(arguments, subject, evaluation, points)
        if len(points) + 1 == total:
            outcome = find_outcome(subject, points, evaluation.collect(), choice)
            ends = [
                outcome.every[index]
                for index in {outcome.front[0], outcome.front[-1], outcome.chosen}
            ]
            evaluation.judge([*find_ends(points, subject.keys), *ends], subject.keys)

    opened = subject.open_folder(arguments.out, "tuning", plan)
    pieces = -(-arguments.population // 4)
    return run_series(arguments, "tune", total, opened, evaluate, write, pieces=pieces)


def _read_choice(word: str, names: Sequence[str]) -> str:
    """Return what is chosen on the front: the knee, or the least of a metric, by its full name."""
    with suppress(ParameterError):
        if word == KNEE or (word := find_figure(word)) in names:
            return word
    raise ParameterError("--choose", "", f"must be {KNEE}, {' or '.join(names)}", repr(word))


def _evolve(
    arguments: Namespace, subject: Subject, evaluation: Evaluation, done: list[Point]
) -> None:
    """Evaluate all generations, or those before a stop, and add their points to those that are done."""
    generations = propose_generations(len(subject.ranges), arguments.population, arguments.seed)
    unchanged = subject.evaluate_unchanged(evaluation, quiet=arguments.quiet)
    if unchanged is None:
        return
    shares = next(generations)
    while True:
        points = subject.make_points(shares, len(done) + 1)
        _refuse_others(arguments.out, subject, points, evaluation.records)
        evaluation.finish(make_bundles(points).every, subject.keys)
        records = evaluation.collect()
        if lost := evaluation.failed.keys() - evaluation.records.keys():
            why = evaluation.failed[min(lost)]["error"]
            raise OutputError(f"{why} Finished work is kept, and the same command continues.")
        if any(point.index not in records for point in points):
            return
        done += points
        if len(done) + 1 == evaluation.total:
            return
        results = [records[point.index] for point in points]
        shares = generations.send(judge_trials(subject.names, results, unchanged))


def _refuse_others(
    folder: Path, subject: Subject, points: Sequence[Point], records: Mapping[int, Record]
) -> None:
    """Refuse records of other points, as another version of optuna would have proposed them."""
    for point in points:
        values = dict(zip(subject.keys, point.words, strict=True))
        if records.get(point.index, {}).get("values", values) != values:
            rule = "holds points of another version of optuna"
            raise OutputError(f"{folder} {rule}: choose another folder with --out.")


def _write(
    arguments: Namespace,
    subject: Subject,
    points: Sequence[Point],
    records: Mapping[int, Record],
    choice: str,
) -> list[str]:
    """Write the files; return lines for a person."""
    from digiclay.plots.figure import save

    from .study_plots import draw_front

    every, trials, front, chosen = find_outcome(subject, points, records, choice)
    out = arguments.out
    subject.write_table(out / "points.csv", every, records)
    subject.write_table(out / "front.csv", [every[index] for index in front], records)
    outputs = _describe(subject.names, trials.values[chosen])
    text = f"Chosen by digiclay tune from {len(points)} runs, {choice} of the front: {outputs}"
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
    unchanged = _describe(subject.names, trials.values[UNCHANGED])
    values = ", ".join(
        f"{key} = {word}" for key, word in zip(subject.keys, every[chosen].words, strict=False)
    )
    lost = int(np.count_nonzero(~trials.sound[1:]))
    return [
        f"{len(points)} runs, {lost} of them failed or lost the fingertip; on the front: {len(front)}",
        f"unchanged scene: {unchanged}; better in both: {np.count_nonzero(worse)} of the front",
        f"chosen ({choice}): {outputs}; {values or 'the unchanged scene'}",
        describe_effort(records),
    ]


def _describe(names: Sequence[str], values: Any) -> str:
    """Return two outputs in the units people read."""
    parts = []
    for name, value in zip(names, values, strict=True):
        factor, unit = read_unit(FIGURES[name].unit, [value])
        parts.append(f"{name} {value * factor:.4g} {unit}".strip())
    return ", ".join(parts)


def find_front(values: Floats) -> Cells:
    """Return the points that no other dominates, ordered by the first output.

    A point dominates another if it is at most as large in both outputs, and less in one. Of equal
    points the first one is returned.
    """
    valid = np.flatnonzero(~np.isnan(values).any(axis=1))
    order = valid[np.lexsort((values[valid, 1], values[valid, 0]))]
    second = values[order, 1]
    front: Cells = order[second < np.append(np.inf, np.minimum.accumulate(second)[:-1])]
    return front


def find_knee(front: Floats) -> int:
    """Return the index of the point of a front that is farthest below the line between its ends.

    With both outputs scaled to 0 to 1 over the front, the ends are (0, 1) and (1, 0), and that
    point has the least sum. It is the place where less of one output begins to cost much of the
    other.
    """
    extent = np.ptp(front, axis=0)
    scaled = (front - front.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    return int(np.argmin(scaled.sum(axis=1)))


#: Violation of a run without outputs: more than any loss of contact, which is a share.
WITHOUT = 2.0


class Trials(NamedTuple):
    """Outputs of runs."""

    #: (points, 2), SI, to be minimized; infinite in both where a run has no such outputs.
    values: Floats
    #: (points,), by how much the loss of contact exceeds what is allowed, 0 for a run that keeps
    #: the fingertip, and `WITHOUT` for one without outputs.
    violation: Floats

    @property
    def sound(self) -> Flags:
        """Which runs keep the fingertip, shape (points,)."""
        return self.violation <= 0.0

    def find_front(self) -> Cells:
        """Return the runs on the front, ordered by the first output."""
        front = find_front(np.where(self.sound[:, None], self.values, np.nan))
        if not front.size:
            raise OutputError(
                "No run has both metrics without losing the fingertip: there is no front."
            )
        return front


class Outcome(NamedTuple):
    """Outcome of a tuning: all points, the unchanged scene first, their outputs, and places in the list."""

    every: Sequence[Point]
    trials: Trials
    front: Cells
    chosen: int


def find_outcome(
    subject: Subject, points: Sequence[Point], records: Mapping[int, Record], choice: str
) -> Outcome:
    """Return the outcome of points that are done. `choice`: a metric, or the knee of the front."""
    every = [subject.unchanged, *points]
    trials = judge_trials(
        subject.names, [records[point.index] for point in every], records[UNCHANGED]
    )
    front = trials.find_front()
    knee = find_knee(trials.values[front])
    least = {name: int(np.argmin(trials.values[front, i])) for i, name in enumerate(subject.names)}
    return Outcome(every, trials, front, int(front[{KNEE: knee, **least}[choice]]))


def judge_trials(names: Sequence[str], records: Sequence[Record], reference: Record) -> Trials:
    """Return the trials that records are of."""
    values = np.array([[get_figure(record, name) for name in names] for record in records])
    excess = find_excess_losses(records, reference)
    without = np.isnan(values).any(axis=1) | np.isnan(excess)
    values[without] = np.inf
    return Trials(values, np.where(without, WITHOUT, np.maximum(excess, 0.0)))


def propose_generations(
    parameters: int, population: int, seed: int
) -> Generator[Floats, Trials, None]:
    """Yield generations without end; each is asked for with the trials of the one before.

    The same trials lead to the same generations: a search that is given kept trials from its
    beginning goes on as if it had never stopped. Of two runs that are no solution the lesser
    violation is preferred.
    """
    import optuna
    from optuna.samplers.nsgaii import PolynomialMutation, SBXCrossover

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    space: dict[str, optuna.distributions.BaseDistribution] = {
        f"x{number}": optuna.distributions.FloatDistribution(0.0, 1.0)
        for number in range(parameters)
    }
    with warnings.catch_warnings():
        # Crossover and mutation of the original NSGA-II; optuna's own are coarser, and no
        # experiment.
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.NSGAIISampler(
            population_size=population,
            crossover=SBXCrossover(),
            mutation=PolynomialMutation(),
            seed=seed,
        )
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    while True:
        asked = [study.ask(space) for _ in range(population)]
        trials = yield np.array([[trial.params[name] for name in space] for trial in asked])
        for trial, values, violation in zip(asked, trials.values, trials.violation, strict=True):
            trial.set_constraint("loss", float(violation))
            study.tell(trial, values.tolist())
