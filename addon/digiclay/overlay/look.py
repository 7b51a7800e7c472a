"""Colors of the overlay, with contrast in any theme.

Numpy only, no Blender.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
#: Contrast that the Web Content Accessibility Guidelines ask of letters, if possible, at least, and of lines.
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
    """Choose all colors to go with those of the theme.

    `back`: the theme's color behind letters; `ink`: the theme's letters; replaced by black or white where
    they could not be read.
    """
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


def contrast(one: Color, other: Color) -> float:
    """Return the contrast of two colors as the guidelines define it, 1 to 21.

    `one`, `other` (float, float, float), colors.
    """
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def make_legible(color: Color, back: Color, least: float) -> Color:
    """Return a color, mixed with as much black or white as it needs for a contrast to what is behind it.

    `color`, `back` (float, float, float), the color, and what is behind it; `least`: contrast, 1 to 21.
    """
    end = WHITE if contrast(WHITE, back) >= contrast(BLACK, back) else BLACK
    for share in np.linspace(0.0, 1.0, 41):
        mixed = _mix(color, end, float(share))
        if contrast(mixed, back) >= least:
            return mixed
    return end


def _mix(one: Color, other: Color, share: float) -> Color:
    """Return a color with a share of another."""
    r, g, b = (a + (c - a) * share for a, c in zip(one, other, strict=True))
    return r, g, b


def _luminance(color: Color) -> float:
    """Return the relative luminance of an sRGB color."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b
