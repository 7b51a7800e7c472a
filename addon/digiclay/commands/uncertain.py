"""Bands of 95 % of a run's metrics over the intervals of fitted files: options, members, table, file."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ..core.base.errors import DigiclayError, OutputError
from ..core.files.run_folder import format_json, write_whole
from ..core.files.tables import Record
from ..core.metrics.bands import LEAST, find_band
from ..core.metrics.metric_table import FREE, METRICS, SPEEDS
from ..core.scene.scene_source import find
from ..core.session.run_scene import Result
from ..core.studies.axes import Point
from ..core.studies.evaluation import TIMES, explain_failed_batches, make_bundles
from ..core.studies.speed_limits import (
    LOW,
    MOTIONS,
    describe_end,
    find_free_speed,
    make_trial,
    measure_speeds,
)
from ..core.studies.uncertainty import Members, draw_members
from .arguments import say, settings_of
from .evaluation_pool import Evaluation
from .progress import table, tell_stopped_before
from .stop import STOPPED, Stop

#: The file in the folder of a run.
FILE = "uncertainty.json"
#: Metrics that have bands. The integration changes them at most by this estimated error, a difference of
#: two heights by twice that of one.
BANDED: dict[str, tuple[str, float]] = {
    **dict.fromkeys(("rfd", "rfd_shaping", "max_total_force"), ("total_force_error", 1.0)),
    "height_range": ("height_error", 2.0),
    "ridge_error": ("height_error", 1.0),
    **dict.fromkeys(("lag_mean", *FREE, *SPEEDS), ("", 1.0)),
}
HEAD = ("metric", "value", "95 % band", "half of it", "integration, at most")


def read_members(arguments: Namespace) -> Members:
    """Return the members that the options ask for; their scene gets the parts of the files."""
    files, sizes = arguments.uncertain, (arguments.members, arguments.seed)
    if arguments.budget is not None:
        raise OutputError("--uncertain must be given without --budget, which omits parts.")
    arguments.parts = [*arguments.parts, *files]
    members = draw_members(files, find(arguments.scene), settings_of(arguments), *sizes)
    if arguments.speed:
        _refuse_motions(members)
    return members


def _refuse_motions(members: Members) -> None:
    """Refuse beds on which the fingertip cannot move as the search for speeds moves it."""
    scene = next(point.scene for point in members.points if point.scene)
    if scene.bodies or not any(scene.list_parts("fingertip")):
        raise OutputError("--speed needs a fingertip, and no bodies beside it.")
    for motion in MOTIONS.values():
        make_trial(scene, motion, LOW)


def list_options(arguments: Namespace) -> list[str]:
    """Return the options that draw the same members with the same seed."""
    words = [word for file in arguments.uncertain for word in ("--uncertain", str(file))]
    return [*words, "--members", str(arguments.members)] if words else []


def add_bands(arguments: Namespace, members: Members, result: Result, run: Path, stop: Stop) -> int:
    """Add the bands of a run to its folder, and print them; return the exit code."""
    content = None
    try:
        content = measure(arguments, members, result, stop)
    finally:
        if content is None:  # also when the processes broke down
            speed = ["--speed"] if arguments.speed else []
            words = [*list_options(arguments), *speed, "--seed", str(arguments.seed)]
            tell_stopped_before(FILE, ["run", str(run), *words, "--out", str(run), "--overwrite"])
    if content is None:
        return STOPPED
    write_whole(run / FILE, format_json(content))
    if not content["bands"]:
        raise DigiclayError(f"No metric has {LEAST} members: {content['notes'][-1]}")
    say(arguments, *describe(content))
    return 0


def measure(arguments: Namespace, members: Members, result: Result, stop: Stop) -> Record | None:
    """Run the members, and return the content of the file; None after a stop."""
    points, bundles = members.points, make_bundles(members.points)
    with Evaluation(arguments, "bands", None, len(points), stop) as evaluation:
        evaluation.finish(bundles.every, members.keys)
        records = evaluation.collect()
    if len(records) < len(points):
        return None
    rows = [_make_row(members.keys, point, records[point.index]) for point in points]
    notes = [members.note, *bundles.describe(), *explain_failed_batches(records)]
    notes += _note_failed(rows, "failed")
    nominal = {**result.metrics, "free_rise": find_free_speed(result.scene)}
    if arguments.speed:
        speeds = _search_speeds(arguments, members, result, stop)
        if not speeds:
            return None
        *searched, scene_speeds = (speed.get("figures", {}) for speed in speeds)
        nominal |= scene_speeds
        for row, figures in zip(rows, searched, strict=True):
            row["figures"] = row.get("figures", {}) | figures
        notes += _note_failed(speeds[:-1], "have no largest speeds")
    bands = find_bands(nominal, [row["figures"] for row in rows if "figures" in row])
    return {"bands": bands, "notes": notes, "members": rows}


def _search_speeds(
    arguments: Namespace, members: Members, result: Result, stop: Stop
) -> list[Record]:
    """Return the records of the largest speeds of the members, and of the scene; empty after a stop."""
    count = len(members.points)
    every = [*members.points, Point(count, (), result.scene)]
    with Evaluation(arguments, "speeds", None, len(every), stop) as evaluation:
        bundles = [(replace(point, measure=measure_speeds),) for point in every]
        evaluation.finish(bundles, members.keys)
        speeds = evaluation.collect()
    return [speeds[point.index] for point in every] if len(speeds) == len(every) else []


def _note_failed(records: Sequence[Record], what: str) -> list[str]:
    """Return a line on the members that failed, if there are any."""
    failed = [record["error"] for record in records if "error" in record]
    return (
        [f"{len(failed)} of {len(records)} members {what}; the first: {failed[0]}"]
        if failed
        else []
    )


def _make_row(keys: Sequence[str], point: Point, record: Record) -> Record:
    """Return a member in the file: its values, and its record but for times, which differ each time."""
    row = {"values": dict(zip(keys, map(float, point.words), strict=True)), **record}
    if point.scene and "figures" in record:
        figures = {name: value for name, value in record["figures"].items() if name not in TIMES}
        row["figures"] = {**figures, "free_rise": find_free_speed(point.scene)}
    return row


def find_bands(nominal: Record, figures: Sequence[Record]) -> dict[str, Record]:
    """Return the band of each metric that is not 0, in SI; figures of the scene and of its members."""
    bands: dict[str, Record] = {}
    for name, (error, factor) in BANDED.items():
        values = [member[name] for member in figures if member.get(name) is not None]
        ends = find_band(values)
        if nominal.get(name) and ends:
            bands[name] = {
                "value": nominal[name],
                "ends": ends,
                "integration": nominal[error] * factor if error in nominal else None,
                "members": len(values),
            }
    return bands


def describe(content: Record) -> Iterator[str]:
    """Give the table of the bands, and lines on the members."""
    rows = []
    for name, band in content["bands"].items():
        metric, count = {**METRICS, **FREE, **SPEEDS}[name], band["members"]
        few = f" of {count}" if count < len(content["members"]) else ""
        numbers = (band["value"], *band["ends"])
        value, low, high = (metric.factor * number for number in numbers)
        error = metric.factor * (band["integration"] or 0.0)
        # Speeds are searched in a range: what is beyond its ends has no number.
        beyond = [describe_end(number or None) if name in SPEEDS else "" for number in numbers]
        shown = [
            end or f"{number:.4g}" for end, number in zip(beyond, (value, low, high), strict=True)
        ]
        half = "–" if any(beyond) else f"± {50.0 * (high - low) / abs(value):.2g} %"
        rows.append(
            [
                metric.title,
                shown[0],
                f"{shown[1]} to {shown[2]}{few}",
                half,
                f"± {error:.2g}" if error else "–",
            ]
        )
    yield from table(HEAD, rows)
    yield from content["notes"]
