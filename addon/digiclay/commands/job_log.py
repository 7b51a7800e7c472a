"""Log of a job: lines that are meant for its series, among whatever else its process prints."""

from __future__ import annotations

from pathlib import Path

from ..core.base.errors import one_line

#: What the lines begin with that are meant for the series.
PROGRESS, ERROR = "@ ", "! "
#: Bytes at a log's end that are looked at for its last line.
TAIL = 4096


def read_tail(log: Path) -> list[str]:
    """Return the last lines of a log; none where it cannot be read."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, log.stat().st_size - TAIL))
            return file.read().decode("utf-8", errors="replace").splitlines()
    except OSError:
        return []


def find_error(lines: list[str]) -> str:
    """Return the error that ended a job, in one line; empty where the lines have none."""
    told = [line.removeprefix(ERROR) for line in lines if line.startswith(ERROR)]
    return one_line(told[-1]) if told else ""


def read_fraction(lines: list[str]) -> float:
    """Return how much of a job is done, from 0 to 1."""
    for line in reversed(lines):
        _, _, number = line.removeprefix(PROGRESS).partition(" ")
        if line.startswith(PROGRESS) and number:
            try:
                return min(1.0, max(0.0, float(number)))
            except ValueError:
                break  # a line that is being written
    return 0.0
