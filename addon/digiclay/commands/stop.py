"""Stop of a session by Ctrl-C or SIGTERM, with the computed rows kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

__all__ = ["Stop", "allow_interrupt", "defer_interrupt"]


class Stop:
    """Block in which a first signal is noted and a second one interrupts."""

    def __init__(self) -> None:
        self.requested = False
        self._former: dict[int, Any] = {}

    def __call__(self) -> bool:
        """Return whether a stop was requested."""
        return self.requested

    def __enter__(self) -> Stop:
        # Python takes signals in its main thread only; elsewhere nobody can ask.
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._former[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def __exit__(self, *raised: object) -> None:
        for number, former in self._former.items():
            # Python does not know a handler that Blender itself has set, and cannot set it again.
            signal.signal(number, signal.SIG_DFL if former is None else former)


@contextmanager
def allow_interrupt() -> Iterator[None]:
    """Let a first signal interrupt at once, SIGTERM as Ctrl-C does: where there is nothing to be kept."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    former = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: libraries take an interrupted import for a broken one.

    Raises
    ------
    KeyboardInterrupt
        At the end, when somebody has asked to stop.
    """
    with Stop() as stop:
        yield
    if stop():
        raise KeyboardInterrupt
