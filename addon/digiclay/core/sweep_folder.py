"""A sweep's folder: what it is, one small file for each finished point, and the table of all."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import OutputError
from .quantity import quantities
from .scene import Scene
from .scene_table import text
from .series_folder import Kind, series
from .sweep import FIGURES, Point, Record
from .sweep_axis import Axis
from .whole_files import as_json, write_whole

__all__ = ["MARK", "Column", "Folder", "columns", "grid", "opened", "table"]

#: The file by which a folder is known as a sweep's, and the folder of its points.
MARK, POINTS = "sweep.json", "points"


@dataclass(frozen=True)
class Folder:
    """Where a sweep is kept."""

    path: Path

    def done(self) -> dict[int, Record]:
        """Return the points that are finished, by their index."""
        found = {}
        for path in self.path.glob(f"{POINTS}/*.json"):
            try:
                record = json.loads(path.read_text(encoding="utf-8-sig"))
            except (OSError, ValueError):
                continue  # a file that cannot be read is a point to be done again
            if path.stem.isdecimal() and isinstance(record, dict) and record.keys() & {"figures", "error"}:
                found[int(path.stem)] = record
        return found

    def keep(self, point: Point, axes: Sequence[Axis], record: Record) -> None:
        """Write the file of a finished point, whole or not at all."""
        values = {one.key: word for one, word in zip(axes, point.words, strict=True)}
        write_whole(self.path / POINTS / f"{point.index:06d}.json", as_json({"values": values, **record}))


@contextmanager
def opened(path: Path, points: Sequence[Point], axes: Sequence[Axis], version: str) -> Iterator[Folder]:
    """Make a sweep's folder, or go on with one that holds the same sweep; nobody else works in it meanwhile.

    Raises
    ------
    OutputError
        When it holds anything else, cannot be written, or another process works in it.
    """
    identity = hashlib.sha256(version.encode())
    for point in points:
        identity.update((text(point.scene) if point.scene else point.error).encode())
    known = {
        "digiclay": version,
        "axes": [{"key": one.key, "values": list(one.words)} for one in axes],
        "points": len(points),
        "identity": identity.hexdigest(),
    }

    def refuse_another(there: Any) -> None:
        if there == known:
            return
        try:
            varied = " and ".join(one["key"] for one in there["axes"])
            said = f"{there['points']} points over {varied}, digiclay {there['digiclay']}"
        except (KeyError, TypeError):
            said = f"its {MARK} cannot be read"
        raise OutputError(f"{path} holds another sweep ({said}): choose another folder with --out.")

    with series(path, Kind("sweep", MARK, (POINTS,)), known, refuse_another):
        yield Folder(path)


@dataclass(frozen=True)
class Column:
    """An axis in numbers.

    Attributes
    ----------
    key : str
    unit : str
        Of the parameter; empty where it has none.
    values : tuple
        In SI; texts where they are no numbers.
    logarithmic : bool
    """

    key: str
    unit: str
    values: tuple[Any, ...]
    logarithmic: bool

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return all(isinstance(value, (int, float)) for value in self.values)


def columns(points: Sequence[Point], axes: Sequence[Axis]) -> list[Column]:
    """Return the axes in numbers: what the scenes made of their words."""
    found = []
    for number, one in enumerate(axes):
        scenes = {point.words[number]: point.scene for point in reversed(points) if point.scene}
        values = tuple(_value(scenes[word], one.key, word) for word in one.words)
        section, _, name = one.key.partition(".")
        part = next((getattr(scene, section, None) for scene in scenes.values()), None)
        known = quantities(part).get(name) if name and part else None
        found.append(Column(one.key, known.unit if known else "", values, one.logarithmic))
    return found


def _value(scene: Scene, key: str, word: str) -> Any:
    """Return what a scene made of a word, if it is a number."""
    section, _, name = key.partition(".")
    value = getattr(getattr(scene, section, None), name, None) if name else None
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if number else word


def grid(done: Mapping[int, Record], axes: Sequence[Axis], name: str) -> NDArray[np.float64]:
    """Return a figure at all points, one dimension an axis; NaN where there is none."""
    shape = [len(one.words) for one in axes]
    values = np.full(int(np.prod(shape)), np.nan)
    for index, record in done.items():
        value = record.get("figures", {}).get(name)
        values[index] = np.nan if value is None else value
    return values.reshape(shape)


def table(
    points: Sequence[Point], known: Sequence[Column], done: Mapping[int, Record], names: Sequence[str]
) -> str:
    """Return the sweep as CSV: the axes, the figures asked for, and the error; SI units, in the header."""
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    units = [(one.key, one.unit) for one in known] + [(name, FIGURES[name][0]) for name in names]
    writer.writerow([*(f"{name} ({unit})" if unit else name for name, unit in units), "error"])
    for point in points:
        place = np.unravel_index(point.index, [len(one.values) for one in known])
        record = done[point.index]
        figures = record.get("figures", {})
        written = [repr(figures[name]) if figures.get(name) is not None else "" for name in names]
        values = (one.values[at] for one, at in zip(known, place, strict=True))
        writer.writerow([*values, *written, record.get("error", "")])
    return lines.getvalue()
