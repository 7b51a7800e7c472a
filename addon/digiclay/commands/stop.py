"""Ends of a command: stopped, with what is computed kept; exit codes."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

#: Some jobs of a batch failed; what the user asked for cannot be done; stopped by Ctrl-C or
#: SIGTERM.
FAILED, WRONG, STOPPED = 1, 2, 130


#: What asks to stop; Windows has no SIGHUP.
ASKING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


class Stop:
    """Block in which a first signal is noted and a second one interrupts; the first if `requested`."""

    def __init__(self, *, requested: bool = False) -> None:
        self.requested = requested
        self._former: dict[int, Any] = {}

    def __call__(self) -> bool:
        """Return whether a stop was requested."""
        return self.requested

    def __enter__(self) -> Stop:
        # Python takes signals in its main thread only; elsewhere there are none.
        with suppress(ValueError):
            for number in ASKING:
                # A closed terminal does not end what nohup has begun.
                if number in ASKING[:2] or signal.getsignal(number) != signal.SIG_IGN:
                    self._former[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    def __exit__(self, *raised: object) -> None:
        for number, handler in self._former.items():
            # Python does not know a handler that Blender itself has set, and cannot set it again.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def allow_interrupt() -> Stop:
    """Let a first signal interrupt at once, SIGTERM as Ctrl-C does: where there is nothing to be kept."""
    return Stop(requested=True)


@contextmanager
def defer_interrupt() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: libraries take an interrupted import for a broken one."""
    with Stop() as stop:
        yield
    if stop():
        raise KeyboardInterrupt
