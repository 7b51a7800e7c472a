"""A progress bar on a terminal for things that are counted: frames, jobs."""

from __future__ import annotations

import time
from typing import TextIO

from .progress import PAUSE, WIDTH

__all__ = ["Counted", "duration"]


class Counted:
    """Shows how many of something are done and how long the others will take.

    Parameters
    ----------
    stream : TextIO
        Written to only if it is a terminal.
    label, unit : str
        What is going on, and what is counted.
    before : int, optional
        How many were done beforehand: they say nothing about the time the others take.
    """

    def __init__(self, stream: TextIO, label: str, unit: str, before: int = 0) -> None:
        self._stream, self._label, self._unit, self._before = stream, label, unit, before
        self._started, self._drawn, self._shown = time.monotonic(), 0.0, False

    def __enter__(self) -> Counted:
        return self

    def __call__(self, done: float, total: int, note: str = "") -> None:
        """Draw the bar, if it is time to; `done` may be in the middle of one."""
        now = time.monotonic()
        if now - self._drawn < PAUSE or not self._stream.isatty():
            return
        filled = int(WIDTH * done / total)
        here = done - self._before
        left = f", {duration((now - self._started) * (total - done) / here)} left" if here > 0 else ""
        bar = "#" * filled + "." * (WIDTH - filled)
        said = f"\r{self._label} [{bar}] {int(done)} of {total} {self._unit}{left}{note}\033[K"
        self._stream.write(said)
        self._stream.flush()
        self._drawn, self._shown = now, True

    def __exit__(self, *raised: object) -> None:
        if self._shown:
            self._stream.write("\r\033[K")
            self._stream.flush()


def duration(seconds: float) -> str:
    """Write a time left or taken: 8 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
