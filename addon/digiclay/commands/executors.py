"""Pieces of a series on an executor: several processes of this machine, or a cluster.

Not part of the extension's zip, as all that has threads.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor, Executor, Future
from queue import Empty, SimpleQueue
from typing import TypeVar

from ..core.base.errors import OutputError, one_line
from ..core.studies.series import describe_error

#: Seconds between two looks at whether somebody asked to stop.
PAUSE = 0.1

Piece = TypeVar("Piece")
Outcome = TypeVar("Outcome")


def finish(
    executor: Executor,
    task: Callable[[Piece], Outcome],
    pieces: Iterable[Piece],
    keep: Callable[[Piece, Outcome], None],
    fail: Callable[[Piece, str], None],
    *,
    stopped: Callable[[], bool],
) -> None:
    """Have an executor do what is left of a series, by value; OutputError when it breaks down itself."""
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
            try:
                outcome = future.result()
            except BrokenExecutor:
                raise
            except Exception as error:  # the other pieces are worth having
                fail(piece, describe_error(error))
            else:
                keep(piece, outcome)
    except BrokenExecutor as error:
        rule = "What is done is kept, and the same command goes on from there."
        raise OutputError(f"{one_line(error)} {rule}") from None
    finally:
        for future in waiting:
            future.cancel()
