"""Benchmark ``cluster``: overhead of a Dask cluster, one worker against two."""

from __future__ import annotations

import argparse
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from digiclay.commands.cluster import Cluster, evaluate_on_worker, open_cluster
from digiclay.commands.evaluator import submit
from digiclay.commands.progress import table
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, make_points, read_axis
from digiclay.core.studies.evaluation import evaluate_bundle, make_bundles
from digiclay.core.studies.series import finish
from digiclay.core.studies.sweep_plan import hash_points

from .report import Report, Steps, cells, list_records

#: Empty tasks, and bundles of 32 points; each of these in full, and with --quick.
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


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure the set-up of a sweep, and points in this process, on one worker and on two."""
    tasks, count = (pair[arguments.quick] for pair in (TASKS, BUNDLES))
    axes = [read_axis(f"control.force_gain=1:4:{32 * count}")]
    points = make_points(find("slow_press"), [Setting("simulation.duration", "1")], axes)
    bundles = make_bundles(points).batches
    steps.total = 4
    costs = [_measure_setup(*SETUP[arguments.quick])]
    steps("set-up")
    costs.append(_measure_here(bundles))
    steps("here")
    for workers in (1, 2):
        costs += _measure_there(workers, tasks, bundles)
        steps(f"{workers} workers")
    return Report(_list_lines(costs, bundles[0]), *list_records(costs), packages=("distributed",))


def _time(work: Callable[[], Any]) -> tuple[float, float]:
    """Return elapsed and processor time of some work, s."""
    started, spent = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - started, time.process_time() - spent


def _measure_setup(gains: int, bands: int) -> Cost:
    """Make the points of a sweep, their bundles and the number that identifies them."""
    axes = [read_axis(f"control.force_gain=1:8:{gains}"), read_axis(f"control.dead_band=1e-5:1e-4:{bands}")]

    def set_up() -> None:
        points = make_points(find("slow_press"), [], axes)
        make_bundles(points)
        hash_points(points)

    count, (wall, spent) = gains * bands, _time(set_up)
    return Cost("set-up", 0, count, wall / count, spent / count, 0.0)


def _measure_here(bundles: Sequence[Sequence[Point]]) -> Cost:
    """Evaluate bundles in this process."""
    evaluate_bundle(bundles[0])  # imports
    wall, spent = _time(lambda: [evaluate_bundle(bundle) for bundle in bundles])
    points = sum(map(len, bundles))
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
        run = partial(_measure, cluster, local.scheduler_address, workers)
        evaluate = partial(evaluate_on_worker, errors=False)
        run("", abs, range(8 * workers), 1)
        run("", evaluate, [bundles[0][:4]] * workers, 1)  # imports
        return [
            run("empty tasks", abs, range(tasks), tasks),
            run("points", evaluate, bundles, sum(map(len, bundles))),
        ]


def _measure(
    cluster: Cluster, address: str, workers: int, work: str, task: Any, pieces: Sequence[Any], count: int
) -> Cost:
    """Return the cost of pieces of work."""
    from distributed import Client

    def fail(piece: Any, why: str) -> None:
        raise RuntimeError(why)

    with Client(address, set_as_default=False) as client:
        before = sum(client.run(time.process_time).values())
        wall, spent = _time(
            lambda: finish(submit(cluster, task, pieces, stopped=lambda: False), lambda *_: None, fail)
        )
        after = sum(client.run(time.process_time).values())
    return Cost(work, workers, count, wall / count, spent / count, (after - before) / count)


def _list_lines(costs: Sequence[Cost], bundle: Sequence[Point]) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nA point: 1 s of slow_press, in bundles of 32; ms a task or point."
    head = ("work", "workers", "pieces", "wall time", "scheduler and session", "workers' processor time")
    rows = [
        cells(
            "s d d .2f .2f .2f", one.work, one.workers, one.pieces, 1e3 * one.wall, 1e3 * one.central,
            1e3 * one.spent,
        )
        for one in costs
    ]  # fmt: skip
    yield from table(head, rows)
    one, two = (next(c for c in costs if (c.work, c.workers) == ("points", n)) for n in (1, 2))
    yield f"\nefficiency of two workers: {one.wall / (2 * two.wall):.0%} of twice the points a second"
    yield f"by processor time of the workers: {one.spent / two.spent:.0%}"
    size, back = len(pickle.dumps(tuple(bundle))), len(pickle.dumps(evaluate_bundle(bundle)))
    yield f"to a worker {size / len(bundle):.0f} bytes a point, back {back / len(bundle):.0f}"
