"""Axes of a sweep: their text form, the points over them, and columns of numbers."""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import ParameterError, SceneError
from ..base.quantity import Parameters, Quantity, list_quantities, normalize
from ..engine.simulation import Progress, Stopped
from ..files.tables import ReadParts, Record, shorten
from ..scene.scene_source import Setting, Source, make_scene, read_source, split_key, write_word
from ..scene.schema import Scene
from ..scene.toml_table import FINGERS

#: Result of a point: its ``figures``, or the ``error`` it ended in.
#: Measurement of a scene, given a function that tells whether to stop; None after a stop.
Measure = Callable[[Scene, Stopped], Record | None]
#: Most points: more are a typing error, not a sweep.
MOST = 10_000


@dataclass(frozen=True)
class Axis:
    """One varied parameter."""

    #: Section and key, ``control.force_gain``.
    key: str
    #: Its values as in a scene file.
    words: tuple[str, ...]
    #: Whether they are evenly spaced on a logarithmic scale.
    logarithmic: bool = False


@dataclass(frozen=True)
class Point:
    """One session of a sweep."""

    #: The last axis varies fastest.
    index: int
    #: A value on each axis.
    words: tuple[str, ...]
    #: None if the values are not compatible; `error` has the reason.
    scene: Scene | None
    error: str = ""
    #: By default the figures of the session, see `evaluation.evaluate`.
    measure: Measure | None = None
    #: Whether the errors of the integration are estimated.
    errors: bool = False


@dataclass(frozen=True)
class Column:
    """Axis as numbers."""

    key: str
    #: Of the parameter; empty if it has none.
    unit: str
    #: Numbers in SI units, or texts.
    values: tuple[float | str, ...]
    logarithmic: bool

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return all(isinstance(value, (int, float)) for value in self.values)


class Varied(NamedTuple):
    """Reading of ``--vary``: words, or two ends as they were written, with a unit after both."""

    key: str
    words: tuple[str, ...] = ()
    ends: tuple[str, str] = ("", "")
    unit: str = ""
    steps: str = ""
    logarithmic: bool = False


def read_varied(text: str, *names: str) -> Varied:
    """Read a variation: KEY=A,B,C or KEY=LOW:HIGH[:log], with a count if there are three `names` of parts."""
    form = ":".join(names)
    key, _, values = (part.strip() for part in text.partition("="))
    if not key or not values:
        rule = f"must be KEY={form}, KEY={form}:log or KEY=A,B,C"
        raise ParameterError("--vary", "", rule, repr(text))

    def require(holds: bool, rule: str) -> None:
        if not holds:
            raise ParameterError(f"--vary {key}", "", rule, repr(values))

    parts = [part.strip() for part in normalize(values).split(":")]
    if len(parts) == 1:
        words = tuple(word.strip() for word in values.split(","))
        require(all(words), "must have a value between commas")
        require(len(set(words)) == len(words), "must not name a value twice")
        return Varied(key, words)
    logarithmic, at = parts[len(names) :] == ["log"], f"at {names[0]} and {names[1]}"
    count = "" if len(names) > 2 else ", without a count"
    require(len(parts) == len(names) + logarithmic, f"must be {form} or {form}:log{count}")
    (low, _, unit), (high, _, other) = (end.partition(" ") for end in parts[:2])
    require(unit.strip() == other.strip(), f"must have the same unit {at}")
    require(all(map(is_number, (low, high))), f"must have a number {at}")
    start, stop = float(low), float(high)
    different = math.isfinite(start) and math.isfinite(stop) and start != stop
    require(different, f"must have two different finite numbers {at}")
    positive = min(start, stop) > 0.0
    require(positive or not logarithmic, f"must have numbers above 0 {at} for a logarithmic scale")
    return Varied(key, (), (low, high), unit.strip(), "".join(parts[2 : len(names)]), logarithmic)


def is_number(word: str) -> bool:
    """Return whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def read_axis(text: str) -> Axis:
    """Read an axis, ``control.force_gain=1:10:10``; ParameterError in one line: key, rule, value."""
    varied = read_varied(text, "START", "STOP", "COUNT")
    if varied.words:
        return Axis(varied.key, varied.words)
    if not varied.steps.isdecimal() or not 2 <= int(varied.steps) <= MOST:
        rule = f"must have a whole number from 2 to {MOST} at COUNT"
        raise ParameterError(f"--vary {varied.key}", "", rule, repr(text.partition("=")[2].strip()))
    low, high = varied.ends
    spread = np.geomspace if varied.logarithmic else np.linspace
    values = spread(float(low), float(high), int(varied.steps)).tolist()
    # Twelve digits: 0.3, and not 0.30000000000000004.
    numbers = [low, *(f"{value:.12g}" for value in values[1:-1]), high]
    words = tuple(f"{number} {varied.unit}".strip() for number in numbers)
    return Axis(varied.key, words, varied.logarithmic)


def refuse_twice(keys: Sequence[str], settings: Sequence[Setting]) -> None:
    """Refuse a parameter that is varied twice, or that another option changes too."""
    for key in keys:
        if keys.count(key) > 1:
            raise ParameterError(
                f"--vary {key}", "", "must be given once", f"{keys.count(key)} times"
            )
        for setting in settings:
            if setting.key == key:
                rule = f"must not be given to {setting.option} as well"
                raise ParameterError(f"--vary {key}", "", rule, key)


def make_axis(key: str, values: Iterable[Any], write: Callable[[Any], str] = write_word) -> Axis:
    """Return an axis of values, which `write` makes words; ParameterError for none, or equal ones."""
    if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
        raise ParameterError(key, "", "must be varied over a list of values", shorten(repr(values)))
    words = tuple(map(write, values))
    if not words:
        raise ParameterError(key, "", "must be varied over at least one value", "none")
    if len(set(words)) < len(words):
        raise ParameterError(key, "", "must not have a value twice", shorten(", ".join(words)))
    return Axis(key, words)


def make_points(
    source: Source,
    settings: Sequence[Setting],
    axes: Sequence[Axis],
    progress: Progress = None,
    *,
    option: str = "--vary",
) -> list[Point]:
    """Make the scenes of all points of a sweep; refuse a value for which no point has a scene.

    `option`: the name of what varies in messages.
    """
    keys = [axis.key for axis in axes]
    refuse_twice(keys, settings)
    count = math.prod(len(axis.words) for axis in axes)
    if count > MOST:
        raise ParameterError(option, "", f"must come to {MOST} points at most", f"{count} points")
    make_scene(*read_source(source), settings)  # reports an error of the file itself first
    rows = list(itertools.product(*(axis.words for axis in axes)))
    points = place_points(source, settings, keys, rows, progress=progress, option=option)
    for number, axis in enumerate(axes):
        sound = {point.words[number] for point in points if point.scene}
        for word in axis.words:
            if word not in sound:
                raise SceneError(
                    next(point.error for point in points if point.words[number] == word)
                )
    return points


def place_points(
    source: Source,
    settings: Sequence[Setting],
    keys: Sequence[str],
    rows: Sequence[tuple[str, ...]],
    *,
    first: int = 0,
    progress: Progress = None,
    option: str = "--vary",
) -> list[Point]:
    """Make the scenes of given points; incompatible values make a point with an error."""
    path, table = read_source(source)
    parts, points = ReadParts(), list[Point]()
    for index, words in enumerate(rows, first):
        varied = [Setting(key, word, option) for key, word in zip(keys, words, strict=True)]
        try:
            points.append(Point(index, words, make_scene(path, table, [*settings, *varied], parts)))
        except SceneError as error:
            points.append(Point(index, words, None, str(error)))
        if progress:
            progress(index - first + 1, len(rows))
    return points


def make_columns(points: Sequence[Point], axes: Sequence[Axis]) -> list[Column]:
    """Return the axes in numbers, from the scenes of all points of a sweep."""
    columns = []
    for number, axis in enumerate(axes):
        scenes = {point.words[number]: point.scene for point in reversed(points) if point.scene}
        values = tuple(find_value(scenes[word], axis.key, word) for word in axis.words)
        declared = next((find_quantity(scene, axis.key) for scene in scenes.values()), None)
        columns.append(
            Column(axis.key, declared.unit if declared else "", values, axis.logarithmic)
        )
    return columns


def _find_parts(scene: Scene, key: str) -> tuple[list[Any], str, str]:
    """Return the parts with a parameter, of one finger or all, its name, and its number in a list or ``""``.

    `key`: as of a setting.
    """
    first, *rest = split_key(key)
    chosen = rest.pop(0) if first == FINGERS and len(rest) > 2 else ""
    section = rest.pop(0) if chosen else first
    parts = enumerate(scene.list_parts(section), 1)
    name, _, number = ".".join(rest).partition(".")
    return [part for finger, part in parts if chosen in ("", str(finger))], name, number


def find_quantity(scene: Scene, key: str) -> Quantity | None:
    """Return the declaration of a parameter of a scene, or None."""
    parts, name, _ = _find_parts(scene, key)
    declared = (list_quantities(part).get(name) for part in parts if isinstance(part, Parameters))
    return next(declared, None)


def find_numbers(scene: Scene, key: str) -> list[float]:
    """Return the different values of a parameter that are numbers: those of fingers may differ."""
    parts, name, number = _find_parts(scene, key)
    values = [getattr(part, name, None) for part in parts if name]
    if number:
        lists = [value for value in values if isinstance(value, tuple)]
        values = [
            value for each in lists for index, value in enumerate(each, 1) if str(index) == number
        ]
    return [
        value
        for value in dict.fromkeys(values)
        if isinstance(value, (int, float)) and not isinstance(value, bool)
    ]


def find_value(scene: Scene, key: str, word: str) -> float | str:
    """Return the value of a word in a scene if it is a number, the same for all fingers; else the word."""
    numbers = find_numbers(scene, key)
    return numbers[0] if len(numbers) == 1 else word


#: Most different words of a parameter that all count as its ends.
WORDS = 8


def find_ends(points: Sequence[Point], keys: Sequence[str]) -> list[Point]:
    """Return the points at the ends of each parameter, or with each of its words, in their order.

    Of several at an end: those with the lowest and highest other parameters, the corners of a grid.
    """
    sound = [(point, point.scene) for point in points if point.scene]
    if not sound:
        return []
    ranks = np.empty((len(keys), len(sound)))
    ends: list[Sequence[int]] = []
    for number, key in enumerate(keys):
        values = np.array([find_value(scene, key, point.words[number]) for point, scene in sound])
        different, ranks[number] = np.unique(values, return_inverse=True)
        last = len(different) - 1
        ends.append(range(last + 1) if values.dtype.kind == "U" and last < WORDS else (0, last))
    height = (ranks / np.maximum(ranks.max(axis=1, keepdims=True), 1)).sum(axis=0)
    chosen: set[int] = set()
    for row, ends_of_row in zip(ranks, ends, strict=True):
        for end in ends_of_row:
            at_end = np.flatnonzero(row == end)
            chosen |= {int(at_end[height[at_end].argmin()]), int(at_end[height[at_end].argmax()])}
    return [sound[index][0] for index in sorted(chosen)]
