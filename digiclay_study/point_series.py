"""Series of points in a folder: start, evaluation on a pool, end, and the table of all points."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.commands.evaluation_pool import open_pool
from digiclay.commands.progress import Counted
from digiclay.commands.stop import Stop
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.base.whole_files import write_whole
from digiclay.core.studies.axes import Point, find_value
from digiclay.core.studies.evaluation import Pool, Record
from digiclay.core.studies.series import Kind, open_series
from digiclay.core.studies.sweep_plan import (
    POINTS,
    Folder,
    find_unfinished,
    format_table,
    hash_points,
    select_done,
)

from .ranges import Range
from .subject import Subject

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
    subject : Subject
    folder : Folder
    pool : Pool
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
