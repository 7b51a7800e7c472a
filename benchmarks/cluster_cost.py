"""``python -m benchmarks cluster``: overhead of a Dask cluster, one worker against two."""

from __future__ import annotations

import argparse
import pickle
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

from digiclay.commands.cluster import Cluster, open_cluster
from digiclay.commands.cluster_task import evaluate_on_worker
from digiclay.commands.executors import finish
from digiclay.commands.stop import refuse_without
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, make_points, read_axis
from digiclay.core.studies.evaluation import evaluate_bundle, make_bundles
from digiclay.core.studies.sweep_plan import hash_points

from .report import add_kind, kept, made_with, progress, table

#: Empty tasks, and bundles of 32 points, as many as are measured; each of these in full, and with --quick.
TASKS, BUNDLES = (2000, 200), (12, 2)
#: Points of a sweep that is only set up: those of two axes.
SETUP = (100, 100), (20, 20)


@dataclass(frozen=True)
class Cost:
    """Cost of some pieces of work on a number of workers.

    Attributes
    ----------
    pieces : int
        Tasks, or points.
    wall : float
        s a piece.
    central : float
        Processor time of scheduler and session, which share a process here, s a piece.
    spent : float
        Processor time of the workers, s a piece.
    """

    work: str
    workers: int
    pieces: int
    wall: float
    central: float
    spent: float


def add(kinds: Any) -> None:
    """Add the benchmark."""
    parser = add_kind(
        kinds, "cluster", "overhead of a Dask cluster, one worker and two", "  python -m benchmarks cluster\n"
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure, and print the table."""
    refuse_without("distributed", "python -m benchmarks cluster", "pip install digiclay[cluster]")
    tasks, count = (pair[arguments.quick] for pair in (TASKS, BUNDLES))
    settings = [Setting("simulation.duration", "1")]
    axes = [read_axis(f"control.force_gain=1:4:{32 * count}")]
    points = make_points(find("slow_press"), settings, axes)
    bundles = make_bundles(points).batches
    costs = []
    with progress(arguments, "cluster", 4) as bar:
        costs.append(_measure_setup(*SETUP[arguments.quick]))
        bar("set-up")
        costs.append(_measure_here(bundles))
        bar("here")
        for workers in (1, 2):
            costs += _measure_there(workers, tasks, bundles)
            bar(f"{workers} workers")
    text = "\n".join(_text(costs, bundles[0]))
    print(text)
    head = [field.name for field in fields(Cost)]
    kept(arguments.out, "cluster", text, head, [[getattr(one, name) for name in head] for one in costs])
    return 0


def _measure_setup(gains: int, bands: int) -> Cost:
    """Make the points of a sweep, their bundles and the number that identifies them."""
    axes = [read_axis(f"control.force_gain=1:8:{gains}"), read_axis(f"control.dead_band=1e-5:1e-4:{bands}")]
    started, spent = time.perf_counter(), time.process_time()
    points = make_points(find("slow_press"), [], axes)
    make_bundles(points)
    hash_points(points)
    wall, spent = time.perf_counter() - started, time.process_time() - spent
    return Cost("set-up", 0, len(points), wall / len(points), spent / len(points), 0.0)


def _measure_here(bundles: Sequence[Sequence[Point]]) -> Cost:
    """Evaluate bundles in this process."""
    evaluate_bundle(bundles[0])  # imports
    started, spent = time.perf_counter(), time.process_time()
    for bundle in bundles:
        evaluate_bundle(bundle)
    points = sum(map(len, bundles))
    wall, spent = time.perf_counter() - started, time.process_time() - spent
    return Cost("points here", 0, points, wall / points, 0.0, spent / points)


def _measure_there(workers: int, tasks: int, bundles: Sequence[Sequence[Point]]) -> list[Cost]:
    """Have empty tasks and bundles done by workers of one thread, each a process."""
    from distributed import LocalCluster

    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, protocol="tcp://", host="127.0.0.1",
            dashboard_address=":0",
        ) as local,
        open_cluster(local.scheduler_address, lambda: False, lambda note: None) as cluster,
    ):  # fmt: skip
        own = partial(_measure, cluster, local.scheduler_address, workers)
        evaluate = partial(evaluate_on_worker, errors=False)
        own("", abs, range(8 * workers), 1)
        own("", evaluate, [bundles[0][:4]] * workers, 1)  # imports
        return [
            own("empty tasks", abs, range(tasks), tasks),
            own("points", evaluate, bundles, sum(map(len, bundles))),
        ]


def _measure(
    cluster: Cluster, address: str, workers: int, work: str, task: Any, pieces: Sequence[Any], count: int
) -> Cost:
    """Return the cost of pieces of work."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        before = sum(client.run(time.process_time).values())
        started, spent = time.perf_counter(), time.process_time()
        finish(cluster, task, pieces, lambda *_: None, _fail, stopped=lambda: False)
        wall, spent = time.perf_counter() - started, time.process_time() - spent
        after = sum(client.run(time.process_time).values())
    return Cost(work, workers, count, wall / count, spent / count, (after - before) / count)


def _fail(piece: Any, why: str) -> None:
    raise RuntimeError(why)


def _text(costs: Sequence[Cost], bundle: Sequence[Point]) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with("distributed")
    yield "\nA point: 1 s of slow_press, in bundles of 32; ms a task or point."
    head = ("work", "workers", "pieces", "wall time", "scheduler and session", "workers' processor time")
    yield from table(
        head,
        [
            [one.work, str(one.workers), str(one.pieces)]
            + [f"{1e3 * value:.2f}" for value in (one.wall, one.central, one.spent)]
            for one in costs
        ],
        left=1,
    )
    one, two = (next(c for c in costs if (c.work, c.workers) == ("points", n)) for n in (1, 2))
    yield f"\nefficiency of two workers: {one.wall / (2 * two.wall):.0%} of twice the points a second"
    yield f"by processor time of the workers: {one.spent / two.spent:.0%}"
    size, back = len(pickle.dumps(tuple(bundle))), len(pickle.dumps(evaluate_bundle(bundle)))
    yield f"to a worker {size / len(bundle):.0f} bytes a point, back {back / len(bundle):.0f}"
