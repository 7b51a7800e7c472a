"""Series of points: options, evaluation in processes or on a Dask cluster, stop, and report."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from itertools import takewhile
from pathlib import Path

from ..core.files.tables import Record
from ..core.metrics.metric_table import ERRORS
from ..core.studies.axes import Point
from ..core.studies.evaluation import Pool, evaluate_bundle, has_errors, judge_all, make_bundles
from ..core.studies.series import finish
from ..core.studies.sweep_plan import Folder
from .arguments import QUIET, add_options, add_scene, say
from .progress import Counted
from .refusals import in_blender
from .series_options import MOST_PROCESSES, add_pool
from .stop import STOPPED, Stop
from .worker import count_cores


def add_series(
    parser: ArgumentParser,
    syntax: str,
    metrics: str,
    varied: str = "RANGE",
    *,
    required: bool = True,
) -> None:
    """Add SCENE and the options of what varies, by its `syntax`, what is measured, where, and how."""
    add_scene(parser)
    several = {"action": "append", "required": required, "help": f"{syntax}; may be repeated"}
    add_options(
        parser,
        {
            f"--vary KEY={varied}": several,
            "--metric M,...": (None, f"metrics of tables and plots; default: {metrics}", metrics),
            "--out DIR": {"type": Path, "required": True, "help": "the folder"},
        },
    )
    add_pool(parser)
    add_options(parser, {"--quiet": QUIET})


@contextmanager
def open_pool(
    arguments: Namespace,
    pieces: int,
    stop: Callable[[], bool],
    draw: Callable[[str], None],
) -> Iterator[Pool]:
    """Open what the options of `add_pool` name, for `pieces` bundles; all of it ends with the block."""

    def draw_and_ask(note: str = "") -> bool:
        draw(note)
        return stop()

    # Modules with threads are not part of the extension's zip, where there is one process.
    if arguments.scheduler is not None:
        from .cluster import evaluate_on_worker, open_cluster
        from .evaluator import submit

        with open_cluster(arguments.scheduler, stop, draw) as cluster:
            yield partial(
                submit,
                cluster,
                evaluate_on_worker,
                stopped=lambda: draw_and_ask(cluster.describe()),
            )
        return
    count = 1 if in_blender() else min(arguments.workers or count_cores(), MOST_PROCESSES, pieces)
    if count > 1:
        from .evaluator import open_evaluators

        with open_evaluators(count, stop, partial(draw, "")) as pool:
            yield pool
        return
    task = partial(evaluate_bundle, stopped=draw_and_ask)
    yield lambda bundles: (
        (bundle, partial(task, bundle))
        for bundle in takewhile(lambda _: not draw_and_ask(), bundles)
    )


class Evaluation(ExitStack):
    """Points of a series under evaluation, with a progress line; a folder gets each as soon as it is done.

    `records` has the finished points by index, below `total`; `failed` those that no worker
    survived, which the same command tries again. `pieces`: bundles at a time, at most, where they
    are not known at once.
    """

    def __init__(
        self,
        arguments: Namespace,
        label: str,
        folder: Folder | None,
        total: int,
        stop: Stop,
        *,
        pieces: int = 0,
    ) -> None:
        super().__init__()
        self.folder, self.total, self.stop = folder, total, stop
        self.records = folder.read_records() if folder else dict[int, Record]()
        #: Points of which errors are wanted and not estimated yet.
        self.unjudged: list[Point] = []
        self.failed: dict[int, Record] = {}
        bar = Counted(sys.stderr, label, "points", len(self.records), quiet=arguments.quiet)
        self._bar = self.enter_context(bar)
        self._open = partial(open_pool, arguments, stop=stop, draw=self._draw)
        self._pieces = pieces
        self._pool: Pool | None = None

    def _draw(self, note: str) -> None:
        self._bar(min(len(self.records) + len(self.failed), self.total), self.total, note)

    def collect(self) -> dict[int, Record]:
        """Return the records of all points of the series, those that failed included."""
        every = {**self.failed, **self.records}
        return {index: record for index, record in every.items() if index < self.total}

    def finish(self, bundles: Sequence[Sequence[Point]], keys: Sequence[str]) -> None:
        """Evaluate the bundles of which a point is missing, or its errors. `keys`: the varied parameters."""

        def lacks(point: Point) -> bool:
            record = self.records.get(point.index)
            return record is None or (point.errors and not has_errors(record))

        def keep(bundle: Sequence[Point], evaluated: Sequence[Record | None]) -> None:
            for point, record in zip(bundle, evaluated, strict=True):
                if record is not None and lacks(point):
                    # What is there remains: in another bundle the last bit of a figure may be
                    # another one.
                    if there := self.records.get(point.index):
                        figures = {
                            **dict.fromkeys(ERRORS),
                            **record.get("figures", {}),
                            **there["figures"],
                        }
                        absent = record.get("error") or record.get("errors_absent")
                        record = {
                            **there,
                            "figures": figures,
                            **({"errors_absent": absent} if absent else {}),
                        }
                    if self.folder:
                        self.folder.keep(point, keys, record)
                    self.records[point.index] = record

        def fail(bundle: Sequence[Point], why: str) -> None:
            self.failed.update((point.index, {"error": why}) for point in bundle)
            first = bundle[0].index
            which = f"point {first}" if len(bundle) == 1 else f"{len(bundle)} points from {first}"
            self._bar.tell(f"failed: {which}: {why}")

        # Of a bundle all points are run again: alone the last bit of a point would be another one.
        todo = [bundle for bundle in bundles if any(map(lacks, bundle))]
        if todo:
            if self._pool is None:
                self._pool = self.enter_context(self._open(max(len(todo), self._pieces)))
            finish(self._pool(todo), keep, fail)

    def judge(self, points: Sequence[Point], keys: Sequence[str]) -> None:
        """Estimate the errors at finished points that have none."""
        judged = judge_all(points)
        self.finish(make_bundles(judged).every, keys)
        self.unjudged = [point for point in judged if not has_errors(self.records[point.index])]


def run_series(
    arguments: Namespace,
    label: str,
    total: int,
    opened: AbstractContextManager[Folder],
    evaluate: Callable[[Evaluation], object],
    write: Callable[[dict[int, Record]], Sequence[str]],
    *,
    noun: str = "points",
    pieces: int = 0,
) -> int:
    """Evaluate what is missing of a series, write its files, and print; return the exit code."""
    with opened as folder:
        with (
            Stop() as stop,
            Evaluation(arguments, label, folder, total, stop, pieces=pieces) as evaluation,
        ):
            evaluate(evaluation)
            records = evaluation.collect()
        if stop() and (len(records) < total or evaluation.unjudged):
            done = f"{len(records)} of {total} {noun} are done and kept in {folder.path}"
            say(arguments, f"Stopped: {done}. The same command continues.")
            return STOPPED
        say(arguments, *write(records))
    return 0
