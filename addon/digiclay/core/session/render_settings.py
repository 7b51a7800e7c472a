"""Render settings of a picture or film: appearance, rows shown, files of frames; no Blender."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import OutputError, ParameterError
from ..base.quantity import Parameters, quantity
from ..files.formats import is_whole_picture

#: Render engines, and quantities that color the pins.
ENGINES = ("cycles", "workbench")
COLORS = ("neutral", "mode", "force")
#: Most frames: more are a typing error, as an hour of film has 90 000.
MOST_FRAMES = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class Picture(Parameters):
    """Common settings of stills, turntables and films."""

    width: int = quantity(960, "width in pixels", at_least=16, at_most=16384)
    height: int = quantity(600, "height in pixels", at_least=16, at_most=16384)
    engine: str = quantity(
        "workbench", "renderer: quick and plain, or with soft shadows", choices=ENGINES
    )
    samples: int = quantity(6, "samples per pixel (cycles)", at_least=1, at_most=65536)
    color: str = quantity(
        "neutral",
        "whether pins are all alike, or show their control mode or the force",
        choices=COLORS,
    )
    arrows: bool = quantity(False, "whether arrows show the force on each pin")


@dataclass(frozen=True, eq=False, repr=False)
class Still(Picture):
    """One instant."""

    when: str = quantity("last touch", "the instant", choices=("last touch", "end"))


@dataclass(frozen=True, eq=False, repr=False)
class Moving(Picture):
    """Common settings of turntables and films."""

    rate: int = quantity(25, "frames per second", at_least=1, at_most=240)

    def check(self) -> None:
        """Refuse odd sizes: H.264 stores colors for blocks of 2 x 2 pixels."""
        for side in ("width", "height"):
            if getattr(self, side) % 2:
                rule = "must be an even number of pixels, as H.264 wants it"
                raise ParameterError(type(self).__name__, side, rule, str(getattr(self, side)))


@dataclass(frozen=True, eq=False, repr=False)
class Turntable(Moving):
    """One rotation of the bed at one instant."""

    when: str = quantity("end", "the instant", choices=("last touch", "end"))
    frames: int = quantity(75, "frames per rotation", at_least=2, at_most=MOST_FRAMES)
    fingertip: bool = quantity(False, "whether the fingertip is shown")

    def count(self, time: Sequence[float] | Floats) -> int:
        """Return the number of frames, for any times of a history."""
        return self.frames

    def angles(self) -> Floats:
        """Return the rotation of the bed in each frame, rad; the one after the last would be the first."""
        return np.arange(self.frames) * (2.0 * np.pi / self.frames)


@dataclass(frozen=True, eq=False, repr=False)
class Film(Moving):
    """Session, or a part of it, from its recorded states."""

    arrows: bool = quantity(True, "whether arrows show the force on each pin")
    strip: bool = quantity(
        True, "whether a strip in the picture shows the force of each fingertip over time"
    )
    speed: float = quantity(1.0, "simulated seconds per second of film", at_least=1e-3, at_most=1e3)
    start: float = quantity(
        0.0, "simulated time of the first frame", unit="s", at_least=0.0, at_most=1e6
    )
    stop: float = quantity(
        0.0,
        "simulated time of the last frame; 0: the session's end",
        unit="s",
        at_least=0.0,
        at_most=1e6,
    )

    def count(self, time: Sequence[float] | Floats) -> int:
        """Return the number of frames; the parameters are those of `moments`."""
        return len(self.moments(time))

    def moments(self, time: Sequence[float] | Floats) -> Floats:
        """Return the simulated time of each frame, s, for times (t,) of a history; or ParameterError."""
        first, last = float(time[0]), float(time[-1])
        stop = min(self.stop, last) if self.stop else last
        if not first <= self.start <= stop:
            rule = f"must be between {first:g} s and {stop:g} s, where the film stops"
            raise ParameterError("Film", "start", rule, f"{self.start:g} s")
        # A remainder of half a frame or more gets one more, so that the end is shown.
        count = int((stop - self.start) * self.rate / self.speed + 0.5) + 1
        if count > MOST_FRAMES:
            rule = f"must be so high that there are at most {MOST_FRAMES} frames"
            raise ParameterError("Film", "speed", rule, f"{self.speed:g}: {count} frames")
        return np.minimum(self.start + np.arange(count) * (self.speed / self.rate), stop)

    def rows(self, time: Sequence[float] | Floats) -> NDArray[np.intp]:
        """Return the recorded row nearest to each frame; the parameters are those of `moments`."""
        moments, times = self.moments(time), np.asarray(time, dtype=np.float64)
        after = np.searchsorted(times, moments).clip(0, len(times) - 1)
        before = (after - 1).clip(0)
        nearer = moments - times[before] < times[after] - moments
        return np.where(nearer, before, after)


def name_frame(folder: Path, frame: int) -> Path:
    """Return the file of a frame. `frame`: its number, from 0."""
    return folder / f"{frame:06d}.png"


def list_missing(folder: Path, frames: Sequence[int]) -> list[int]:
    """Return the frames, numbered from 0, of which a folder has no complete picture."""
    return [frame for frame in frames if not _is_complete(name_frame(folder, frame))]


def _is_complete(path: Path) -> bool:
    """Return whether a picture exists and has its end: copies may be incomplete."""
    try:
        with path.open("rb") as file:
            file.seek(-8, os.SEEK_END)
            return is_whole_picture(file.read())
    except OSError:
        return False


def read_range(text: str, count: int) -> range:
    """Return the frames, of `count`, that a text names: ``0-24``, ``7``, or ``50+25``, 25 from 50 on."""
    match = re.fullmatch(r"(\d{1,9})(?:([-+])(\d{1,9}))?", text.strip(), re.ASCII)
    if not match:
        raise OutputError(f"--frames must be a range such as 0-24, or 50+25 (got {text!r}).")
    first, sign, other = int(match[1]), match[2], int(match[3] or 0)
    end = {None: first + 1, "-": other + 1, "+": min(first + other, count)}[sign]
    if not first < end <= count:
        raise OutputError(f"--frames must be within 0-{count - 1}, first frame first (got {text}).")
    return range(first, end)


def format_range(frames: range) -> str:
    """Return a text that `read_range` reads as these frames."""
    return f"{frames[0]}-{frames[-1]}"
