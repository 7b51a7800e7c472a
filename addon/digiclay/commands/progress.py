"""Output on a terminal: tables, commands, and a progress line, redrawn in place and removed at the end."""

import os
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Self, TextIO


def table(head: Sequence[str], rows: Sequence[Sequence[str]], *, left: int = 1) -> Iterator[str]:
    """Give the lines of an aligned table; the first `left` columns are texts, all others numbers."""
    widths = [max(len(line[i]) for line in (head, *rows)) for i in range(len(head))]
    for line in (head, ["-" * width for width in widths], *rows):
        cells = (
            c.ljust(w) if i < left else c.rjust(w)
            for i, (c, w) in enumerate(zip(line, widths, strict=True))
        )
        yield ("  " + "  ".join(cells)).rstrip()


#: Cells of a bar, and seconds between two drawings of it.
WIDTH, PAUSE = 28, 0.1


class Line:
    """Line of a terminal, removed at the end of its block; none if `quiet` or on another stream."""

    def __init__(self, stream: TextIO, *, quiet: bool = False) -> None:
        self._stream, self._quiet, self._shown = stream, quiet, False
        self._started = self._drawn = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def is_due(self) -> bool:
        """Return whether to redraw; the rate is limited, since drawing takes time."""
        return time.monotonic() - self._drawn >= PAUSE

    def draw(self, text: str) -> None:
        """Draw a text in place of what stood there, as much of it as the terminal is wide."""
        self._drawn = time.monotonic()
        if self._quiet or not self._stream.isatty():
            return
        # A longer one is wrapped, and would stay there.
        width = shutil.get_terminal_size().columns - 1
        self._stream.write(f"\r{text[:width]}\033[K")
        self._stream.flush()
        self._shown = True

    def tell(self, text: str) -> None:
        """Write a line that stays, above the one that is redrawn."""
        self._stream.write(f"\r\033[K{text}\n" if self._shown else f"{text}\n")
        self._stream.flush()
        self._shown = False

    def format_left(self, share: float) -> str:
        """Write how long the rest takes when a share from 0 to 1 was done in the time since the beginning."""
        if share <= 0.0:
            return ""
        return (
            f", {format_duration((time.monotonic() - self._started) * (1.0 - share) / share)} left"
        )

    def __exit__(self, *raised: object) -> None:
        if self._shown:
            self._stream.write("\r\033[K")
            self._stream.flush()


class Bar(Line):
    """Progress of a session, updated after each control period, of `period` s."""

    def __init__(self, stream: TextIO, label: str, period: float, *, quiet: bool = False) -> None:
        super().__init__(stream, quiet=quiet)
        self._label, self._period = label, period

    def __call__(self, done: int, total: int) -> None:
        """Draw the bar, if it is time to."""
        if self.is_due():
            times = f"{done * self._period:.1f} of {total * self._period:.1f} s simulated"
            state = f"{100 * done // total:3d} %{self.format_left(done / total)}  {times}"
            self.draw(f"{self._label} {draw_share(done / total)} {state}")


class Counted(Line):
    """Progress of a count of `unit`, such as frames, with the remaining time.

    `before` were done beforehand: they say nothing about the time the others take.
    """

    def __init__(
        self, stream: TextIO, label: str, unit: str, before: int = 0, *, quiet: bool = False
    ) -> None:
        super().__init__(stream, quiet=quiet)
        self._label, self._unit, self._before = label, unit, before

    def __call__(self, done: float, total: int, note: str = "") -> None:
        """Draw the bar, if it is time to; `done` may be in the middle of one."""
        if self.is_due():
            here = (done - self._before) / max(total - self._before, 1)
            state = f"{int(done)} of {total} {self._unit}{self.format_left(here)}{note}"
            self.draw(f"{self._label} {draw_share(done / total)} {state}")


def draw_share(share: float) -> str:
    """Draw a share from 0 to 1."""
    filled = int(WIDTH * share)
    return f"[{'#' * filled}{'.' * (WIDTH - filled)}]"


def format_duration(seconds: float) -> str:
    """Write a time left or taken: 8 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def format_command(arguments: Sequence[str]) -> str:
    """Return a command of this program as it is typed into a terminal."""
    words = ["digiclay", *arguments]
    if os.name != "nt":
        import shlex

        return shlex.join(words)
    from subprocess import list2cmdline

    return list2cmdline(words)


def tell_stopped_before(what: str, later: Sequence[str]) -> None:
    """Print the output that a stop prevented, and the command that makes it."""
    print(f"Stopped before {what}; to have it: {format_command(later)}", file=sys.stderr)
