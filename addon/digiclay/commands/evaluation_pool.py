"""Evaluation of bundles of points: in this process, in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from ..core.base.errors import DigiclayError
from ..core.studies.axes import Point
from ..core.studies.evaluation import Pool, Record, evaluate_bundle
from ..core.studies.series import finish_here
from ..core.studies.sweep_plan import Folder, find_unfinished, select_done
from .progress import Counted
from .stop import refuse_without
from .worker import count_cores, in_blender

#: The most processes of a command.
MOST = 61


def add_pool(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where bundles are evaluated."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers", metavar="N", type=read_count, help="number of processes; default: one a core"
    )
    where.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        type=_read_address,
        help="a Dask cluster instead, such as tcp://127.0.0.1:8786",
    )


def _read_address(text: str) -> str:
    """Return the address of a scheduler; refuse it without Dask, before any work."""
    if in_blender():
        raise DigiclayError("--scheduler is not for the extension: run 'digiclay' outside of Blender.")
    refuse_without("distributed", "--scheduler", "pip install digiclay[cluster]")
    return text


def read_count(text: str) -> int:
    """Read a number of processes."""
    if not text.isdecimal() or not 1 <= int(text) <= MOST:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to {MOST} (got {text!r})")
    return int(text)


@contextmanager
def open_pool(
    arguments: argparse.Namespace,
    pieces: int,
    stop: Callable[[], bool],
    draw: Callable[[str], None],
    *,
    errors: bool = False,
) -> Iterator[Pool]:
    """Open what the options of `add_pool` name, for `pieces` bundles; nothing of it runs on at the end."""
    # What has threads is not part of the extension's zip, where there is one process.
    if arguments.scheduler is not None:
        from .cluster import open_cluster
        from .cluster_task import evaluate_on_worker
        from .executors import finish

        with open_cluster(arguments.scheduler, stop, draw) as cluster:

            def stopped() -> bool:
                draw(cluster.describe())
                return stop()

            yield partial(finish, cluster, partial(evaluate_on_worker, errors=errors), stopped=stopped)
        return
    count = max(1, min(arguments.workers or count_cores(), MOST, pieces)) if not in_blender() else 1
    if count > 1:
        from .evaluator import open_evaluators

        with open_evaluators(count, stop, partial(draw, ""), errors=errors) as pool:
            yield pool
        return

    def draw_and_ask() -> bool:
        draw("")
        return stop()

    yield partial(
        finish_here, partial(evaluate_bundle, stopped=draw_and_ask, errors=errors), stopped=draw_and_ask
    )


def finish_points(
    arguments: argparse.Namespace,
    label: str,
    folder: Folder,
    bundles: Sequence[Sequence[Point]],
    keys: Sequence[str],
    stop: Callable[[], bool],
    *,
    errors: bool = False,
) -> dict[int, Record]:
    """Run the points that are not in a folder yet, with a progress line; return the records of all."""
    records = select_done(folder.read_records(), errors=errors)
    todo, total = find_unfinished(bundles, records), sum(len(bundle) for bundle in bundles)
    bar = Counted(sys.stderr, label, "points", len(records))

    def keep(bundle: Sequence[Point], found: Sequence[Record | None]) -> None:
        folder.keep_bundle(bundle, found, keys, records)

    def fail(bundle: Sequence[Point], why: str) -> None:
        # Told, but not kept: the same command tries them again.
        for point in bundle:
            records.setdefault(point.index, {"error": why})
        which = (
            f"point {bundle[0].index}" if len(bundle) == 1 else f"{len(bundle)} points from {bundle[0].index}"
        )
        bar.tell(f"failed: {which}: {why}")

    def draw(note: str) -> None:
        if not arguments.quiet:
            bar(len(records), total, note)

    if todo:
        with bar, open_pool(arguments, len(todo), stop, draw, errors=errors) as pool:
            pool(todo, keep, fail)
    return records
