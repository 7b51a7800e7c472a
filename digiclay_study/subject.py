"""Subject of a study or a tuning: the scene, varied parameters, metrics; and its options."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import add_scene, name_methods, settings_of
from digiclay.commands.evaluation_pool import add_pool
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.studies.axes import MOST, Point, place_points
from digiclay.core.studies.evaluation import ERRORS, find_figure
from numpy.typing import NDArray

from .ranges import Range, fit_ranges, read_range


@dataclass(frozen=True)
class Subject:
    """Scene, varied parameters and metrics.

    Attributes
    ----------
    path : Path
        The scene's file.
    settings : tuple of Setting
        What the options change of it at every point.
    scene : Scene
        With them.
    ranges : tuple of Range
    names : tuple of str
        Outputs: keys of `evaluation.FIGURES`.
    """

    path: Path
    settings: tuple[Setting, ...]
    scene: Scene
    ranges: tuple[Range, ...]
    names: tuple[str, ...]

    @property
    def errors(self) -> bool:
        """Whether errors of the integration are estimated."""
        return any(name in ERRORS for name in self.names)

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied parameters."""
        return tuple(one.key for one in self.ranges)


def add_subject(parser: argparse.ArgumentParser, metrics: str) -> None:
    """Add the options by which `read_subject` finds what is varied and measured, and where.

    `metrics`: default of --metric.
    """
    add_scene(parser)
    parser.add_argument(
        "--vary", metavar="KEY=RANGE", action="append", required=True,
        help="LOW:HIGH, LOW:HIGH:log or A,B,C; may be repeated",
    )  # fmt: skip
    parser.add_argument("--metric", metavar="M,...", default=metrics, help=f"default: {metrics}")
    parser.add_argument("--seed", metavar="N", type=read_count(1, 2**31), default=1, help="default: 1")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="the folder")
    add_pool(parser)
    parser.add_argument("--quiet", action="store_true", help="print errors only, without progress")


def read_count(least: int, most: int) -> Callable[[str], int]:
    """Return what reads a whole number within bounds."""

    def read(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"must be a whole number from {least} to {most} (got {text!r})")
        return int(text)

    return read


def read_subject(arguments: argparse.Namespace) -> Subject:
    """Return what the options vary and measure.

    Raises ParameterError, SceneError, OutputError: in one line.
    """
    names = tuple(dict.fromkeys(find_figure(word.strip()) for word in arguments.metric.split(",")))
    path, settings = find(arguments.scene), settings_of(arguments)
    ranges = fit_ranges([read_range(name_methods(said)) for said in arguments.vary], path, settings)
    scene = load(path, settings)
    if scene.recorder is None:
        raise OutputError("Metrics need a recorder, and the scene has recorder = 'absent'.")
    return Subject(path, tuple(settings), scene, tuple(ranges), names)


def refuse_too_many(option: str, points: int) -> None:
    """Refuse a plan of more points than a sweep may have. `option`: that is to blame."""
    if points > MOST:
        raise ParameterError(option, "", f"must come to {MOST} points at most", f"{points} points")


def make_points(subject: Subject, shares: NDArray[Any], first: int, progress: Any = None) -> list[Point]:
    """Return the points at shares of the ranges.

    `shares` (points, parameters); `first`: index of the first point; `progress` callable, optional, told how
    many points are made, and of how many.
    """
    rows = [
        tuple(one.find_word(share) for one, share in zip(subject.ranges, row, strict=True)) for row in shares
    ]
    return place_points(subject.path, subject.settings, subject.keys, rows, first=first, progress=progress)
