"""Series of points over ranges of a scene: options, ranges, folder, and the table of all points."""

import argparse
import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.commands.arguments import add_options, name_methods, settings_of, whole_number
from digiclay.commands.evaluation_pool import Evaluation, add_series
from digiclay.commands.progress import format_duration
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError, OutputError, ParameterError
from digiclay.core.base.quantity import UNITS
from digiclay.core.files.run_folder import write_whole
from digiclay.core.files.tables import Record, Table
from digiclay.core.metrics.metric_table import ERRORS
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.studies import axes
from digiclay.core.studies.evaluation import judge_all, read_metrics
from digiclay.core.studies.sweep_plan import Folder, format_table, hash_points, open_points

#: Digits of a value: 0.3, and not 0.30000000000000004.
DIGITS = 12


@dataclass(frozen=True)
class Range:
    """Range of one varied parameter."""

    #: Section and key, ``control.force_gain``.
    key: str
    #: Ends, in `unit`, which is as written behind the numbers; empty: SI.
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    #: Whether equal shares are equal ratios.
    logarithmic: bool = False
    #: Choices in place of a range.
    words: tuple[str, ...] = ()
    #: Whether values are whole numbers.
    whole: bool = False
    #: SI unit of the parameter, and the factor from `unit` to it.
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


def read_range(text: str) -> Range:
    """Read a range, ``control.force_gain=0.5:8:log``; ParameterError in one line: key, rule, value."""
    varied = axes.read_varied(text, "LOW", "HIGH")
    low, high = map(float, varied.ends) if not varied.words else (0.0, 1.0)
    rule = "must have LOW below HIGH" if low >= high else ""
    if len(varied.words) == 1:
        rule = "must be LOW:HIGH, LOW:HIGH:log or at least two different values A,B"
    if rule:
        raise ParameterError(f"--vary {varied.key}", "", rule, repr(text.partition("=")[2].strip()))
    return Range(varied.key, low, high, varied.unit, varied.logarithmic, varied.words)


def fit_ranges(ranges: Sequence[Range], path: Path, settings: Sequence[Setting]) -> list[Range]:
    """Return ranges as the scene's parameters have them: whole numbers, and units."""
    scene = load(path, settings)
    axes.refuse_twice([varied.key for varied in ranges], settings)
    return [_fit(varied, scene, path, settings) for varied in ranges]


def _fit(varied: Range, scene: Scene, path: Path, settings: Sequence[Setting]) -> Range:
    """Return a range as the scene's parameter has it."""
    if axes.find_quantity(scene, varied.key) is None:
        # A part that is absent, until it is varied; an unknown key is refused.
        scene = load(path, [*settings, Setting(varied.key, varied.find_word(0.0), "--vary")])
    declared = axes.find_quantity(scene, varied.key)
    if declared is None or varied.words:
        # An unknown key, or a word: the scene file's own rules tell.
        for word in varied.words or (varied.find_word(0.0),):
            load(path, [*settings, Setting(varied.key, word, "--vary")])
        return varied
    factor, measured = UNITS.get(varied.unit, (0.0, "")) if varied.unit else (1.0, declared.unit)
    numbers = axes.find_numbers(scene, varied.key)
    whole = any(isinstance(value, int) for value in numbers)
    for end in (varied.low, varied.high):
        rule = declared.broken_rule(end * factor)
        if measured != declared.unit:
            rule = f"must be in {declared.unit or 'no unit'} or a multiple of it"
        elif whole and end != int(end):
            rule = "must have whole numbers at LOW and HIGH"
        elif not numbers:
            rule = "must have words as its values: A,B"
        if rule:
            raise ParameterError(f"--vary {varied.key}", "", rule, f"{end:g} {varied.unit}".strip())
    return replace(varied, whole=whole, si=declared.unit, factor=factor)


#: Index of the unchanged scene among the points.
UNCHANGED = 0


@dataclass(frozen=True)
class Subject:
    """Scene, varied parameters and metrics of a study or a tuning, and its points."""

    #: The scene's file, what the options change of it at every point, and the scene with that.
    path: Path
    settings: tuple[Setting, ...]
    scene: Scene
    ranges: tuple[Range, ...]
    #: Outputs: keys of `evaluation.FIGURES`.
    names: tuple[str, ...]

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied parameters."""
        return tuple(varied.key for varied in self.ranges)

    @property
    def unchanged(self) -> axes.Point:
        """The unchanged scene, of which the errors are always estimated."""
        return axes.Point(UNCHANGED, (), self.scene, errors=True)

    def make_points(self, shares: Floats, first: int, progress: Any = None) -> list[axes.Point]:
        """Return the points at shares (points, parameters) of the ranges. `first`: index of the first."""
        rows = [tuple(map(Range.find_word, self.ranges, row)) for row in shares]
        points = axes.place_points(
            self.path, self.settings, self.keys, rows, first=first, progress=progress
        )
        return judge_all(points) if any(name in ERRORS for name in self.names) else points

    def open_folder(self, path: Path, name: str, plan: Table) -> AbstractContextManager[Folder]:
        """Open the folder of a study or a tuning, see `open_points`. `plan`: what else points depend on."""
        description = {
            "digiclay": __version__,
            "ranges": {varied.key: str(varied) for varied in self.ranges},
            **plan,
            "scene": hash_points([self.unchanged]),
        }

        def describe(there: Table) -> str:
            for key, here in description.items():
                if there.get(key) != here:
                    plain = isinstance(there.get(key), (int, str)) and key != "scene"
                    return (
                        f"{key} {there[key]}" if plain else f"with another {key.removesuffix('s')}"
                    )
            return "of another kind"

        return open_points(path, name, description, describe)

    def evaluate_unchanged(self, evaluation: Evaluation, *, quiet: bool) -> Record | None:
        """Return the record of the unchanged scene, None after a stop; print how long others take."""
        evaluation.finish([(self.unchanged,)], ())
        records = evaluation.collect()
        record = records.get(UNCHANGED)
        if record is not None and "error" in record:
            raise DigiclayError(f"The unchanged scene fails: {record['error']}")
        left = evaluation.total - len(records)
        if record is not None and left and not quiet:
            time = format_duration(left * record["figures"]["run_time"])
            # Several fingers are in no batch.
            less = " if each runs alone, less in batches" if len(self.scene.fingers) == 1 else ""
            print(f"{left} runs: about {time} of one core{less}", flush=True)
        return record

    def write_table(
        self, path: Path, points: Sequence[axes.Point], records: Mapping[int, Record], *extra: str
    ) -> None:
        """Write a table of points, in SI units; the unchanged scene has its own values.

        `extra`: metrics beside those of the subject.
        """
        values = tuple(axes.find_value(self.scene, key, "") for key in self.keys)
        rows = [
            (point.index, *(tuple(map(Range.convert, self.ranges, point.words)) or values))
            for point in points
        ]
        varied = [("point", ""), *((each.key, each.si) for each in self.ranges)]
        results = [records[point.index] for point in points]
        names = dict.fromkeys((*self.names, *extra))
        write_whole(path, format_table(varied, rows, results, list(names)).encode())


def add_subject(parser: argparse.ArgumentParser, metrics: str, *, required: bool = True) -> None:
    """Add the options of `read_subject`, and the seed. `metrics`: default of --metric."""
    add_series(parser, "LOW:HIGH, LOW:HIGH:log or A,B,C", metrics, required=required)
    add_options(parser, {"--seed N": (whole_number(1, 2**31), "default: 1", 1)})


def read_subject(arguments: argparse.Namespace) -> Subject:
    """Return what the options vary and measure; ParameterError, SceneError, OutputError in one line."""
    names = read_metrics(arguments.metric)
    path, settings = find(arguments.scene), settings_of(arguments)
    ranges = fit_ranges(
        [read_range(name_methods(varied)) for varied in arguments.vary], path, settings
    )
    scene = load(path, settings)
    if scene.recorder is None:
        raise OutputError("Metrics need a recorder, and the scene has recorder = 'absent'.")
    return Subject(path, tuple(settings), scene, tuple(ranges), names)


def refuse_too_many(option: str, points: int) -> None:
    """Refuse a plan of more points than a sweep may have. `option`: the one that sets their number."""
    if points > axes.MOST:
        raise ParameterError(
            option, "", f"must come to {axes.MOST} points at most", f"{points} points"
        )
