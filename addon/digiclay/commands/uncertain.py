"""Bands of 95 % of a run's metrics over the intervals of fitted files: options, members, table, file."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..core.base.errors import DigiclayError, OutputError
from ..core.files.run_folder import format_json, write_whole
from ..core.files.tables import Record
from ..core.metrics.bands import LEAST, find_band
from ..core.metrics.metric_table import FREE, METRICS
from ..core.scene.scene_source import find
from ..core.session.run_scene import Result
from ..core.studies.axes import Point
from ..core.studies.evaluation import TIMES, explain_failed_batches, make_bundles
from ..core.studies.speed_limits import find_free_speed
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
    **dict.fromkeys(("lag_mean", *FREE), ("", 1.0)),
}
HEAD = ("metric", "value", "95 % band", "half of it", "integration, at most")


def read_members(arguments: Namespace) -> Members:
    """Return the members that the options ask for; their scene gets the parts of the files."""
    files, sizes = arguments.uncertain, (arguments.members, arguments.seed)
    if arguments.budget is not None:
        raise OutputError("--uncertain must be given without --budget, which omits parts.")
    arguments.parts = [*arguments.parts, *files]
    return draw_members(files, find(arguments.scene), settings_of(arguments), *sizes)


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
            words = [*list_options(arguments), "--seed", str(arguments.seed)]
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
    if failed := [row["error"] for row in rows if "error" in row]:
        notes.append(f"{len(failed)} of {len(rows)} members failed; the first: {failed[0]}")
    bands = find_bands(result, [row["figures"] for row in rows if "figures" in row])
    return {"bands": bands, "notes": notes, "members": rows}


def _make_row(keys: Sequence[str], point: Point, record: Record) -> Record:
    """Return a member in the file: its values, and its record but for times, which differ each time."""
    row = {"values": dict(zip(keys, map(float, point.words), strict=True)), **record}
    if point.scene and "figures" in record:
        figures = {name: value for name, value in record["figures"].items() if name not in TIMES}
        row["figures"] = {**figures, "free_rise": find_free_speed(point.scene)}
    return row


def find_bands(result: Result, figures: Sequence[Record]) -> dict[str, Record]:
    """Return the band of each metric that is not 0, in SI; `figures`: of the members."""
    bands: dict[str, Record] = {}
    nominal = {**result.metrics, "free_rise": find_free_speed(result.scene)}
    for name, (error, factor) in BANDED.items():
        values = [member[name] for member in figures if member[name] is not None]
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
        metric, count = {**METRICS, **FREE}[name], band["members"]
        few = f" of {count}" if count < len(content["members"]) else ""
        value, low, high = (metric.factor * number for number in (band["value"], *band["ends"]))
        error = metric.factor * (band["integration"] or 0.0)
        rows.append(
            [
                metric.title,
                f"{value:.4g}",
                f"{low:.4g} to {high:.4g}{few}",
                f"± {50.0 * (high - low) / abs(value):.2g} %",
                f"± {error:.2g}" if error else "–",
            ]
        )
    yield from table(HEAD, rows)
    yield from content["notes"]
