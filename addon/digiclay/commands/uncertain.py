"""Bands of 95 % of a run's metrics over the intervals of fitted files: options, members, table, file."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..core.base.errors import DigiclayError, OutputError
from ..core.files.run_folder import format_json, write_whole
from ..core.files.tables import Record
from ..core.metrics.metric_table import FREE, METRICS
from ..core.scene.scene_source import find
from ..core.session.run_scene import Result
from ..core.studies.axes import Point
from ..core.studies.evaluation import TIMES, explain_failed_batches, make_bundles
from ..core.studies.series import finish
from ..core.studies.speed_limits import find_free_speed
from ..core.studies.uncertainty import LEAST, MEMBERS, MOST, Members, draw_members, find_band
from .arguments import settings_of, whole_number
from .evaluation_pool import open_pool
from .progress import Counted
from .progress import table as aligned
from .stop import Stop

#: Options of the uncertainty.
UNCERTAIN: dict[str, Any] = {
    "--uncertain FILE": {
        "type": Path,
        "action": "append",
        "default": [],
        "help": "take the parts of a fitted file, and add bands of 95 %% over its intervals",
    },
    "--members N": (whole_number(LEAST, MOST), f"runs for them; default: {MEMBERS}", MEMBERS),
    "--seed N": (whole_number(1, 2**31), "of their random numbers; default: 1", 1),
}
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


def draw(arguments: Namespace) -> Members | None:
    """Return the members that the options ask for; their scene gets the parts of the files."""
    files, sizes = arguments.uncertain, (arguments.members, arguments.seed)
    if not files:
        if sizes != (MEMBERS, 1) or arguments.workers or arguments.scheduler:
            rule = "must be given with --uncertain only"
            raise OutputError(f"--members, --seed, --workers and --scheduler {rule}.")
        return None
    if arguments.budget is not None:
        raise OutputError("--uncertain must be given without --budget, which omits parts.")
    arguments.parts = [*arguments.parts, *files]
    return draw_members(files, find(arguments.scene), settings_of(arguments), *sizes)


def list_words(arguments: Namespace) -> list[str]:
    """Return the options of the uncertainty."""
    words = [word for file in arguments.uncertain for word in ("--uncertain", str(file))]
    return [*words, "--members", str(arguments.members), "--seed", str(arguments.seed)]


def measure(arguments: Namespace, members: Members, result: Result, stop: Stop) -> Record | None:
    """Run the members, and return the content of the file; None after a stop."""
    points, records = members.points, dict[int, Record]()
    bundles = make_bundles(points)

    def keep(bundle: Sequence[Point], evaluated: Sequence[Record | None]) -> None:
        for point, record in zip(bundle, evaluated, strict=True):
            if record is not None:
                records[point.index] = record

    def fail(bundle: Sequence[Point], why: str) -> None:
        keep(bundle, [{"error": why}] * len(bundle))

    with Counted(sys.stderr, "bands", "members", quiet=arguments.quiet) as bar:

        def draw_bar(note: str) -> None:
            bar(len(records), len(points), note)

        with open_pool(arguments, len(bundles.every), stop, draw_bar) as evaluate:
            finish(evaluate(bundles.every), keep, fail)
    if len(records) < len(points):
        return None
    for point in points:
        figures = records[point.index].get("figures", {})
        for name in TIMES:  # others each time
            figures.pop(name, None)
        if point.scene and figures:
            figures["free_rise"] = find_free_speed(point.scene)
    every = [records[point.index] for point in points]
    notes = [members.note, *bundles.describe(), *explain_failed_batches(records)]
    if failed := [record["error"] for record in every if "error" in record]:
        notes.append(f"{len(failed)} of {len(every)} members failed; the first: {failed[0]}")
    bands = find_bands(result, [record["figures"] for record in every if "figures" in record])
    values = [map(float, point.words) for point in points]
    rows = [
        {"values": dict(zip(members.keys, each, strict=True)), **record}
        for each, record in zip(values, every, strict=True)
    ]
    return {"bands": bands, "notes": notes, "members": rows}


def find_bands(result: Result, figures: Sequence[Record]) -> dict[str, Record]:
    """Return the band of each metric that is not 0, in SI; `figures`: of the members."""
    bands: dict[str, Record] = {}
    own = {**result.metrics, "free_rise": find_free_speed(result.scene)}
    for name, (error, factor) in BANDED.items():
        values = [each[name] for each in figures if each[name] is not None]
        if own.get(name) and (ends := find_band(values)):
            integration = own[error] * factor if error in own else None
            bands[name] = {
                "value": own[name],
                "ends": ends,
                "integration": integration,
                "members": len(values),
            }
    return bands


def describe(content: Record) -> Iterator[str]:
    """Give the table of the bands, and lines on the members."""
    rows = []
    for name, band in content["bands"].items():
        metric, count = {**METRICS, **FREE}[name], band["members"]
        few = f" of {count}" if count < len(content["members"]) else ""
        value, low, high, error = (
            metric.factor * each
            for each in (band["value"], *band["ends"], band["integration"] or 0.0)
        )
        rows.append(
            [
                metric.title,
                f"{value:.4g}",
                f"{low:.4g} to {high:.4g}{few}",
                f"± {50.0 * (high - low) / abs(value):.2g} %",
                f"± {error:.2g}" if error else "–",
            ]
        )
    yield from aligned(HEAD, rows)
    yield from content["notes"]


def write(content: Record | None, folder: Path) -> None:
    """Write the file; refuse to have no band."""
    if content is None:
        return
    write_whole(folder / FILE, format_json(content))
    if not content["bands"]:
        raise DigiclayError(f"No metric has {LEAST} members: {content['notes'][-1]}")
