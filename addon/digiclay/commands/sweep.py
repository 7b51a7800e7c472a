"""``digiclay sweep``: a scene over a grid of parameter values, on all cores of this machine."""

import argparse
import itertools
import sys
from functools import partial
from pathlib import Path

from ..core.base.errors import OutputError
from ..core.files.run_folder import write_whole
from ..core.files.tables import Record
from ..core.metrics.metric_table import ERRORS
from ..core.scene.scene_source import find
from ..core.studies.axes import Axis, Column, find_ends, make_columns, make_points, read_axis
from ..core.studies.evaluation import (
    describe_effort,
    explain_failed_batches,
    judge_all,
    make_bundles,
    read_metrics,
    require_any,
    require_recorder,
)
from ..core.studies.sweep_plan import format_table, make_grid, open_sweep
from ..core.version import __version__
from .arguments import command, name_methods, settings_of
from .evaluation_pool import Evaluation, add_series, run_series
from .progress import Counted

EXAMPLES = """\
examples:
  digiclay sweep slow_press --vary control.force_gain=1:10:10 --metric rfd,lag --out gains
  digiclay sweep slow_press --vary control.force_gain=0.5:8:5:log --vary control.dead_band=1e-5,5e-5 --out two
  digiclay sweep my.toml --vary valve.stroke="20 um:40 um:5" --set layout.rows=15 --out strokes

The folder holds points/, a small file for each finished point; sweep.csv; and for one or two
axes a picture of each metric. After Ctrl-C the same command continues. It repeats a failed point
if its file is removed. Points of one bed, parts and steps run together in one call, a batch,
in a fraction of the time; the others are listed. Errors of the integration are estimated at
the ends of what varies; for the metrics height_error, force_error and total_force_error at every point.
"""


SYNTAX = "START:STOP:COUNT, START:STOP:COUNT:log or A,B,C"


@command(
    "run a scene over a grid of parameter values",
    EXAMPLES,
    partial(add_series, syntax=SYNTAX, metrics="rfd,lag", varied="VALUES"),
    description="Run a scene at many points of its parameters.",
)
def carry_out(arguments: argparse.Namespace) -> int:
    """Run what is not done yet, and write the table and the pictures."""
    names = read_metrics(arguments.metric)
    axes = [read_axis(name_methods(varied)) for varied in arguments.vary]
    with Counted(sys.stderr, "sweep", "points read", quiet=arguments.quiet) as bar:
        points = make_points(find(arguments.scene), settings_of(arguments), axes, bar)
        require_recorder(points)
        if any(name in ERRORS for name in names):
            points = judge_all(points)
        bundles = make_bundles(points)

    def write(records: dict[int, Record]) -> list[str]:
        columns = make_columns(points, axes)
        values = itertools.product(*(column.values for column in columns))
        rows = [records[point.index] for point in points]
        table = format_table([(column.key, column.unit) for column in columns], values, rows, names)
        write_whole(arguments.out / "sweep.csv", table.encode("utf-8"))
        pictures = _draw_pictures(arguments.out, columns, axes, records, names)
        failed = require_any(rows)
        tail = f", {len(failed)} of them failed: see the column error" if failed else ""
        notes = [*bundles.describe(), *explain_failed_batches(records), describe_effort(records)]
        return [f"{len(points)} points{tail}", *notes, *pictures, f"written to {arguments.out}"]

    keys = [axis.key for axis in axes]
    opened = open_sweep(arguments.out, points, axes, __version__)

    def evaluate(series: Evaluation) -> None:
        series.finish(bundles.every, keys)
        if len(series.records) == len(points):
            series.judge(find_ends(points, keys), keys)

    return run_series(arguments, "sweep", len(points), opened, evaluate, write)


def _draw_pictures(
    out: Path,
    columns: list[Column],
    axes: list[Axis],
    records: dict[int, Record],
    names: tuple[str, ...],
) -> list[str]:
    """Draw the figures over one or two axes; return the messages."""
    if len(axes) > 2:
        return [f"{len(axes)} axes: a table only, no pictures"]
    from ..plots.figure import save
    from ..plots.sweep import sweep_figure

    try:
        for name in names:
            save(sweep_figure(columns, name, make_grid(records, axes, name)), out / f"{name}.png")
    except OutputError as error:  # the table is written, and pictures can be drawn later
        return [str(error)]
    return []
