"""Overlay as plain marks in pixels: boxes, lines, dots and text; no Blender."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..core.base.arrays import Floats
from .look import Color


@dataclass(frozen=True)
class Box:
    """Filled rectangle: left, bottom, width, height; pixels."""

    x: float
    y: float
    width: float
    height: float
    color: Color
    alpha: float = 1.0


@dataclass(frozen=True, eq=False)
class Line:
    """Line through points (k, 2), pixels; solid or dashed."""

    points: Floats
    color: Color
    width: float
    dashed: bool = False


@dataclass(frozen=True)
class Dot:
    """Filled circle about a point."""

    x: float
    y: float
    radius: float
    color: Color


@dataclass(frozen=True)
class Words:
    """Line of text on a base line, from its left end or to its right end."""

    x: float
    y: float
    size: float
    color: Color
    text: str
    to_the_right_end: bool = False


@dataclass
class Picture:
    """All marks in drawing order: boxes, lines, dots, text."""

    boxes: list[Box] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    dots: list[Dot] = field(default_factory=list)
    words: list[Words] = field(default_factory=list)


def round_axis(low: float, high: float) -> tuple[float, float]:
    """Return round ends of an axis that holds two values, the first below the second.

    Steps are 1, 2 or 5 times a power of ten, and at most ten of them make the axis, so that
    the ends do not jump about with every value.
    """
    span = high - low
    step = 10.0 ** np.floor(np.log10(span))
    step *= next(factor for factor in (0.1, 0.2, 0.5, 1.0) if span <= 10.0 * factor * step)
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


def scale_curve(
    time: Floats, value: Floats, window: tuple[float, float], ends: tuple[float, float], box: Box
) -> Floats:
    """Return the points (k, 2) of a curve inside a box, what lies outside the window left away.

    `time`, `value` (t,), the curve; times increase, s; `window`: first and last time shown, s; `ends`: ends
    of the axis, in the unit of the values; values beyond are drawn at the end; `box`: where the curve goes.
    """
    shown = (time >= window[0]) & (time <= window[1]) & np.isfinite(value)
    x = (time[shown] - window[0]) / (window[1] - window[0])
    y = np.clip((value[shown] - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    return np.column_stack([box.x + x * box.width, box.y + y * box.height])
