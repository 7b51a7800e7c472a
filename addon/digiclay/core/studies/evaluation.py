"""Evaluation of a sweep's points: batches, single runs, and their results."""

import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from ..base.errors import DigiclayError, OutputError, ParameterError, one_line
from ..base.quantity import find_nearest_name, show_digits
from ..batch.run_together import measure_together
from ..batch.structure import describe_structure
from ..control.methods import find_method
from ..engine.simulation import Stopped
from ..files.tables import Record
from ..metrics.metric_table import ERRORS, METRICS, RUN, describe_errors
from ..scene.schema import Scene
from ..session.accuracy import describe_bends, make_reference
from ..session.run_scene import Result, run
from .axes import Measure, Point
from .series import Results, describe_error

#: Evaluation of bundles in any order, until all are done or a stop is requested. The record of a
#: stopped point is None; a bundle during which its worker dies raises. OutputError when no worker
#: is left.
Pool = Callable[[Sequence[Sequence[Point]]], Results[Sequence[Point], Sequence[Record | None]]]

#: Metrics of a session.
FIGURES = (
    METRICS | {name: RUN[name] for name in ("simulated", "run_time", "real_time_factor")} | ERRORS
)
#: Figures that differ in every run.
TIMES = ("run_time", "real_time_factor")
#: Short names of figures.
SHORT = {"lag": "lag_mean", "oscillation": "force_oscillation", "relief": "ridge_error"}
#: Least points of a batch: fewer are as quick one at a time.
LEAST = 4
#: Twice this number of points makes two batches: a larger one gains little, and uses a single core.
RUNS = 32
#: Most bytes of a batch for the metrics of its runs, and bytes per row: the history of a run is not
#: stored.
BUDGET, BYTES_A_ROW = 2**30, 41
#: Key in a record of the reason why its point ran alone although it belongs to a batch.
ALONE = "alone"
#: Notes of a record beside its figures, if any.
NOTED = ("errors_absent", "lost")


def find_figure(word: str, owner: str = "--metric") -> str:
    """Return the full name of a metric, such as ``lag``; ParameterError of `owner` suggests the nearest."""
    name = SHORT.get(word, word)
    if name in FIGURES:
        return name
    close = find_nearest_name(word, [*FIGURES, *SHORT])
    hint = f"Did you mean {close}?" if close else f"Known: {', '.join(FIGURES)}."
    raise ParameterError(owner, "", "must be a known metric", repr(word), hint)


def read_metrics(text: str) -> tuple[str, ...]:
    """Return the full names of metrics in a list such as ``rfd,lag``."""
    return tuple(dict.fromkeys(find_figure(word.strip()) for word in text.split(",")))


@dataclass(frozen=True)
class Bundles:
    """Points of a sweep in bundles that run together."""

    #: Of `LEAST` points or more.
    batches: tuple[tuple[Point, ...], ...]
    #: Of one point each.
    alone: tuple[tuple[Point, ...], ...]
    #: Why points run alone, and why errors are doubtful, one line per reason.
    why: tuple[str, ...]

    @property
    def every(self) -> tuple[tuple[Point, ...], ...]:
        """All bundles, in the order in which they run."""
        return (*self.batches, *self.alone)

    def describe(self) -> list[str]:
        """Return lines on how the points run."""
        count, noun = sum(map(len, self.batches)), "batch" if len(self.batches) == 1 else "batches"
        lines = [f"{count} points run in {len(self.batches)} {noun}"] if self.batches else []
        return [*lines, *self.why]


def require_recorder(points: Iterable[Point]) -> None:
    """Refuse points none of which has a history."""
    if not any(point.scene and point.scene.recorder for point in points):
        raise OutputError("A sweep needs a recorder, and the scene has recorder = 'absent'.")


def require_any(records: Sequence[Record]) -> list[str]:
    """Return why points failed, or raise DigiclayError if all did."""
    failed = [record["error"] for record in records if "error" in record]
    if len(failed) == len(records):
        raise DigiclayError(f"Every point failed; the first one: {failed[0]}")
    return failed


def judge_all(points: Iterable[Point]) -> list[Point]:
    """Return the points with an estimate of their errors."""
    return [replace(point, errors=True) for point in points]


def has_errors(record: Record) -> bool:
    """Return whether the errors of a point were estimated, or the point failed."""
    return "error" in record or record["figures"].keys() >= ERRORS.keys()


def describe_effort(records: Mapping[int, Record]) -> str:
    """Return the run time of points and their largest estimated errors, with their points."""
    figures = {
        index: record["figures"] for index, record in sorted(records.items()) if "figures" in record
    }
    judged = {index: row for index, row in figures.items() if row.get("height_error") is not None}
    spent = sum(row.get("run_time") or 0.0 for row in figures.values())
    absent = (record["errors_absent"] for record in records.values() if record.get("errors_absent"))
    worst: dict[str, object] = {"errors_absent": next(absent, "")}
    where = ""
    if judged:
        worst = {name: max(row[name] for row in judged.values()) for name in ERRORS}
        named = "" if len(judged) == len(figures) else f": {', '.join(map(str, judged))}"
        where = f" at most, estimated at {len(judged)} of {len(figures)} points{named}"
    return f"{len(figures)} runs took {show_digits(spent)} s; {describe_errors(worst)}{where}"


def make_bundles(points: Sequence[Point]) -> Bundles:
    """Return all points of a sweep in bundles; the points of a batch have one structure.

    The bundles do not depend on finished points or the number of workers, so that a sweep always
    has the same results to the last bit. If errors are estimated, the references of a batch must
    have one structure too.
    """
    alike: dict[object, list[Point]] = {}
    alone: list[Point] = []
    why: Counter[str] = Counter()
    for point in points:
        if point.scene is None:
            alone.append(point)
            continue
        reason = _find_reason(point.scene)
        if reason:
            alone.append(point)
            why[reason] += 1
            continue
        try:
            structure = describe_structure(point.scene)
            judge = describe_structure(make_reference(point.scene)) if point.errors else None
        except ParameterError:  # reported when the point runs
            alone.append(point)
        else:
            alike.setdefault((structure, judge), []).append(point)
    batches: list[tuple[Point, ...]] = []
    for group in alike.values():
        most = _limit_runs(group[0].scene)
        if len(group) >= LEAST and most >= LEAST:
            pieces = max(1, len(group) // RUNS, -(-len(group) // most))
            edges = [len(group) * i // pieces for i in range(pieces + 1)]
            batches += [tuple(group[a:b]) for a, b in pairwise(edges)]
            continue
        alone += group
        few = len(group) < LEAST
        reason = f"fewer than {LEAST} have the same bed, parts and steps"
        why[reason if few else "their histories are too long to keep several at once"] += len(group)
    alone.sort(key=lambda point: point.index)
    doubts = Counter(
        describe_bends(point.scene) for point in points if point.errors and point.scene
    )
    notes = tuple(
        f"{_count(doubts[text], 'point')} with larger errors: {text}" for text in doubts if text
    )
    return Bundles(tuple(batches), tuple((point,) for point in alone), (*_explain(why), *notes))


def _find_reason(scene: Scene) -> str:
    """Return why a run cannot be in a batch, or ``""``."""
    if len(scene.fingers) != 1:
        return "they have several fingers"
    if scene.bodies:
        return "they have bodies"
    if scene.drive:
        return "they have a drive"
    return (
        ""
        if find_method(scene.method).batched
        else f"a batch of {scene.method} would not be faster"
    )


def _limit_runs(scene: Scene | None) -> int:
    """Return the most runs like this one in a batch."""
    assert scene is not None
    rows = scene.recorder.rows(scene.periods) if scene.recorder else 1
    return BUDGET // (rows * BYTES_A_ROW)


def _count(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _explain(why: Mapping[str, int]) -> tuple[str, ...]:
    """Return a line per reason for points that run one at a time; `why` counts them."""
    return tuple(
        f"{_count(count, 'point')} one at a time: {reason}" for reason, count in why.items()
    )


def explain_failed_batches(records: Mapping[int, Record]) -> tuple[str, ...]:
    """Return a line per reason for points that ran one by one because their batch failed."""
    return _explain(Counter(record[ALONE] for record in records.values() if record.get(ALONE)))


def evaluate(
    scene: Scene,
    stopped: Stopped = None,
    *,
    errors: bool = False,
    measure: Measure | None = None,
) -> Record | None:
    """Return the record of a session, or that of `measure` for its scene; None when it was stopped."""
    try:
        if measure is not None:
            return measure(scene, stopped)
        done = run(scene, stopped=stopped)
        result = done.estimate_errors(stopped=stopped) if errors else done
    except Exception as error:  # other points do not depend on it
        return {"error": describe_error(error)}
    return None if result is None or result.incomplete else _make_record(result, errors=errors)


def _make_record(result: Result, *, errors: bool) -> Record:
    """Return the record of a finished session, with `ERRORS` only if they were requested."""
    names = [name for name in FIGURES if errors or name not in ERRORS]
    notes = {name: result.metrics[name] for name in NOTED if result.metrics.get(name)}
    return {"figures": {name: result.metrics.get(name) for name in names}, **notes}


class BatchWarning(RuntimeWarning):
    """Failure of a whole batch that is not the user's error."""


def evaluate_bundle(bundle: Sequence[Point], stopped: Stopped = None) -> list[Record | None]:
    """Run a bundle, with all errors or none; return the records of its points, None for a stopped one.

    When a batch fails as a whole, its points run one by one, and each record has the reason as
    ``alone``; `BatchWarning` if it was neither lack of memory nor an error that a user can cause.
    """
    scenes = [point.scene for point in bundle if point.scene]
    if not scenes:  # incompatible values are in no batch
        return [{"error": point.error} for point in bundle]
    records: list[Record | None] = [None] * len(scenes)
    errors, why = bundle[0].errors, ""
    if len(scenes) > 1:
        try:
            for number, result in measure_together(scenes, errors=errors, stopped=stopped):
                if isinstance(result, DigiclayError):
                    records[number] = {"error": one_line(result)}
                else:
                    records[number] = _make_record(result, errors=errors)
        except MemoryError:
            why = "there is not enough memory for a batch"
        except Exception as error:  # the points then run one by one
            why = describe_error(error)
            if not isinstance(error, DigiclayError):
                warnings.warn(
                    f"A batch of {len(scenes)} runs failed: {why}", BatchWarning, stacklevel=2
                )
        if why:
            records = [None] * len(scenes)
    for number, (point, scene) in enumerate(zip(bundle, scenes, strict=True)):
        if records[number] is None and not (stopped and stopped()):
            record = evaluate(scene, stopped, errors=errors, measure=point.measure)
            records[number] = {**record, ALONE: why} if record and why else record
    return records
