"""Folder of a sweep: its definition, one small file a finished point, and the table of all."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import OutputError
from ..control.methods import find_method
from ..files.run_folder import format_json, read_json, write_whole
from ..metrics.metric_table import ERRORS
from ..scene.toml_table import format_scene, write_part
from .axes import Axis, Point
from .evaluation import FIGURES, TIMES, Record, evaluate
from .series import Kind, open_series

#: The file by which a folder is known as a sweep's, and the folder of its points.
MARK, POINTS = "sweep.json", "points"
#: The comment at the end of a line of a scene file.
NOTE = re.compile(r'  # [^"\n]*$', re.MULTILINE)


@dataclass(frozen=True)
class Folder:
    """Folder of a sweep."""

    path: Path

    def read_records(self) -> dict[int, Record]:
        """Return what is kept of the finished points, by their index."""
        records = {}
        for path in self.path.glob(f"{POINTS}/*.json"):
            record = read_json(path)  # a file that cannot be read is a point to be done again
            if path.stem.isdecimal() and record is not None and record.keys() & {"figures", "error"}:
                records[int(path.stem)] = record
        return records

    def keep(self, point: Point, keys: Sequence[str], record: Record) -> None:
        """Write the file of a finished point, whole or not at all. `keys`: the varied parameters."""
        values = dict(zip(keys, point.words, strict=True))
        write_whole(self.path / POINTS / f"{point.index:06d}.json", format_json({"values": values, **record}))

    def keep_bundle(
        self,
        bundle: Sequence[Point],
        found: Sequence[Record | None],
        keys: Sequence[str],
        records: dict[int, Record],
    ) -> None:
        """Write the files of the finished points of a bundle, and add their records to those of all.

        `found`: none for a point that was stopped; `keys`: the varied parameters; `records`: of all points
        that are done, by their index; what is there stays.
        """
        for point, record in zip(bundle, found, strict=True):
            if record is not None and point.index not in records:
                self.keep(point, keys, record)
                records[point.index] = record


def select_done(records: Mapping[int, Record], *, errors: bool) -> dict[int, Record]:
    """Return the records of points that need not be run again.

    `records`: that are kept; `errors`: whether errors are asked for: a point without them is not done.
    """
    return {
        index: record
        for index, record in records.items()
        if not errors or "error" in record or record["figures"].keys() >= ERRORS.keys()
    }


def find_unfinished(
    bundles: Iterable[Sequence[Point]], records: Mapping[int, Record]
) -> list[Sequence[Point]]:
    """Return the bundles that are to be run: those of which a point is missing, whole.

    Without the others of its batch the results of a point would be others in the last bit.

    `records`: of the points that are done.
    """
    return [bundle for bundle in bundles if any(point.index not in records for point in bundle)]


def hash_points(points: Sequence[Point]) -> str:
    """Return a number that identifies the scenes of points, without the comments of their files."""
    scenes = hashlib.sha256()
    written: dict[tuple[Any, ...], list[str]] = {}

    def write(section: str, part: Any, method: str = "") -> list[str]:
        # Points have most parts in common, and all of them are there until the end: a part is its address.
        # Its comments are taken out of all of its lines at once, which is much faster than line by line.
        key = section, method, id(part)
        if key not in written:
            lines = "\n".join(write_part(section, part, method))
            written[key] = [NOTE.sub("", lines)] if lines else []
        return written[key]

    for point in points:
        scenes.update((format_scene(point.scene, write) if point.scene else point.error).encode())
        if point.scene is not None:
            scenes.update(find_method(point.scene.method).digest.encode())  # nothing, of a built-in one
    return scenes.hexdigest()


@contextmanager
def open_sweep(path: Path, points: Sequence[Point], axes: Sequence[Axis], version: str) -> Iterator[Folder]:
    """Make a sweep's folder, or go on with one that holds the same sweep; nobody else works in it meanwhile.

    `points`: all of the sweep; `version`: of digiclay: another one may come to other figures. Raises
    OutputError when it holds anything else, cannot be written, or another process works in it.
    """
    plan = {
        "digiclay": version,
        "axes": [{"key": one.key, "values": list(one.words)} for one in axes],
        "points": len(points),
    }
    description = {**plan, "scenes": hash_points(points)}
    folder = Folder(path)

    def refuse_another(there: Any) -> None:
        if there == description:
            return
        older = isinstance(there, dict) and there == {**plan, "identity": there.get("identity")}
        if older and _agrees(folder.read_records(), points):
            return
        try:
            varied = " and ".join(one["key"] for one in there["axes"])
            said = f"{there['points']} points over {varied}, digiclay {there['digiclay']}"
        except (KeyError, TypeError):
            said = f"its {MARK} cannot be read"
        raise OutputError(f"{path} holds another sweep ({said}): choose another folder with --out.")

    with open_series(path, Kind("sweep", MARK, (POINTS,)), description, refuse_another):
        yield folder


def _agrees(records: Mapping[int, Record], points: Sequence[Point]) -> bool:
    """Return whether the first point that is kept comes to the same figures once more.

    Older descriptions identify scenes by a number that depends on the wording of their comments.
    """
    for index, record in sorted(records.items()):
        scene = points[index].scene if index < len(points) else None
        if scene is not None and "figures" in record:
            known, again = record["figures"], (evaluate(scene) or {}).get("figures", {})
            names = known.keys() - {*TIMES, *ERRORS}
            return all(_is_close(known[name], again.get(name)) for name in names)
    return not records


def _is_close(one: float | None, other: float | None) -> bool:
    """Return whether a figure is the same but for rounding."""
    if one is None or other is None:
        return one is other
    return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-12)


def make_grid(records: Mapping[int, Record], axes: Sequence[Axis], name: str) -> NDArray[np.float64]:
    """Return a figure at all points, one dimension an axis; NaN where there is none.

    `records`: by the index of their point; `name`: a key of `evaluation.FIGURES`.
    """
    shape = [len(one.words) for one in axes]
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
    """Return points as CSV: the varied parameters, the metrics, and the error; SI units, in the header.

    `varied` (str, str), key and unit of each parameter; `rows`: their values at each point; `records`: of
    each point; `names`: keys of `evaluation.FIGURES`.
    """
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    units = [*varied, *((name, FIGURES[name].unit) for name in names)]
    writer.writerow([*(f"{name} ({unit})" if unit else name for name, unit in units), "error"])
    for values, record in zip(rows, records, strict=True):
        figures = record.get("figures", {})
        written = [repr(figures[name]) if figures.get(name) is not None else "" for name in names]
        writer.writerow([*values, *written, record.get("error", "")])
    return lines.getvalue()
