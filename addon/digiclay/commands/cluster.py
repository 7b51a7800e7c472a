"""Evaluation of bundles on a Dask cluster: connection, comparison of versions, executor.

Dask is imported only here and in tasks, and only when a scheduler is named.
"""

import asyncio
import importlib
import logging
import pickle
import platform
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import numpy as np

from ..core.base.addresses import describe_exposure
from ..core.base.errors import DigiclayError, one_line
from ..core.files.tables import Record, Table
from ..core.studies.axes import Point
from ..core.studies.evaluation import evaluate_bundle
from ..core.version import __version__
from .stop import allow_interrupt


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
    task, arguments, named = pickle.loads(packed)
    return task(*arguments, **named)


def evaluate_on_worker(bundle: Sequence[Point]) -> list[Record | None]:
    """Evaluate a bundle in a task of a Dask worker, until its records are not wanted any more."""
    from distributed import Reschedule

    records = evaluate_bundle(bundle, _watch_task())
    if any(record is None for record in records):
        raise Reschedule
    return records


def _watch_task() -> Callable[[], bool]:
    """Return a function that tells whether the task of this thread is cancelled.

    Dask does not interrupt a task. Its worker marks it as soon as the session releases it, has
    died, or the scheduler is gone: no event is shared, and a look costs no message.
    """
    from distributed import Status, get_worker

    worker = get_worker()
    key, tasks = worker.get_current_task(), worker.state.tasks
    ending = {Status.closing, Status.closed, Status.failed}

    def is_cancelled() -> bool:
        task = tasks.get(key)
        return task is None or task.state == "cancelled" or worker.status in ending

    return is_cancelled


#: Seconds to reach the scheduler, and between two checks for a requested stop.
PATIENCE, PAUSE = 10.0, 0.1
#: Seconds within which a result must arrive that a worker has.
FETCH = 30.0
#: Seconds between two counts of the workers, and without any before a message says so.
LOOK, ALONE = 1.0, 10.0
#: Packages whose loggers are silenced.
NOISY = ("distributed", "tornado", "asyncio")
#: Schemes of addresses that are encrypted or stay within a process; tcp:// is the default.
ENCRYPTED = ("tls", "wss", "inproc")


class Cluster(Executor):
    """Executor on the workers of a Dask scheduler; messages name its address."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address, self._versions = client, address, describe_versions()
        self._remote: set[Any] = set()  # Dask releases a task without a reference to its future
        self._suspects: deque[tuple[Future[Any], bytes]] = deque()
        self._workers, self._looked, self._manned = 0, 0.0, time.monotonic()

    def submit(self, task: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Have a worker call a function, and return its result by value."""
        future: Future[Any] = Future()
        self._send(future, pickle.dumps((task, arguments, named), pickle.HIGHEST_PROTOCOL))
        return future

    def _send(self, future: Future[Any], packed: bytes, *, alone: bool = False) -> None:
        """Send a task to the scheduler; `alone` after workers died that had it."""
        try:
            call = _pack_call(call_on_worker, packed, self._versions)
            remote = self._client.submit(pickle.loads, call, pure=False)
            self._remote.add(remote)
            remote.add_done_callback(partial(self._hand_back, future, packed, alone))
        except Exception:  # Dask's client is closed when it has given up
            future.set_exception(self._lost())

    def _hand_back(self, future: Future[Any], packed: bytes, alone: bool, remote: Any) -> None:
        """Hand the outcome of a task over, unless it is cancelled; Dask calls this from one thread.

        Dask blames the death of a worker on all tasks that it had, also on those that it had not
        begun. So each is tried once more, one after the other: a task that kills another worker is
        to blame.

        Rarely Dask tells of a result and never hands it over. This thread would wait for good, and
        with it all results after that one: the task is repeated then.
        """
        from distributed import KilledWorker

        self._remote.discard(remote)
        try:
            outcome, error = remote.result(timeout=FETCH), None
        except BaseException as raised:  # Dask's cancellation is no Exception
            outcome, error = None, raised
        if isinstance(error, TimeoutError) and remote.status != "error" and not future.cancelled():
            self._send(future, packed, alone=alone)
            return
        if alone:
            self._suspects.popleft()
        suspect = isinstance(error, KilledWorker) and not alone
        if suspect:
            self._suspects.append((future, packed))
        if self._suspects and (alone or (suspect and len(self._suspects) == 1)):
            self._send(*self._suspects[0], alone=True)
        if suspect or not future.set_running_or_notify_cancel():
            return
        if error is None:
            future.set_result(outcome)
        else:
            future.set_exception(self._explain(error))

    def _explain(self, error: BaseException) -> BaseException:
        """Return the error of a task as this program has it."""
        from distributed import CancelledError, KilledWorker

        if isinstance(error, KilledWorker):
            deaths, last = error.allowed_failures + 1, error.last_worker.address
            rule = f"{deaths} workers died of this, the last one {last}, perhaps for lack of memory"
            return DigiclayError(f"{rule}.")
        if isinstance(error, UnfitWorkerError):
            return BrokenExecutor(f"{error}; here it is {self._versions}.")
        if isinstance(error, ModuleNotFoundError):
            return BrokenExecutor(f"A worker of {self._address} lacks {error.name}.")
        return self._lost() if isinstance(error, (CancelledError, OSError)) else error

    def _lost(self) -> BrokenExecutor:
        """Return the error of a scheduler that is gone."""
        return BrokenExecutor(f"The scheduler {self._address} is gone.")

    def describe(self) -> str:
        """Return how many workers there are now, for the progress line."""
        now = time.monotonic()
        if now - self._looked >= LOOK and self._client.status == "running":
            self._looked = now
            with suppress(Exception):  # tasks tell when the scheduler is gone
                self._workers = self._client.scheduler_info(n_workers=0)["n_workers"]
        if self._workers:
            self._manned = now
            return f", {self._workers} workers" if self._workers > 1 else ", 1 worker"
        if now - self._manned >= ALONE:
            self._manned = now + 6 * ALONE
            _tell(f"{self._address} has no workers: waiting for some.")
        return ", no workers: waiting"

    def wait_for_workers(self, stop: Callable[[], bool], draw: Callable[[str], None]) -> None:
        """Wait for a first worker, visibly."""
        note = self.describe()
        if not self._workers:
            _tell(
                f"{self._address} has no workers yet: start some with 'dask worker {self._address}'."
            )
        while not self._workers and not stop():
            draw(note)
            time.sleep(PAUSE)
            note = self.describe()

    def refuse_other_versions(self) -> None:
        """Refuse a cluster of which a part runs another digiclay, numpy or Python."""
        call = _pack_call(describe_versions)
        try:
            scheduler: Any = self._client.run_on_scheduler(pickle.loads, call)
        except Exception as error:
            scheduler = error
        versions_of = {f"The scheduler {self._address}": scheduler}
        answers = self._client.run(pickle.loads, call, on_error="return")
        workers = {name: answer for name, answer in answers.items() if not _is_lost(answer)}
        versions_of |= {f"Worker {name}": versions for name, versions in workers.items()}
        _refuse_others(versions_of, self._versions)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Release what is left of the tasks: workers stop at the next control period."""
        with suppress(Exception):  # the scheduler may be gone
            if self._client.status == "running" and self._remote:
                self._client.cancel(list(self._remote), force=True)


def _is_lost(answer: Any) -> bool:
    """Return whether a worker died instead of answering; one that restarts is asked by its tasks."""
    return isinstance(answer, ConnectionError) or (
        isinstance(answer, OSError) and answer.errno is None
    )


def _refuse_others(versions_of: Table, here: Versions) -> None:
    """Refuse versions other than those here; a worker without digiclay has an error in their place."""
    others = {name: versions for name, versions in versions_of.items() if versions != here}
    if not others:
        return
    (name, versions), *rest = others.items()
    more = f" (and {len(rest)} more like it)" if rest else ""
    if isinstance(versions, ModuleNotFoundError):
        has = f"lacks {versions.name}"
    elif isinstance(versions, Versions):
        has = f"has {versions}"
    else:
        has = f"cannot run digiclay ({type(versions).__name__}: {versions})"
    raise DigiclayError(one_line(f"{name} {has}{more}; here it is {here}. Install the same there."))


def _describe_exposure(address: str) -> str:
    """Return a warning of an address that is neither encrypted nor of this machine alone."""
    scheme, _, host = address.rpartition("://")
    if scheme in ENCRYPTED:
        return ""
    exposure = describe_exposure(
        urlsplit(f"//{host}").hostname or "", "points, code and results are"
    )
    return exposure and f"{exposure} tls:// encrypts."


def _pack_call(function: Callable[..., Any], *arguments: Any) -> bytes:
    """Return bytes that `pickle.loads` turns into a call: a missing module then fails inside the call."""

    class Call:
        def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
            return function, arguments

    return pickle.dumps(Call(), pickle.HIGHEST_PROTOCOL)


def _tell(line: str) -> None:
    """Print a line that a person should see even without a progress line."""
    start = "\r\033[K" if sys.stderr.isatty() else ""
    print(f"{start}{line}", file=sys.stderr, flush=True)


@contextmanager
def open_cluster(
    address: str, stop: Callable[[], bool], draw: Callable[[str], None]
) -> Iterator[Cluster]:
    """Connect with a Dask scheduler, wait for workers, and compare versions.

    At the end of the block, whatever ends it, the cluster has no task of this process any more.
    """
    importlib.import_module("distributed")
    if stop():
        raise KeyboardInterrupt
    _silence_log()
    client = _connect(address)
    try:
        with Cluster(client, address) as cluster:
            cluster.wait_for_workers(stop, draw)
            if not stop():
                cluster.refuse_other_versions()
                if exposure := _describe_exposure(address):
                    _tell(exposure)
            yield cluster
    finally:
        with suppress(Exception):
            client.close(timeout=PATIENCE if client.status == "running" else PAUSE)


def _connect(address: str) -> Any:
    """Return a client of a scheduler."""
    from distributed import Client

    try:
        with allow_interrupt():
            asyncio.run(_try_address(address))
            return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError):
        rule = f"No Dask scheduler answers at {address} within {PATIENCE:g} s"
    except Exception as error:
        why = one_line(error).rstrip(".")
        rule = (
            f"--scheduler must be an address such as tcp://127.0.0.1:8786 (got {address!r}: {why})"
        )
    raise DigiclayError(f"{rule}.")


async def _try_address(address: str) -> None:
    """Connect and disconnect: a client of Dask that has failed to connect hangs at the end of the program."""
    from distributed import Security
    from distributed.comm import connect

    # Another program than a scheduler may accept the connection, and keep silent.
    security = Security().get_connection_args("client")
    comm = await asyncio.wait_for(connect(address, PATIENCE, **security), PATIENCE)
    await comm.close()


def _silence_log() -> None:
    """Keep Dask's log and warnings off the terminal: what matters is printed in lines of this program.

    For good: its threads still write when a client has been closed whose scheduler is gone.
    """
    for name, logger in logging.root.manager.loggerDict.items():
        if name.partition(".")[0] in NOISY and isinstance(logger, logging.Logger):
            logger.disabled = True
    # It draws a table of all libraries that differ; those that results depend on are compared here.
    warnings.filterwarnings("ignore", "Mismatched versions found")
