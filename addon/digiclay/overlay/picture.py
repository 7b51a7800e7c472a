"""Overlay as plain marks in pixels, boxes, lines, dots and text, and its colors; no Blender."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..core.base.arrays import Floats

#: sRGB.
Color = tuple[float, float, float]

#: Curves of picked pins: Okabe and Ito's palette, in the order in which they are told apart best.
CURVES: tuple[Color, ...] = (
    (0.34, 0.71, 0.91),
    (0.90, 0.62, 0.00),
    (0.00, 0.62, 0.45),
    (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.00),
    (0.95, 0.90, 0.25),
)
#: How often discs that overlap are moved apart at most: a hand takes some ten.
ROUNDS = 40
#: Contrast that the Web Content Accessibility Guidelines ask of letters, if possible, at least, and
#: of lines.
INK, LETTERS, LINES = 7.0, 4.5, 3.0
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Look:
    """Colors of the overlay: background, text, faint text, frames, force, set point, pins."""

    back: Color
    ink: Color
    faint: Color
    frame: Color
    force: Color
    set_point: Color
    pins: tuple[Color, ...]


def choose_colors(back: Color, ink: Color) -> Look:
    """Choose all colors to go with the theme's background and letters; unreadable letters are replaced."""
    ink = make_legible(ink, back, INK)
    return Look(
        back=back,
        ink=ink,
        faint=make_legible(_mix(ink, back, 0.35), back, LETTERS),
        frame=_mix(ink, back, 0.75),
        force=ink,
        set_point=make_legible(CURVES[4], back, LINES),
        pins=tuple(make_legible(color, back, LINES) for color in CURVES),
    )


def contrast(first: Color, other: Color) -> float:
    """Return the contrast of two colors, 1 to 21, by the Web Content Accessibility Guidelines."""
    low, high = sorted((_luminance(first), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def make_legible(color: Color, back: Color, least: float) -> Color:
    """Return a color mixed with as much black or white as a contrast of 1 to 21 with `back` requires."""
    end = WHITE if contrast(WHITE, back) >= contrast(BLACK, back) else BLACK
    for share in np.linspace(0.0, 1.0, 41):
        mixed = _mix(color, end, float(share))
        if contrast(mixed, back) >= least:
            return mixed
    return end


def _mix(first: Color, other: Color, share: float) -> Color:
    """Return a color with a share of another."""
    r, g, b = (a + (c - a) * share for a, c in zip(first, other, strict=True))
    return r, g, b


def _luminance(color: Color) -> float:
    """Return the relative luminance of an sRGB color."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


class Box(NamedTuple):
    """Filled rectangle: left, bottom, width, height; pixels."""

    x: float
    y: float
    width: float
    height: float
    color: Color
    alpha: float = 1.0


class Line(NamedTuple):
    """Line through points (k, 2), pixels; solid or dashed, or lines between pairs of points."""

    points: Floats
    color: Color
    width: float
    dashed: bool = False
    pairs: bool = False


class Dot(NamedTuple):
    """Filled circle about a point."""

    x: float
    y: float
    radius: float
    color: Color


class Words(NamedTuple):
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

    def add(self, other: Picture) -> None:
        """Draw the marks of another picture over these."""
        self.boxes += other.boxes
        self.lines += other.lines
        self.dots += other.dots
        self.words += other.words

    def move_up(self, distance: float) -> Picture:
        """Return the picture with all marks higher by a distance, pixels."""
        return Picture(
            [box._replace(y=box.y + distance) for box in self.boxes],
            [line._replace(points=line.points + np.array([0.0, distance])) for line in self.lines],
            [dot._replace(y=dot.y + distance) for dot in self.dots],
            [words._replace(y=words.y + distance) for words in self.words],
        )


def round_axis(low: float, high: float) -> tuple[float, float]:
    """Return round ends of an axis for low < high: at most ten steps of 1, 2 or 5 times a power of ten."""
    span = high - low
    step = 10.0 ** np.floor(np.log10(span))
    step *= next(factor for factor in (0.1, 0.2, 0.5, 1.0) if span <= 10.0 * factor * step)
    return float(np.floor(low / step) * step), float(np.ceil(high / step) * step)


def scale_curve(
    time: Floats, value: Floats, window: tuple[float, float], ends: tuple[float, float], box: Box
) -> Floats:
    """Return the points (k, 2), pixels, of a curve in a box; values beyond the axis are drawn at its end."""
    shown = (time >= window[0]) & (time <= window[1]) & np.isfinite(value)
    x = (time[shown] - window[0]) / (window[1] - window[0])
    y = np.clip((value[shown] - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    return np.column_stack([box.x + x * box.width, box.y + y * box.height])


def move_apart(places: Floats, radius: float, balls: Floats, radii: Floats) -> Floats:
    """Return centers (k, 2) of discs of a radius, moved off each other and off balls (m, 2)."""
    at = places + np.outer(np.arange(len(places)), [0.0, 0.01])  # also of those at one place
    least = np.concatenate([np.full(len(at), 2.0 * radius), radius + radii])
    for _ in range(ROUNDS):
        away = at[:, None] - np.concatenate([at, balls])
        far = np.linalg.norm(away, axis=2)
        np.fill_diagonal(far, np.inf)
        lack = np.fmax(least - far, 0.0)  # 0 for NaN: what is behind the camera
        if lack.max(initial=0.0) < 0.5:
            break
        at += 0.5 * np.einsum("kn,kni->ki", lack / np.fmax(far, 1.0), np.nan_to_num(away))
    return at
