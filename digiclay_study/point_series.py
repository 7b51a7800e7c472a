"""Series of points over ranges of a scene: start, evaluation on a pool, end, and the table of all points."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.commands.arguments import add_scene, name_methods, settings_of
from digiclay.commands.evaluation_pool import add_pool, open_pool
from digiclay.commands.progress import Counted
from digiclay.commands.stop import Stop
from digiclay.core.base.errors import DigiclayError, OutputError, ParameterError
from digiclay.core.base.quantity import UNITS, Parameters, list_quantities
from digiclay.core.files.run_folder import write_whole
from digiclay.core.metrics.metric_table import ERRORS
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.studies.axes import MOST, Point, find_value, place_points
from digiclay.core.studies.evaluation import Pool, Record, find_figure
from digiclay.core.studies.series import Kind, open_series
from digiclay.core.studies.sweep_plan import (
    POINTS,
    Folder,
    find_unfinished,
    format_table,
    hash_points,
    select_done,
)
from numpy.typing import NDArray

SYNTAX = "must be KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C"
#: Digits of a value: 0.3, and not 0.30000000000000004.
DIGITS = 12


@dataclass(frozen=True)
class Range:
    """Range of one varied parameter.

    Attributes
    ----------
    key : str
        Section and key, ``control.force_gain``.
    low, high : float
        Ends, in `unit`.
    unit : str
        As written behind the numbers; empty: SI.
    logarithmic : bool
        Whether equal shares are equal ratios.
    words : tuple of str
        Choices in place of a range.
    whole : bool
        Whether values are whole numbers.
    si : str
        SI unit of the parameter.
    factor : float
        From `unit` to it.
    """

    key: str
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    logarithmic: bool = False
    words: tuple[str, ...] = ()
    whole: bool = False
    si: str = ""
    factor: float = 1.0

    def find_word(self, share: float) -> str:
        """Return the value at a share from 0 to 1 of the range, as a scene file would say it."""
        if self.words:
            return self.words[min(int(share * len(self.words)), len(self.words) - 1)]
        high = self.high + 1.0 if self.whole else self.high
        if self.logarithmic:
            value = self.low * (high / self.low) ** share
        else:
            value = self.low + share * (high - self.low)
        if self.whole:
            return str(min(math.floor(value), int(self.high)))
        value = float(f"{value:.{DIGITS}g}")
        return f"{min(max(value, self.low), self.high)!r} {self.unit}".strip()

    def convert(self, word: str) -> float | str:
        """Return a value of the range in SI; a choice as it is."""
        if self.words or self.whole:
            return int(word) if self.whole else word
        return float(word.partition(" ")[0]) * self.factor

    def __str__(self) -> str:
        if self.words:
            return ", ".join(self.words)
        scale = ", log" if self.logarithmic else ""
        return f"{self.low:.{DIGITS}g} to {self.high:.{DIGITS}g} {self.unit}".strip() + scale


def read_range(said: str) -> Range:
    """Read a varied parameter and its range: ``control.force_gain=0.5:8:log``.

    Raises ParameterError: in one line: key, rule, value.
    """
    key, _, values = (part.strip() for part in said.partition("="))
    if not key or not values:
        raise ParameterError("--vary", "", SYNTAX, repr(said))

    def refusal(rule: str) -> ParameterError:
        return ParameterError(f"--vary {key}", "", rule, repr(values))

    ends = [part.strip() for part in values.split(":")]
    if len(ends) == 1:
        words = tuple(word.strip() for word in values.split(","))
        if not all(words) or len(set(words)) < max(len(words), 2):
            raise refusal("must be LOW:HIGH, LOW:HIGH:log or at least two different values A,B")
        return Range(key, words=words)
    logarithmic = ends[2:] == ["log"]
    if len(ends) != 2 and not logarithmic:
        raise refusal("must be LOW:HIGH or LOW:HIGH:log, without a count")
    (low, _, unit), (high, _, other) = (end.partition(" ") for end in ends[:2])
    if unit.strip() != other.strip():
        raise refusal("must have the same unit at LOW and HIGH")
    try:
        start, stop = float(low), float(high)
    except ValueError:
        raise refusal("must have a number at LOW and HIGH") from None
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise refusal("must have finite numbers at LOW and HIGH")
    if not start < stop:
        raise refusal("must have LOW below HIGH")
    if logarithmic and not start > 0.0:
        raise refusal("must have numbers above 0 at LOW and HIGH for a logarithmic scale")
    return Range(key, start, stop, unit.strip(), logarithmic)


def fit_ranges(ranges: Sequence[Range], path: Path, settings: Sequence[Setting]) -> list[Range]:
    """Return ranges as the scene's parameters have them: whole numbers, and units.

    `path`: the scene's file; `settings`: what is changed of it at every point. Raises ParameterError,
    SceneError: in one line, where a parameter is unknown, given twice, or cannot have the ends of its range.
    """
    scene = load(path, settings)
    keys = [one.key for one in ranges]
    for key in keys:
        if keys.count(key) > 1:
            raise ParameterError(f"--vary {key}", "", "must be given once", f"{keys.count(key)} times")
        for setting in settings:
            if setting.key == key:
                raise ParameterError(
                    f"--vary {key}", "", f"must not be given to {setting.option} as well", key
                )
    return [_fit(one, scene, path, settings) for one in ranges]


def _fit(one: Range, scene: Scene, path: Path, settings: Sequence[Setting]) -> Range:
    """Return a range as the scene's parameter has it."""
    section, _, name = one.key.partition(".")
    part = scene.section(section) if name else None
    known = list_quantities(part).get(name) if isinstance(part, Parameters) else None
    if known is None or one.words:  # an unknown key, or a word: the scene file's own rules tell
        for word in one.words or (one.find_word(0.0),):
            load(path, [*settings, Setting(one.key, word, "--vary")])
        return one
    factor, measured = UNITS.get(one.unit, (0.0, "")) if one.unit else (1.0, known.unit)
    value = getattr(part, name)
    whole = isinstance(value, int) and not isinstance(value, bool)
    for end in (one.low, one.high):
        rule = known.broken_rule(end * factor)
        if measured != known.unit:
            rule = f"must be in {known.unit or 'no unit'} or a multiple of it"
        elif whole and end != int(end):
            rule = "must have whole numbers at LOW and HIGH"
        elif not isinstance(value, (int, float)) or isinstance(value, bool):
            rule = "must have words as its values: A,B"
        if rule:
            raise ParameterError(f"--vary {one.key}", "", rule, f"{end:g} {one.unit}".strip())
    return replace(one, whole=whole, si=known.unit, factor=factor)


@dataclass(frozen=True)
class Subject:
    """Scene, varied parameters and metrics.

    Attributes
    ----------
    path : Path
        The scene's file.
    settings : tuple of Setting
        What the options change of it at every point.
    scene : Scene
        With them.
    names : tuple of str
        Outputs: keys of `evaluation.FIGURES`.
    """

    path: Path
    settings: tuple[Setting, ...]
    scene: Scene
    ranges: tuple[Range, ...]
    names: tuple[str, ...]

    @property
    def errors(self) -> bool:
        """Whether errors of the integration are estimated."""
        return any(name in ERRORS for name in self.names)

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied parameters."""
        return tuple(one.key for one in self.ranges)


def add_subject(parser: argparse.ArgumentParser, metrics: str) -> None:
    """Add the options by which `read_subject` finds what is varied and measured, and where.

    `metrics`: default of --metric.
    """
    add_scene(parser)
    parser.add_argument(
        "--vary", metavar="KEY=RANGE", action="append", required=True,
        help="LOW:HIGH, LOW:HIGH:log or A,B,C; may be repeated",
    )  # fmt: skip
    parser.add_argument("--metric", metavar="M,...", default=metrics, help=f"default: {metrics}")
    parser.add_argument("--seed", metavar="N", type=read_count(1, 2**31), default=1, help="default: 1")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="the folder")
    add_pool(parser)
    parser.add_argument("--quiet", action="store_true", help="print errors only, without progress")


def read_count(least: int, most: int) -> Callable[[str], int]:
    """Return what reads a whole number within bounds."""

    def read(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"must be a whole number from {least} to {most} (got {text!r})")
        return int(text)

    return read


def read_subject(arguments: argparse.Namespace) -> Subject:
    """Return what the options vary and measure.

    Raises ParameterError, SceneError, OutputError: in one line.
    """
    names = tuple(dict.fromkeys(find_figure(word.strip()) for word in arguments.metric.split(",")))
    path, settings = find(arguments.scene), settings_of(arguments)
    ranges = fit_ranges([read_range(name_methods(said)) for said in arguments.vary], path, settings)
    scene = load(path, settings)
    if scene.recorder is None:
        raise OutputError("Metrics need a recorder, and the scene has recorder = 'absent'.")
    return Subject(path, tuple(settings), scene, tuple(ranges), names)


def refuse_too_many(option: str, points: int) -> None:
    """Refuse a plan of more points than a sweep may have. `option`: that is to blame."""
    if points > MOST:
        raise ParameterError(option, "", f"must come to {MOST} points at most", f"{points} points")


def make_points(subject: Subject, shares: NDArray[Any], first: int, progress: Any = None) -> list[Point]:
    """Return the points at shares of the ranges.

    `shares` (points, parameters); `first`: index of the first point; `progress` callable, optional, told how
    many points are made, and of how many.
    """
    rows = [
        tuple(one.find_word(share) for one, share in zip(subject.ranges, row, strict=True)) for row in shares
    ]
    return place_points(subject.path, subject.settings, subject.keys, rows, first=first, progress=progress)


#: Index of the unchanged scene among the points.
UNCHANGED = 0


@contextmanager
def open_folder(path: Path, name: str, subject: Subject, plan: Mapping[str, Any]) -> Iterator[Folder]:
    """Make the folder of a series, or go on with one of the same plan; nobody else works in it meanwhile.

    `name`: kind of the series: study; `plan`: what else the points depend on. Raises OutputError when it
    holds anything else, cannot be written, or another process works in it.
    """
    unchanged = Point(UNCHANGED, (), subject.scene)
    description = {
        "digiclay": __version__,
        "ranges": {one.key: str(one) for one in subject.ranges},
        **plan,
        "scene": hash_points([unchanged]),
    }

    def refuse_another(there: Any) -> None:
        if there != description:
            said = f"its {name}.json cannot be read"
            if isinstance(there, dict):
                said = _find_difference(there, description)
            raise OutputError(f"{path} holds another {name} ({said}): choose another folder with --out.")

    with open_series(path, Kind(name, f"{name}.json", (POINTS,)), description, refuse_another):
        yield Folder(path)


def _find_difference(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return the first part of a plan that differs."""
    for key in here:
        if there.get(key) != here[key]:
            plain = isinstance(there.get(key), (int, str)) and key != "scene"
            return f"{key} {there[key]}" if plain else f"with another {key.removesuffix('s')}"
    return "of another kind"


class Evaluation:
    """Evaluation of points of a series, all those that are done kept in its folder.

    Parameters
    ----------
    records : dict
        Of the points that are done, by their index; they become more.
    """

    def __init__(self, subject: Subject, folder: Folder, pool: Pool, records: dict[int, Record]) -> None:
        self._subject, self._folder, self._pool, self.records = subject, folder, pool, records

    def evaluate_unchanged(self) -> Record | None:
        """Return the record of the unchanged scene; None after a stop.

        Raises DigiclayError when the scene itself fails.
        """
        point = Point(UNCHANGED, (), self._subject.scene)
        self.evaluate([(point,)], ())
        record = self.records.get(UNCHANGED)
        if record is not None and "error" in record:
            raise DigiclayError(f"The unchanged scene fails: {record['error']}")
        return record

    def evaluate(self, bundles: Sequence[Sequence[Point]], keys: Sequence[str]) -> dict[int, Record]:
        """Evaluate the bundles of which a point is missing; return the points that no worker survived.

        These are not kept: the same command tries them again.

        `keys`: the varied parameters.
        """
        failed: dict[int, Record] = {}

        def keep(bundle: Sequence[Point], found: Sequence[Record | None]) -> None:
            self._folder.keep_bundle(bundle, found, keys, self.records)

        def fail(bundle: Sequence[Point], why: str) -> None:
            failed.update((point.index, {"error": why}) for point in bundle)

        todo = find_unfinished(bundles, self.records)
        if todo:
            self._pool(todo, keep, fail)
        return {index: record for index, record in failed.items() if index not in self.records}


@contextmanager
def open_evaluation(
    arguments: argparse.Namespace,
    name: str,
    subject: Subject,
    folder: Folder,
    pieces: int,
    total: int,
    stop: Stop,
) -> Iterator[Evaluation]:
    """Open the pool of the options, with a progress line of all points.

    `name`: kind of the series, at the beginning of the line; `pieces`: most bundles at a time; `total`:
    points of the series, the unchanged scene included.
    """
    records = select_done(folder.read_records(), errors=subject.errors)
    bar = Counted(sys.stderr, name, "points", len(records))

    def draw(note: str) -> None:
        if not arguments.quiet:
            bar(min(len(records), total), total, note)

    with bar, open_pool(arguments, pieces, stop, draw, errors=subject.errors) as pool:
        yield Evaluation(subject, folder, pool, records)


def describe_stop(path: Path, done: int, total: int) -> str:
    """Return what a stopped command leaves. `path`: the folder; `done`, `total`: points."""
    said = f"{done} of {total} points are done and kept in {path}"
    return f"Stopped: {said}. The same command goes on from there."


def write_points(
    path: Path,
    subject: Subject,
    points: Sequence[Point],
    records: Mapping[int, Record],
    extra: Sequence[str] = (),
) -> None:
    """Write a table of points, in SI units; the unchanged scene has its own values.

    `records`: of these points at least, by their index; `extra`: more outputs than those of the subject.
    """
    own = tuple(find_value(subject.scene, one.key, "") for one in subject.ranges)
    rows = [
        (point.index, *(tuple(map(Range.convert, subject.ranges, point.words)) or own)) for point in points
    ]
    varied = [("point", ""), *((one.key, one.si) for one in subject.ranges)]
    names = dict.fromkeys((*subject.names, *extra))
    found = [records[point.index] for point in points]
    write_whole(path, format_table(varied, rows, found, list(names)).encode())
