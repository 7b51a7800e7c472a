"""Axes of a sweep: their text form, the points over them, and columns of numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import ParameterError, SceneError
from ..base.quantity import list_quantities
from ..files.tables import ReadParts
from ..scene.scene_source import Setting, load, make_scene, read_table
from ..scene.schema import Scene

#: More points than this are refused: a slip of the keyboard, not a sweep.
MOST = 10_000
SYNTAX = "must be KEY=START:STOP:COUNT, KEY=START:STOP:COUNT:log or KEY=A,B,C"


@dataclass(frozen=True)
class Axis:
    """One varied parameter.

    Attributes
    ----------
    key : str
        Section and key, ``control.force_gain``.
    words : tuple of str
        Its values as a scene file would say them.
    logarithmic : bool
        Whether they are evenly spaced on a logarithmic scale.
    """

    key: str
    words: tuple[str, ...]
    logarithmic: bool = False


@dataclass(frozen=True)
class Point:
    """One session of a sweep.

    Attributes
    ----------
    index : int
        The last axis varies fastest.
    words : tuple of str
        A value on each axis.
    scene : Scene or None
        None where the values do not go together; `error` says why.
    measure : callable or None
        What is measured of it, see `evaluation.evaluate`; None: the figures of its session. Told the scene
        and whether somebody asks to stop; returns the record, None after a stop.
    """

    index: int
    words: tuple[str, ...]
    scene: Scene | None
    error: str = ""
    measure: Callable[[Scene, Callable[[], bool] | None], dict[str, Any] | None] | None = None


@dataclass(frozen=True)
class Column:
    """Axis as numbers.

    Attributes
    ----------
    unit : str
        Of the parameter; empty where it has none.
    values : tuple
        In SI; texts where they are no numbers.
    """

    key: str
    unit: str
    values: tuple[Any, ...]
    logarithmic: bool

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return all(isinstance(value, (int, float)) for value in self.values)


def read_axis(said: str) -> Axis:
    """Read what varies, and how: ``control.force_gain=1:10:10``.

    Raises ParameterError: in one line: key, rule, value.
    """
    key, _, values = (part.strip() for part in said.partition("="))
    if not key or not values:
        raise ParameterError("--vary", "", SYNTAX, repr(said))
    owner, ends = f"--vary {key}", [part.strip() for part in values.split(":")]
    if len(ends) > 1:
        return _read_range(key, owner, ends, values)
    words = tuple(word.strip() for word in values.split(","))
    if not all(words):
        raise ParameterError(owner, "", "must have a value between commas", repr(values))
    if len(set(words)) < len(words):
        raise ParameterError(owner, "", "must not name a value twice", repr(values))
    return Axis(key, words)


def _read_range(key: str, owner: str, ends: list[str], said: str) -> Axis:
    """Read START:STOP:COUNT and its logarithmic kind."""

    def refusal(rule: str) -> ParameterError:
        return ParameterError(owner, "", rule, repr(said))

    logarithmic = ends[3:] == ["log"]
    if len(ends) != 3 and not logarithmic:
        raise refusal("must be START:STOP:COUNT or START:STOP:COUNT:log")
    (low, _, unit), (high, _, other) = (end.partition(" ") for end in ends[:2])
    if unit != other:
        raise refusal("must have the same unit at START and STOP")
    try:
        start, stop = float(low), float(high)
    except ValueError:
        raise refusal("must have a number at START and STOP") from None
    if not (math.isfinite(start) and math.isfinite(stop)) or start == stop:
        raise refusal("must have two different finite numbers at START and STOP")
    if logarithmic and not (start > 0.0 and stop > 0.0):
        raise refusal("must have numbers above 0 at START and STOP for a logarithmic scale")
    if not ends[2].isdecimal() or not 2 <= int(ends[2]) <= MOST:
        raise refusal(f"must have a whole number from 2 to {MOST} at COUNT")
    values = (np.geomspace if logarithmic else np.linspace)(start, stop, int(ends[2])).tolist()
    # Twelve digits: 0.3, and not 0.30000000000000004.
    inner = [f"{value:.12g}" for value in values[1:-1]]
    words = [f"{number} {unit}".strip() for number in (low, *inner, high)]
    return Axis(key, tuple(words), logarithmic)


def make_points(
    path: Path,
    settings: Sequence[Setting],
    axes: Sequence[Axis],
    progress: Callable[[int, int], None] | None = None,
) -> list[Point]:
    """Make the scenes of all points of a sweep.

    A value that no point can have is refused; values that only do not go together with some
    of the other axes' make a point with an error.

    `path`: the scene's file, which is read once; `settings`: what is changed of it at every point;
    `progress`: told how many points are made, and of how many. Raises ParameterError, SceneError: in one
    line.
    """
    keys = [one.key for one in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise ParameterError(f"--vary {key}", "", "must be given once", f"{keys.count(key)} times")
        if key in [setting.key for setting in settings]:
            raise ParameterError(f"--vary {key}", "", "must not be given to --set as well", key)
    count = math.prod(len(one.words) for one in axes)
    if count > MOST:
        raise ParameterError("--vary", "", f"must come to {MOST} points at most", f"{count} points")
    load(path, settings)  # what is wrong without the axes is told of first
    rows = list(itertools.product(*(one.words for one in axes)))
    points = place_points(path, settings, keys, rows, progress=progress)
    _refuse_hopeless_values(points, axes)
    return points


def place_points(
    path: Path,
    settings: Sequence[Setting],
    keys: Sequence[str],
    rows: Sequence[tuple[str, ...]],
    *,
    first: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> list[Point]:
    """Make the scenes of points anywhere; values that do not go together make a point with an error.

    `path`: the scene's file, which is read once; `settings`: what is changed of it at every point; `keys`:
    varied parameters; `rows`: their values at each point; `first`: index of the first point; `progress`: told
    how many points are made, and of how many.
    """
    table, known, points = read_table(path), ReadParts(), []
    for index, words in enumerate(rows, first):
        varied = [Setting(key, word, "--vary") for key, word in zip(keys, words, strict=True)]
        try:
            points.append(Point(index, words, make_scene(path, table, [*settings, *varied], known)))
        except SceneError as error:
            points.append(Point(index, words, None, str(error)))
        if progress:
            progress(index - first + 1, len(rows))
    return points


def _refuse_hopeless_values(points: Sequence[Point], axes: Sequence[Axis]) -> None:
    """Refuse values that no point can have."""
    for number, one in enumerate(axes):
        sound = {point.words[number] for point in points if point.scene}
        for word in one.words:
            if word not in sound:
                raise SceneError(next(point.error for point in points if point.words[number] == word))


def make_columns(points: Sequence[Point], axes: Sequence[Axis]) -> list[Column]:
    """Return the axes in numbers: what the scenes made of their words. `points`: of the whole sweep."""
    columns = []
    for number, one in enumerate(axes):
        scenes = {point.words[number]: point.scene for point in reversed(points) if point.scene}
        values = tuple(find_value(scenes[word], one.key, word) for word in one.words)
        section, _, name = one.key.partition(".")
        part = next((scene.section(section) for scene in scenes.values()), None)
        known = list_quantities(part).get(name) if name and part else None
        columns.append(Column(one.key, known.unit if known else "", values, one.logarithmic))
    return columns


def find_value(scene: Scene, key: str, word: str) -> Any:
    """Return what a scene made of a word, if it is a number; else the word. `key`: section and key."""
    section, _, name = key.partition(".")
    value = getattr(scene.section(section), name, None) if name else None
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if number else word
