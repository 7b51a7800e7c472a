"""Folder of a series of points: its definition, a small file per finished point, and the table of all."""

import csv
import hashlib
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import OutputError
from ..control.methods import find_method
from ..files.run_folder import format_json, read_json, write_whole
from ..files.tables import Record, Table
from ..metrics.metric_table import ERRORS, describe_losses
from ..scene.toml_table import format_scene
from .axes import Axis, Point
from .evaluation import FIGURES, TIMES, evaluate
from .series import Kind, open_series

#: The folder of the points.
POINTS = "points"
#: Figures of every table, besides the requested ones.
EFFORT = ("run_time", "height_error", "force_error")
#: The comment at the end of a line of a scene file.
NOTE = re.compile(r'  # [^"\n]*$', re.MULTILINE)


@dataclass(frozen=True)
class Folder:
    """Folder of a series of points."""

    path: Path

    def read_records(self) -> dict[int, Record]:
        """Return the finished points by index."""
        records = {}
        for path in self.path.glob(f"{POINTS}/*.json"):
            record = read_json(path)  # a point with an unreadable file is evaluated again
            if (
                not path.stem.isdecimal()
                or record is None
                or not record.keys() & {"figures", "error"}
            ):
                continue
            records[int(path.stem)] = record
        return records

    def keep(self, point: Point, keys: Sequence[str], record: Record) -> None:
        """Write the file of a finished point, complete or not at all. `keys`: the varied parameters."""
        values = dict(zip(keys, point.words, strict=True))
        write_whole(
            self.path / POINTS / f"{point.index:06d}.json",
            format_json({"values": values, **record}),
        )

    def clear(self) -> None:
        """Remove the files of all points."""
        for path in self.path.glob(f"{POINTS}/*.json"):
            path.unlink()


def hash_points(points: Sequence[Point]) -> str:
    """Return a number that identifies the scenes of points, without the comments of their files."""
    scenes = hashlib.sha256()
    for point in points:
        text = NOTE.sub("", format_scene(point.scene)) if point.scene else point.error
        scenes.update(text.encode())
        if point.scene is not None:
            # A built-in method's digest is empty.
            scenes.update(find_method(point.scene.method).digest.encode())
    return scenes.hexdigest()


@contextmanager
def open_points(
    path: Path,
    name: str,
    description: Table,
    describe: Callable[[Table], str],
    accept: Callable[[Table, Folder], bool] = lambda there, folder: False,
) -> Iterator[Folder]:
    """Make the folder of a series of points, or continue one of the same description, and lock it."""
    folder, mark = Folder(path), f"{name}.json"

    def refuse_another(there: Any) -> None:
        if there == description or (isinstance(there, dict) and accept(there, folder)):
            return
        try:
            content = describe(there)
        except (AttributeError, KeyError, TypeError):
            content = f"its {mark} cannot be read"
        raise OutputError(
            f"{path} holds another {name} ({content}): choose another folder with --out."
        )

    with open_series(path, Kind(name, mark, (POINTS,)), description, refuse_another):
        yield folder


def open_sweep(
    path: Path, points: Sequence[Point], axes: Sequence[Axis], version: str
) -> AbstractContextManager[Folder]:
    """Open the folder of a sweep, see `open_points`; other versions of digiclay may have other figures."""
    plan = {
        "digiclay": version,
        "axes": [{"key": axis.key, "values": list(axis.words)} for axis in axes],
        "points": len(points),
    }

    def describe(there: Table) -> str:
        varied = " and ".join(axis["key"] for axis in there["axes"])
        return f"{there['points']} points over {varied}, digiclay {there['digiclay']}"

    def accept(there: Table, folder: Folder) -> bool:
        older = there == {**plan, "identity": there.get("identity")}
        return older and _agrees(folder.read_records(), points)

    return open_points(path, "sweep", {**plan, "scenes": hash_points(points)}, describe, accept)


def _agrees(records: Mapping[int, Record], points: Sequence[Point]) -> bool:
    """Return whether the first stored point has the same figures when evaluated again.

    Older descriptions identify scenes by a number that depends on the wording of their comments.
    """
    for index, record in sorted(records.items()):
        scene = points[index].scene if index < len(points) else None
        if scene is not None and "figures" in record:
            stored, again = record["figures"], (evaluate(scene) or {}).get("figures", {})
            names = stored.keys() - {*TIMES, *ERRORS}
            return all(_is_close(stored[name], again.get(name)) for name in names)
    return not records


def _is_close(figure: float | None, other: float | None) -> bool:
    """Return whether two figures agree except for rounding."""
    if figure is None or other is None:
        return figure is other
    return math.isclose(figure, other, rel_tol=1e-6, abs_tol=1e-12)


def make_grid(
    records: Mapping[int, Record], axes: Sequence[Axis], name: str
) -> NDArray[np.float64]:
    """Return a figure of `evaluation.FIGURES` at all points, a dimension per axis; NaN: absent."""
    shape = [len(axis.words) for axis in axes]
    values = np.full(int(np.prod(shape)), np.nan)
    for index, record in records.items():
        value = record.get("figures", {}).get(name)
        values[index] = np.nan if value is None else value
    return values.reshape(shape)


def format_table(
    varied: Sequence[tuple[str, str]],
    rows: Iterable[Sequence[Any]],
    records: Iterable[Record],
    names: Sequence[str],
) -> str:
    """Return points as CSV: varied parameters, metrics, time and errors, losses, failure; SI units on top."""
    names = list(dict.fromkeys((*names, *EFFORT)))
    units = [*varied, *((name, FIGURES[name].unit) for name in names)]
    heads = [*(f"{name} ({unit})" if unit else name for name, unit in units), "lost", "error"]
    return format_csv([heads, *make_rows(rows, records, names)])


def make_rows(
    rows: Iterable[Sequence[Any]], records: Iterable[Record], names: Sequence[str]
) -> Iterator[list[Any]]:
    """Yield the rows of a table of points: varied values, metrics, losses, and why a point failed."""
    for values, record in zip(rows, records, strict=True):
        metrics = map(record.get("figures", {}).get, names)
        yield [*values, *metrics, describe_losses(record), record.get("error", "")]


def format_csv(rows: Iterable[Sequence[Any]]) -> str:
    """Return rows as CSV."""
    lines = io.StringIO()
    csv.writer(lines, lineterminator="\n").writerows(rows)
    return lines.getvalue()
