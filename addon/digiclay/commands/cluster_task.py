"""Evaluation of bundles on a worker of a Dask cluster, which must run the digiclay of the session that asks.

The worker gets all it needs by value and returns the records: it needs no disk of that session's machine.
"""

from __future__ import annotations

import pickle
import platform
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..core.studies.axes import Point
from ..core.studies.evaluation import Record, evaluate_bundle


class Versions(NamedTuple):
    """Versions that results depend on."""

    digiclay: str
    numpy: str
    python: str

    def __str__(self) -> str:
        return f"digiclay {self.digiclay}, numpy {self.numpy}, Python {self.python}"


class UnfitWorkerError(Exception):
    """Worker whose versions differ; its text is the worker's address and its versions."""


def describe_versions() -> Versions:
    """Return the versions of this process."""
    return Versions(__version__, np.__version__, ".".join(platform.python_version_tuple()[:2]))


def call_on_worker(packed: bytes, wanted: Versions) -> Any:
    """Call a pickled function in a task of a Dask worker; UnfitWorkerError where the versions differ."""
    here = describe_versions()
    if here != Versions(*wanted):
        from distributed import get_worker

        raise UnfitWorkerError(f"Worker {get_worker().address} has {here}")
    task, arguments, known = pickle.loads(packed)
    return task(*arguments, **known)


def evaluate_on_worker(bundle: Sequence[Point], *, errors: bool) -> list[Record | None]:
    """Evaluate a bundle in a task of a Dask worker, until nobody wants its records any more.

    `errors`: whether their errors are estimated. Raises Reschedule when the task was taken from the worker
    while it ran.
    """
    from distributed import Reschedule

    records = evaluate_bundle(bundle, _watch_task(), errors=errors)
    if any(record is None for record in records):
        raise Reschedule
    return records


def _watch_task() -> Callable[[], bool]:
    """Return whether nobody wants the task of this thread any more, as a function.

    Dask does not interrupt a task. Its worker marks it as soon as the session releases it, has died, or
    the scheduler is gone: no event is shared, and a look costs no message.
    """
    from distributed import Status, get_worker

    worker = get_worker()
    key, tasks = worker.get_current_task(), worker.state.tasks
    ending = {Status.closing, Status.closed, Status.failed}

    def is_cancelled() -> bool:
        task = tasks.get(key)
        return task is None or task.state == "cancelled" or worker.status in ending

    return is_cancelled
