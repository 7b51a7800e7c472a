"""Processes that evaluate bundles of a sweep in turn: their start and their loop.

Bundles come in by standard input, records go out by standard output, as pickles.
"""

import os
import pickle
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from ..core.base.errors import DigiclayError, OutputError, one_line
from ..core.files.tables import Record
from ..core.studies.axes import Point
from ..core.studies.evaluation import Pool, evaluate_bundle
from ..core.studies.series import Outcome, Piece, Results
from .worker import Process, Processes

#: Seconds between two checks for a requested stop.
PAUSE = 0.1


def submit(
    executor: Executor,
    task: Callable[[Piece], Outcome],
    pieces: Iterable[Piece],
    *,
    stopped: Callable[[], bool],
) -> Results[Piece, Outcome]:
    """Have an executor do pieces of a series, by value; OutputError when it breaks down itself."""
    arrived: SimpleQueue[Future[Outcome]] = SimpleQueue()
    waiting: dict[Future[Outcome], Piece] = {}
    looked = -PAUSE
    try:
        for piece in pieces:
            if time.monotonic() - looked >= PAUSE:  # thousands of pieces take seconds to hand over
                if stopped():
                    break
                looked = time.monotonic()
            future = executor.submit(task, piece)
            waiting[future] = piece
            future.add_done_callback(arrived.put)
        while waiting:
            if stopped():
                for future in waiting:
                    future.cancel()
            try:
                future = arrived.get(timeout=PAUSE)
            except Empty:
                continue
            piece = waiting.pop(future)
            if future.cancelled():
                continue
            if isinstance(broken := future.exception(), BrokenExecutor):
                raise broken
            yield piece, future.result
    except BrokenExecutor as error:
        rule = "Finished work is kept, and the same command continues."
        raise OutputError(f"{one_line(error)} {rule}") from None
    finally:
        for future in waiting:
            future.cancel()


#: How often a bundle is begun whose process dies.
TRIES = 2


class Evaluator(Process):
    """Process that evaluates bundles of points in turn."""

    def __init__(self) -> None:
        super().__init__([], ".commands.evaluator", stdout=subprocess.PIPE)

    def evaluate(self, bundle: Sequence[Point]) -> list[Record | None]:
        """Return the records of a bundle; EOFError when the process has died."""
        try:
            pickle.dump(tuple(bundle), self.input)
            self.input.flush()
            records: list[Record | None] = pickle.load(self.process.stdout)  # type: ignore[arg-type]
        except (
            OSError,
            ValueError,
            pickle.UnpicklingError,
        ):
            # It died, or was stopped, in the middle.
            raise EOFError from None
        return records


@contextmanager
def open_evaluators(
    count: int, stop: Callable[[], bool], draw: Callable[[], None]
) -> Iterator[Pool]:
    """Yield an evaluation of bundles in processes, each waited for by a thread."""
    with ThreadPoolExecutor(count) as threads, Processes[Evaluator](stop, draw) as processes:
        task = partial(evaluate_elsewhere, processes, list[Evaluator]())
        yield partial(submit, threads, task, stopped=processes.stopped)


def evaluate_elsewhere(
    processes: Processes[Evaluator], idle: list[Evaluator], bundle: Sequence[Point]
) -> list[Record | None]:
    """Evaluate a bundle in an idle process; in another one when that dies, DigiclayError when both do."""
    how = ""
    for _ in range(TRIES):
        try:
            evaluator = idle.pop()
        except IndexError:
            if (started := processes.start(Evaluator)) is None:
                break
            evaluator = started
        try:
            records = evaluator.evaluate(bundle)
        except EOFError:
            how = processes.wait(evaluator)
            if processes.stopping():
                break
        else:
            idle.append(evaluator)
            return records
    if processes.stopping():
        return [None] * len(bundle)
    rule = f"A worker died twice of this ({how}), perhaps for lack of memory"
    raise DigiclayError(f"{rule}. Run the same again with fewer --workers.")


def serve() -> None:
    """Evaluate what comes in, until standard input ends."""
    source, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no reply
    bundles: SimpleQueue[Any] = SimpleQueue()
    ended = threading.Event()

    def read() -> None:
        try:
            while True:
                bundles.put(pickle.load(source))
        except (EOFError, OSError, pickle.UnpicklingError):  # it may end in the middle
            pass
        finally:  # also when a bundle of another version of this program cannot be read
            ended.set()
            bundles.put(None)

    threading.Thread(target=read, daemon=True).start()
    while (bundle := bundles.get()) is not None:
        records = evaluate_bundle(bundle, ended.is_set)
        try:
            pickle.dump(records, replies)
            replies.flush()
        except OSError:  # the reader has ended
            os._exit(1)


if __name__ == "__main__":
    serve()
