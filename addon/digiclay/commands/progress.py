"""A progress bar on a terminal; nothing elsewhere."""

from __future__ import annotations

import time
from typing import TextIO

__all__ = ["Bar"]

#: Cells of the bar, and seconds between two drawings of it.
WIDTH, PAUSE = 28, 0.1


class Bar:
    """Shows how much of a session is done; to be told after each control period.

    Parameters
    ----------
    stream : TextIO
        Written to only if it is a terminal.
    label : str
    period : float
        Simulated time a control period stands for, s.
    """

    def __init__(self, stream: TextIO, label: str, period: float) -> None:
        self._stream, self._label, self._period = stream, label, period
        self._started = self._drawn = time.monotonic()
        self._shown = False

    def __enter__(self) -> Bar:
        return self

    def __call__(self, done: int, total: int) -> None:
        """Draw the bar, if it is time to."""
        now = time.monotonic()
        if now - self._drawn < PAUSE or not self._stream.isatty():
            return
        filled = WIDTH * done // total
        left = (now - self._started) * (total - done) / done
        bar = "#" * filled + "." * (WIDTH - filled)
        times = f"{done * self._period:.1f} of {total * self._period:.1f} s simulated, {left:.0f} s left"
        self._stream.write(f"\r{self._label} [{bar}] {100 * done // total:3d} %  {times}\033[K")
        self._stream.flush()
        self._drawn, self._shown = now, True

    def __exit__(self, *raised: object) -> None:
        if self._shown:
            self._stream.write("\r\033[K")
            self._stream.flush()
