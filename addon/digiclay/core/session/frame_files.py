"""Files of a film's frames: their names, those that are missing, and ranges of frames."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from ..base.errors import OutputError
from ..base.png import is_whole_picture


def name_frame(folder: Path, frame: int) -> Path:
    """Return the file of a frame. `frame`: its number, from 0."""
    return folder / f"{frame:06d}.png"


def list_missing(folder: Path, frames: Sequence[int]) -> list[int]:
    """Return the frames of which a folder has no whole picture.

    `folder`: it may be missing itself; `frames`: their numbers, from 0.
    """
    return [frame for frame in frames if not _is_there(name_frame(folder, frame))]


def _is_there(path: Path) -> bool:
    """Return whether a picture is there to its end; copies break off half way."""
    try:
        with path.open("rb") as file:
            file.seek(-8, os.SEEK_END)
            return is_whole_picture(file.read())
    except OSError:
        return False


def read_range(text: str, count: int) -> range:
    """Return the frames that a text names: ``0-24``, ``7``, or ``50+25``, 25 frames from number 50 on.

    `text`: numbers from 0. The form with ``+`` ends with the film at the latest; `count`: number of frames of
    the film. Raises OutputError when it is no range, is empty, or goes beyond the film.
    """
    read = re.fullmatch(r"(\d{1,9})(?:([-+])(\d{1,9}))?", text.strip(), re.ASCII)
    if not read:
        raise OutputError(f"--frames must be a range such as 0-24, or 50+25 (got {text!r}).")
    first, sign, other = int(read[1]), read[2], int(read[3] or 0)
    end = {None: first + 1, "-": other + 1, "+": min(first + other, count)}[sign]
    if not first < end <= count:
        raise OutputError(f"--frames must be within 0-{count - 1}, first frame first (got {text}).")
    return range(first, end)


def format_range(frames: range) -> str:
    """Return a text that `read_range` reads as these frames."""
    return f"{frames[0]}-{frames[-1]}"
