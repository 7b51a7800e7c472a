"""``digiclay study STUDY``: the least device that meets limits in all cases, drags over its bed.

The parameters of a STUDY file are those of a scene and of the `Stroke`, ``stroke.speed``.
"""

import math
from argparse import Namespace
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from digiclay import __version__
from digiclay.commands.arguments import settings_of
from digiclay.commands.evaluation_pool import run_series
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import ParameterError, SceneError
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
from digiclay.core.session.run_scene import Result, run
from digiclay.core.studies.axes import MOST, Point, find_numbers, make_axis, refuse_twice
from digiclay.core.studies.evaluation import require_any
from digiclay.core.studies.job_table import find_scene
from digiclay.core.studies.speed_limits import Stroke, make_trial
from digiclay.core.studies.sweep_plan import format_csv, hash_points, open_points
from digiclay.plots.figure import save

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
TABLES = ("settings", "vary", "compare", "reference", "cases", "limits")
STROKE = "stroke."


class Study(NamedTuple):
    """Candidates over all cases."""

    minimized: str
    keys: tuple[str, ...]
    """Of the words of a point: the variant, what varies, and the case."""
    limits: dict[str, float]
    """Most of metrics in every case, SI."""
    reference: Record
    """Changes of each point for its reference."""
    points: list[Point]
    """The cases of a candidate, then those of the next one."""
    amounts: list[float]
    """What is minimized, of each point."""

    @property
    def cases(self) -> int:
        """Number of cases."""
        return len({point.words[-1] for point in self.points})


def read_study(path: Path, given: Sequence[Setting] = ()) -> Study:
    """Read a STUDY file, its settings replaced by the `given` ones; SceneError in one line."""
    table = read_table(path)
    if "cases" not in table:
        raise SceneError(f"{path.name} has no [cases]: a study needs them, or at least two --vary.")
    try:
        return _read(path, table, given)
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None


def _read(path: Path, table: Table, given: Sequence[Setting]) -> Study:
    """Read the tables of a STUDY file; ParameterError."""
    refuse_unknown("", table, ("scene", "minimize", *TABLES))
    name, minimized = (_require(table, key, str, "a text") for key in ("scene", "minimize"))
    parts: Record = {"compare": {}, "reference": {}, "settings": {}, **table}
    for key in TABLES:
        _require(parts, key, dict, f"a section, [{key}]")
    cases, limits = parts["cases"], parts["limits"]
    refuse_unknown("limits", limits, tuple(MEASURED))
    for key in limits:
        if not 0.0 < _require(limits, key, (int, float), "a number", "limits") < math.inf:
            rule = "must be a finite number above 0"
            raise ParameterError("limits", key, rule, show_value(limits[key]))
    if not limits:
        raise ParameterError("limits", "", "must have a metric", "nothing")
    compared = [key for key in limits if key not in OUTCOMES]
    if compared and not parts["reference"]:
        rule = f"must have settings: limits.{compared[0]} compares with it"
        raise ParameterError("reference", "", rule, "none")
    axes = [make_axis(key, values) for key, values in list_changes(parts["vary"])]
    keys = [axis.key for axis in axes]
    variants = parts["compare"] or {"least": {}}
    rows = list(product(variants, *(axis.words for axis in axes), cases))
    if not 0 < len(rows) <= MOST:
        raise ParameterError("vary", "", f"must come to 1 to {MOST} runs", f"{len(rows)} runs")
    settings = _write_words(parts["settings"]) | {key: word for key, word, _ in given}
    reference = _write_words(parts["reference"])
    file, cache = find_scene(path, name), ReadParts()
    place = partial(_place, file, read_table(file), cache)
    points, amounts = list[Point](), list[float]()
    for words in rows:
        variant, case = (
            _write_words(
                _require(table, key, dict, "a table such as { stroke.direction = 30 }", owner)
            )
            for owner, table, key in (
                ("compare", variants, words[0]),
                ("cases", cases, words[-1]),
            )
        )
        refuse_twice([*keys, *variant, *case], given)
        changes = settings | variant | dict(zip(keys, words[1:], strict=False)) | case
        scene, phase = place(changes)
        full, _ = place(changes | reference)
        measure = partial(measure_case, phase=phase, full=full)
        points.append(Point(len(points), words, scene, measure=measure))
        amounts.append(_count(scene, minimized))
    return Study(minimized, ("variant", *keys, "case"), limits, reference, points, amounts)


def _write_words(changes: Table) -> dict[str, str]:
    """Return changes as words of settings."""
    return {key: write_word(value) for key, value in list_changes(changes)}


def _require(table: Table, key: str, kind: Any, wanted: str, owner: str = "") -> Any:
    """Return the value of a key of a section, `owner`, of a kind."""
    value = table.get(key)
    if not isinstance(value, kind) or isinstance(value, bool) or value != value:
        found = "none" if value is None else show_value(value)
        raise ParameterError(owner or key, key if owner else "", f"must be {wanted}", found)
    return value


def _place(
    file: Path, source: Table, cache: ReadParts, changes: Mapping[str, str]
) -> tuple[Scene, tuple[float, float]]:
    """Return a scene with changes that drags and lifts, and start and end of the drag, s."""
    stroke, settings = dict[str, Any](), list[Setting]()
    for key, word in changes.items():
        if key.startswith(STROKE):
            stroke[key.removeprefix(STROKE)] = read_value(word)
        else:
            settings.append(Setting(key, word, "STUDY"))
    scene = make_scene(file, source, settings, cache)
    motion = read_part("stroke", Stroke, {}, stroke)
    trial, start, end = make_trial(scene, motion, motion.speed)
    return lift_off(trial), (start, end)


def _count(scene: Scene, minimized: str) -> float:
    """Return what is minimized: the number of valves, or a parameter."""
    if minimized == "valves":
        return scene.drive.count_valves(scene.layout) if scene.drive else scene.cells
    numbers = find_numbers(scene, minimized)
    if len(numbers) != 1:
        rule = "must be valves or a parameter that is a number"
        raise ParameterError("minimize", "", rule, repr(minimized))
    return numbers[0]


def measure_case(
    scene: Scene, stopped: Stopped, *, phase: tuple[float, float], full: Scene
) -> Record | None:
    """Run a case, and its reference `full`; return the record, None after a stop."""
    done = run(scene, stopped=stopped)
    if done.incomplete:
        return None
    figures, relief = _judge(done, phase)
    beside, wanted = _run_reference(full, phase)
    ratio = figures["rfd"] / beside["rfd"] if figures["rfd"] and beside["rfd"] else None
    figures |= {"rfd_ratio": ratio, **compare_relief(relief, wanted)}
    return {"figures": {name: figures.get(name) for name in MEASURED}}


@lru_cache
def _run_reference(scene: Scene, phase: tuple[float, float]) -> tuple[Record, Floats]:
    """Run a reference, once in a process; return its figures and relief."""
    return _judge(run(scene), phase)


def _judge(done: Result, phase: tuple[float, float]) -> tuple[Record, Floats]:
    """Return the figures of a finished case, and the relief it leaves behind, (n,), m."""
    height = done.history["height"]
    return judge_trial(done, phase), height[-1] - height[0]


def compare_relief(relief: Floats, reference: Floats) -> dict[str, float | None]:
    """Return rms, over that of the reference, and largest deviation of a relief, both (n,), m."""
    off, formed = relief - reference, np.linalg.norm(reference)
    rms = float(np.linalg.norm(off) / formed) if formed else None
    return {"relief_deviation": rms, "relief_deviation_largest": float(np.abs(off).max())}


def run_cases(arguments: Namespace) -> int:
    """Run what is not done yet, and write table, page and plot."""
    study = read_study(find(arguments.scene), settings_of(arguments))
    description = {
        "digiclay": __version__,
        "keys": list(study.keys),
        "reference": study.reference,
        "scenes": hash_points(study.points),
    }

    def describe(there: Table) -> str:
        return f"over {', '.join(there['keys'])}"

    return run_series(
        arguments,
        "study",
        len(study.points),
        open_points(arguments.out, "study", description, describe),
        lambda evaluation: evaluation.finish([(point,) for point in study.points], study.keys),
        partial(_write, arguments.out, study),
        noun="runs",
    )


class Candidate(NamedTuple):
    """Candidate with its worst figures."""

    amount: float
    excess: float
    """Largest figure over its limit; at most 1 if the candidate meets all."""
    figures: Sequence[float]
    """By limit, SI; infinite where a case has none."""
    words: Sequence[str]


def find_least(candidates: Sequence[Candidate]) -> Candidate:
    """Return the least candidate that meets all limits, or the nearest one."""
    meeting = [each for each in candidates if each.excess <= 1.0]
    if meeting:
        return min(meeting, key=lambda each: (each.amount, each.excess))
    return min(candidates, key=lambda each: each.excess)


def find_candidates(study: Study, figures: Floats) -> dict[str, list[Candidate]]:
    """Return the candidates by their variants. `figures`: (points, limits), SI."""
    worst = figures.reshape(-1, study.cases, len(study.limits)).max(axis=1)
    excess = (worst / list(study.limits.values())).max(axis=1)
    groups: dict[str, list[Candidate]] = {}
    firsts = zip(study.points[:: study.cases], study.amounts[:: study.cases], strict=True)
    for number, (point, amount) in enumerate(firsts):
        candidate = Candidate(amount, excess[number], worst[number].tolist(), point.words[1:-1])
        groups.setdefault(point.words[0], []).append(candidate)
    return groups


def _write(out: Path, study: Study, records: dict[int, Record]) -> list[str]:
    """Write table, plot and page of finished points; return the answers."""
    found = [records[point.index] for point in study.points]
    require_any(found)
    values = [[each.get("figures", {}).get(name) for name in study.limits] for each in found]
    rows = [
        [*point.words, amount, *row, record.get("error", "")]
        for point, amount, row, record in zip(
            study.points, study.amounts, values, found, strict=True
        )
    ]
    heads = [*study.keys, study.minimized, *study.limits, "error"]
    write_whole(out / "runs.csv", format_csv([heads, *rows]).encode())
    figures = np.array(values, dtype=np.float64)
    groups = find_candidates(study, np.where(np.isnan(figures), np.inf, figures))
    worst = [
        [name, *each.words, each.amount, *each.figures]
        for name, group in groups.items()
        for each in group
    ]
    heads = [*study.keys[:-1], study.minimized, *study.limits]
    write_whole(out / "worst.csv", format_csv([heads, *worst]).encode())
    limits = {MEASURED[name]: most for name, most in study.limits.items()}
    curves = {
        name: np.array([(each.amount, *each.figures) for each in sorted(group)])
        for name, group in groups.items()
    }
    save(draw_limits(study.minimized, limits, curves), out / "limits.png")
    answers = [f"{name}: {answer(study, group)}" for name, group in groups.items()]
    page = [f"# Least {study.minimized}", *answers, "![Worst cases](limits.png)\n"]
    write_whole(out / "study.md", "\n\n".join(page).encode())
    return [*answers, f"written to {out}: start with study.md"]


def answer(study: Study, candidates: Sequence[Candidate]) -> str:
    """Return the least candidate as text, and which larger ones fail."""
    best = find_least(candidates)
    worst = (
        f"{name} {'absent' if math.isinf(value) else f'{value:.3g}'} (at most {most:g})"
        for (name, most), value in zip(study.limits.items(), best.figures, strict=True)
    )
    text = f"{study.minimized} {best.amount:g} ({', '.join(best.words)}), {', '.join(worst)}"
    if best.excess > 1.0:
        return f"none meets the limits; nearest: {text}"
    larger = (each for each in sorted(candidates) if each.amount > best.amount)
    return text + "".join(f"; not with {each.amount:g}" for each in larger if each.excess > 1.0)
