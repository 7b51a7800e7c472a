"""``digiclay sweep``: a scene over a grid of parameter values, on all cores of this machine."""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import DigiclayError, OutputError, ParameterError
from ..core.files.run_folder import write_whole
from ..core.metrics.metric_table import ERRORS
from ..core.scene.scene_source import Setting, find
from ..core.studies.axes import Axis, Column, make_columns, make_points, read_axis
from ..core.studies.evaluation import (
    Record,
    explain_failed_batches,
    find_figure,
    make_bundles,
)
from ..core.studies.sweep_plan import format_table, make_grid, open_sweep
from .arguments import add_scene, name_methods, settings_of
from .evaluation_pool import add_pool, finish_points
from .progress import Counted
from .stop import STOPPED, Stop

EXAMPLES = """\
examples:
  digiclay sweep slow_press --vary control.force_gain=1:10:10 --metric rfd,lag --out gains
  digiclay sweep slow_press --vary control.force_gain=0.5:8:5:log --vary control.dead_band=1e-5,5e-5 --out two
  digiclay sweep my.toml --vary valve.stroke="20 um:40 um:5" --set layout.rows=15 --out strokes

The folder holds points/, a small file for each finished point; sweep.csv; and for one or two
axes a picture of each metric. After Ctrl-C the same command continues. It repeats a failed point
if its file is removed. Points of one bed, parts and steps run together in one call, a batch or
stack, in a fraction of the time; the others are listed. For the metrics height_error,
force_error and total_force_error every point is integrated once more.
"""


def add(commands: Any) -> None:
    """Add the command."""
    said = "Run a scene at many points of its parameters."
    parser = commands.add_parser(
        "sweep", help="run a scene over a grid of parameter values", description=said, epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    add_scene(parser)
    parser.add_argument(
        "--vary", metavar="KEY=VALUES", action="append", required=True,
        help="START:STOP:COUNT, START:STOP:COUNT:log or A,B,C; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--metric", metavar="M,...", default="rfd,lag", help="metrics of table and plot; default: rfd,lag"
    )
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="the folder")
    add_pool(parser)
    parser.add_argument("--quiet", action="store_true", help="print errors only, without progress")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run what is not done yet, and write the table and the pictures."""
    names = list(dict.fromkeys(find_figure(word.strip()) for word in arguments.metric.split(",")))
    axes = [read_axis(name_methods(said)) for said in arguments.vary]
    with Counted(sys.stderr, "sweep", "points read") as bar:
        told = None if arguments.quiet else bar
        points = make_points(find(arguments.scene), _read_settings(arguments, axes), axes, told)
        if not any(point.scene and point.scene.recorder for point in points):
            raise OutputError("A sweep needs a recorder, and the scene has recorder = 'absent'.")
        errors = any(name in ERRORS for name in names)
        bundles = make_bundles(points, errors=errors)
    with open_sweep(arguments.out, points, axes, __version__) as folder:
        with Stop() as stop:
            every = (*bundles.batches, *bundles.alone)
            keys = [one.key for one in axes]
            records = finish_points(arguments, "sweep", folder, every, keys, stop, errors=errors)
            if stop() and len(records) < len(points):
                if not arguments.quiet:
                    said = f"{len(records)} of {len(points)} points are done and kept in {folder.path}"
                    print(f"Stopped: {said}. The same command goes on from there.")
                return STOPPED
        columns = make_columns(points, axes)
        values = itertools.product(*(one.values for one in columns))
        found = [record for _, record in sorted(records.items())]
        table = format_table([(one.key, one.unit) for one in columns], values, found, names)
        write_whole(arguments.out / "sweep.csv", table.encode("utf-8"))
        notes = _draw_pictures(arguments.out, columns, axes, records, names)
        failed = [record["error"] for record in found if "error" in record]
        if len(failed) == len(points):
            raise DigiclayError(f"Every point failed; the first one: {failed[0]}")
        if not arguments.quiet:
            tail = f", {len(failed)} of them failed: see the column error" if failed else ""
            lines = [*bundles.describe(), *explain_failed_batches(records), *notes]
            print(f"{len(points)} points{tail}", *lines, f"written to {arguments.out}", sep="\n")
        return 0


def _read_settings(arguments: argparse.Namespace, axes: Sequence[Axis]) -> list[Setting]:
    """Return what the options change of the scene; what varies is given by --vary alone."""
    settings = settings_of(arguments)
    varied = [one.key for one in axes]
    for key, _, option in settings[len(arguments.settings) :]:
        if key in varied:
            raise ParameterError(f"--vary {key}", "", f"must not be given to {option} as well", key)
    return settings


def _draw_pictures(
    out: Path,
    columns: Sequence[Column],
    axes: Sequence[Axis],
    records: dict[int, Record],
    names: Sequence[str],
) -> list[str]:
    """Draw the figures over one or two axes; return the messages."""
    if len(axes) > 2:
        return [f"{len(axes)} axes: a table only, no pictures"]
    from ..plots.sweep import picture

    try:
        for name in names:
            picture(columns, name, make_grid(records, axes, name), out / f"{name}.png")
    except OutputError as error:  # the table is there, and pictures can be had later
        return [str(error)]
    return []
