"""``digiclay study STUDY``: the least device that meets limits in all cases, drags over its bed.

The parameters of a STUDY file are those of a scene and of the `Stroke`, ``stroke.speed``.
"""

import math
from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from digiclay.commands.arguments import settings_of
from digiclay.commands.evaluation_pool import Evaluation, run_series
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError, ParameterError, SceneError
from digiclay.core.engine.simulation import Stopped
from digiclay.core.files.run_folder import write_whole
from digiclay.core.files.tables import (
    ReadParts,
    Record,
    Table,
    read_part,
    refuse_unknown,
    show_value,
)
from digiclay.core.metrics.metric_table import Metric
from digiclay.core.scene.scene_source import (
    Setting,
    find,
    list_changes,
    make_scene,
    read_table,
    read_value,
    write_word,
)
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.axes import MOST, Point, find_numbers, refuse_twice
from digiclay.core.studies.job_table import find_scene
from digiclay.core.studies.speed_limits import Stroke, make_trial
from digiclay.core.studies.sweep_plan import format_csv, hash_points, open_points

from .method_trials import OUTCOMES, judge_trial, lift_off
from .study_plots import draw_limits

#: Metrics of a run, and those beside its reference.
MEASURED: dict[str, Metric] = {
    **OUTCOMES,
    "rfd_ratio": Metric("1", "higher", "RFD over that of the reference", "RFD / reference"),
    "relief_deviation": Metric(
        "1",
        "higher",
        "rms difference of the heights left behind from the reference's, over rms of its relief",
        "deviation of the relief",
        "%",
    ),
    "relief_deviation_largest": Metric(
        "m", "higher", "largest difference of a height left behind", "largest deviation", "mm"
    ),
}
#: Tables of a STUDY file.
TABLES = ("settings", "vary", "compare", "cases", "reference", "limits")
STROKE = "stroke."


class Case(NamedTuple):
    """Run of a drag."""

    words: tuple[str, ...]
    """Values of what is compared and varied, and the case."""
    scene: Scene
    phase: tuple[float, float]
    """Start and end of the drag, s."""

    def make_point(self, number: int, reference: Record | None = None) -> Point:
        """Return the run as a point, with the record of its reference if it has one."""
        measure = partial(measure_case, phase=self.phase, reference=reference)
        return Point(number, self.words, self.scene, measure=measure)


class Study(NamedTuple):
    """Candidates over all cases."""

    minimized: str
    compared: int
    """How many keys are compared; the others are varied."""
    keys: tuple[str, ...]
    """Of the words of a case."""
    limits: dict[str, float]
    """Most of metrics in every case, SI."""
    references: list[Case]
    cases: list[Case]
    beside: list[int]
    """The reference of each case."""

    def find_amount(self, scene: Scene) -> float:
        """Return what is minimized: the number of valves, or a parameter."""
        if self.minimized == "valves":
            return scene.drive.count_valves(scene.layout) if scene.drive else scene.cells
        numbers = find_numbers(scene, self.minimized)
        if len(numbers) != 1:
            rule = "must be valves or a parameter that is a number"
            raise ParameterError("minimize", "", rule, repr(self.minimized))
        return numbers[0]


def read_study(path: Path, given: Sequence[Setting] = ()) -> Study:
    """Read a STUDY file, its settings replaced by the `given` ones; SceneError in one line."""
    table = read_table(path)
    if "cases" not in table:
        raise SceneError("A study needs at least two --vary, or a STUDY file with [cases].")
    try:
        return _read(path, table, given)
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None


def _read(path: Path, table: Table, given: Sequence[Setting]) -> Study:
    """Read the tables of a STUDY file; ParameterError."""
    refuse_unknown("", table, ("scene", "minimize", *TABLES))
    scene, minimized = (_require(table, key, str, "a text") for key in ("scene", "minimize"))
    parts = {"compare": {}, "reference": {}, "settings": {}, **table}
    settings, vary, compare, cases, reference, limits = (
        _require(parts, key, dict, f"a section, [{key}]") for key in TABLES
    )
    refuse_unknown("limits", limits, tuple(MEASURED))
    for name in limits:
        _require(limits, name, (int, float), "a number")
    axes = dict(list_changes(compare)) | dict(list_changes(vary))
    for key in axes:
        _require(axes, key, list, "a list of values")
    refuse_twice([*axes], given)
    rows = list(product(*axes.values(), cases))
    if not 0 < len(rows) <= MOST:
        raise ParameterError("vary", "", f"must come to 1 to {MOST} runs", f"{len(rows)} runs")
    file, cache = find_scene(path, scene), ReadParts()
    source = read_table(file)
    common = dict(list_changes(settings)) | {key: read_value(word) for key, word, _ in given}
    full = dict(list_changes(reference))
    compared = len(dict(list_changes(compare)))
    study = Study(minimized, compared, (*axes, "case"), limits, [], [], [])
    known: dict[str, int] = {}
    for *values, name in rows:
        case = _require(cases, name, dict, "a table such as { stroke.direction = 30 }")
        changes = common | dict(zip(axes, values, strict=True)) | dict(list_changes(case))
        place = partial(_place, file, source, cache, (*map(write_word, values), name))
        study.cases.append(place(changes))
        study.find_amount(study.cases[-1].scene)
        beside = place(changes | full)
        number = known.setdefault(hash_points([beside.make_point(0)]), len(known))
        study.beside.append(number)
        if number == len(study.references):
            study.references.append(beside)
    return study


def _require(table: Table, key: str, kind: Any, wanted: str) -> Any:
    """Return the value of a key, of a kind."""
    value = table.get(key)
    if not isinstance(value, kind) or isinstance(value, bool) or value != value:
        raise ParameterError(key, "", f"must be {wanted}", show_value(value))
    return value


def _place(
    file: Path, source: Table, cache: ReadParts, words: tuple[str, ...], changes: Record
) -> Case:
    """Return the run of a scene with changes."""
    stroke = {key.removeprefix(STROKE): changes[key] for key in changes if key.startswith(STROKE)}
    settings = [
        Setting(key, write_word(value), "STUDY")
        for key, value in changes.items()
        if not key.startswith(STROKE)
    ]
    scene = make_scene(file, source, settings, cache)
    motion = read_part("stroke", Stroke, {}, stroke)
    trial, start, end = make_trial(scene, motion, motion.speed)
    return Case(words, lift_off(trial), (start, end))


def measure_case(
    scene: Scene, stopped: Stopped, *, phase: tuple[float, float], reference: Record | None
) -> Record | None:
    """Run a case; return its figures, also those beside a reference, or the relief that it leaves."""
    done = run(scene, stopped=stopped)
    if done.incomplete:
        return None
    judged = judge_trial(done, phase)
    figures = {name: judged.get(name) for name in OUTCOMES}
    relief = done.history["height"][-1] - done.history["height"][0]
    if reference is None:
        return {"figures": figures, "relief": np.round(relief, 9).tolist()}
    rfd, wanted = figures["rfd"], reference["figures"]["rfd"]
    ratio = rfd / wanted if rfd is not None and wanted else None
    beside = compare_relief(relief, np.array(reference["relief"]))
    return {"figures": {**figures, "rfd_ratio": ratio, **beside}}


def compare_relief(relief: Floats, reference: Floats) -> dict[str, float | None]:
    """Return rms, over that of the reference, and largest deviation of a relief, both (n,), m."""
    off, formed = relief - reference, np.linalg.norm(reference)
    rms = float(np.linalg.norm(off) / formed) if formed else None
    return {"relief_deviation": rms, "relief_deviation_largest": float(np.abs(off).max())}


def run_cases(arguments: Namespace) -> int:
    """Run what is not done yet, and write table, page and plot."""
    study = read_study(find(arguments.scene), settings_of(arguments))
    first = len(study.references)
    every = [*study.references, *study.cases]
    points = [case.make_point(number) for number, case in enumerate(every)]
    description = {"keys": list(study.keys), "scenes": hash_points(points)}

    def evaluate(evaluation: Evaluation) -> None:
        evaluation.finish([(point,) for point in points[:first]], study.keys)
        records = evaluation.collect()
        failed = [record["error"] for record in records.values() if "error" in record]
        if failed and len(records) == first:
            raise DigiclayError(f"A reference fails: {failed[0]}")
        if all(number in records for number in range(first)):
            numbered = enumerate(zip(study.cases, study.beside, strict=True), first)
            beside = (case.make_point(number, records[at]) for number, (case, at) in numbered)
            evaluation.finish([(point,) for point in beside], study.keys)

    def describe(there: Table) -> str:
        return f"over {', '.join(there['keys'])}"

    def write(records: dict[int, Record]) -> list[str]:
        return _write(arguments.out, study, [records[point.index] for point in points[first:]])

    opened = open_points(arguments.out, "study", description, describe)
    return run_series(arguments, "study", len(points), opened, evaluate, write, noun="runs")


class Candidate(NamedTuple):
    """Candidate with its worst figures."""

    amount: float
    excess: float
    """Largest figure over its limit; at most 1 if the candidate meets all."""
    figures: tuple[float, ...]
    """By limit, SI; infinite where a case has none."""
    words: tuple[str, ...]


def find_least(candidates: Sequence[Candidate]) -> Candidate:
    """Return the least candidate that meets all limits, or the nearest one."""
    meeting = [each for each in candidates if each.excess <= 1.0]
    return min(meeting) if meeting else min(candidates, key=lambda each: each.excess)


def _write(out: Path, study: Study, records: Sequence[Record]) -> list[str]:
    """Write table, plot and page of finished cases; return the answers."""
    from digiclay.plots.figure import save

    amounts = [study.find_amount(case.scene) for case in study.cases]
    figures = np.full((len(records), len(study.limits)), math.inf)
    for row, record in zip(figures, records, strict=True):
        found = map(record.get("figures", {}).get, study.limits)
        row[:] = [math.inf if value is None else value for value in found]
    heads = [*study.keys, study.minimized, *study.limits, "error"]
    rows = [
        [*case.words, amount, *row, record.get("error", "")]
        for case, amount, row, record in zip(study.cases, amounts, figures, records, strict=True)
    ]
    write_whole(out / "runs.csv", format_csv([heads, *rows]).encode())
    each = len({case.words[-1] for case in study.cases})
    groups: dict[str, list[Candidate]] = {}
    for start in range(0, len(records), each):
        worst = figures[start : start + each].max(axis=0)
        excess = max(worst / np.maximum(list(study.limits.values()), 1e-300))
        words = study.cases[start].words[:-1]
        group = groups.setdefault(", ".join(words[: study.compared]), [])
        group.append(
            Candidate(amounts[start], excess, tuple(worst.tolist()), words[study.compared :])
        )
    limits = {MEASURED[name]: most for name, most in study.limits.items()}
    curves = {
        name: np.array([(each.amount, *each.figures) for each in sorted(group)])
        for name, group in groups.items()
    }
    save(draw_limits(study.minimized, limits, curves), out / "limits.png")
    answers = [f"{name} {_answer(study, group)}".strip() for name, group in groups.items()]
    page = [f"# Least {study.minimized}", *answers, "![Worst cases](limits.png)"]
    write_whole(out / "study.md", "\n\n".join(page).encode())
    return [*answers, f"written to {out}: start with study.md"]


def _answer(study: Study, candidates: Sequence[Candidate]) -> str:
    """Return the least candidate as text, and which larger ones fail."""
    best = find_least(candidates)
    worst = (
        f"{name} {value:.3g} (at most {most:g})"
        for (name, most), value in zip(study.limits.items(), best.figures, strict=True)
    )
    words = ", ".join(best.words)
    text = f"{study.minimized} {best.amount:g} ({words}), {', '.join(worst)}"
    if best.excess > 1.0:
        return f"none meets the limits; nearest: {text}"
    failing = sorted(
        each.amount for each in candidates if each.excess > 1.0 and each.amount > best.amount
    )
    return text + "".join(f"; not with {amount:g}" for amount in failing)
