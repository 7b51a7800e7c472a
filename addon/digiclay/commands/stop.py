"""Stop of a session by Ctrl-C, SIGTERM or a closed terminal, with the computed rows kept."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

#: What asks to stop; Windows has no SIGHUP.
ASKING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stop:
    """Block in which a first signal is noted and a second one interrupts."""

    def __init__(self) -> None:
        self.requested = False
        self._former: dict[int, Any] = {}

    def __call__(self) -> bool:
        """Return whether a stop was requested."""
        return self.requested

    def __enter__(self) -> Stop:
        self._former = _handle(self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def __exit__(self, *raised: object) -> None:
        _restore(self._former)


def _handle(handler: Callable[[int, FrameType | None], None]) -> dict[int, Any]:
    """Handle what asks to stop; return the former handlers, none where signals cannot be handled."""
    former: dict[int, Any] = {}
    # Python takes signals in its main thread only; elsewhere nobody can ask.
    with suppress(ValueError):
        for number in ASKING:
            # A closed terminal does not end what nohup has begun.
            if number in ASKING[:2] or signal.getsignal(number) != signal.SIG_IGN:
                former[number] = signal.signal(number, handler)
    return former


def _restore(former: dict[int, Any]) -> None:
    """Handle signals again as before."""
    for number, handler in former.items():
        # Python does not know a handler that Blender itself has set, and cannot set it again.
        signal.signal(number, signal.SIG_DFL if handler is None else handler)


@contextmanager
def allow_interrupt() -> Iterator[None]:
    """Let a first signal interrupt at once, SIGTERM as Ctrl-C does: where there is nothing to be kept."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    former = _handle(interrupt)
    try:
        yield
    finally:
        _restore(former)


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: libraries take an interrupted import for a broken one.

    Raises KeyboardInterrupt: at the end, when somebody has asked to stop.
    """
    with Stop() as stop:
        yield
    if stop():
        raise KeyboardInterrupt
