"""Sample shapes as formulas over a square: values from 0 to 1, x and y from -1 to 1, y upwards."""

from __future__ import annotations

import math

import numpy as np
from digiclay.core.base.arrays import Floats

Point = tuple[float, float]


def square(side: int) -> tuple[Floats, Floats]:
    """Return x and y of the middles of side x side pixels, the lowest row first."""
    middles = (np.arange(side) + 0.5) * 2.0 / side - 1.0
    x, y = np.meshgrid(middles, middles)
    return x, y


def between_0_and_1(values: Floats) -> Floats:
    """Stretch values to 0..1."""
    return (values - values.min()) / np.ptp(values)


def bump(x: Floats, y: Floats, at: Point, size: Point) -> Floats:
    """Return a Gaussian of height 1."""
    return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((y - at[1]) / size[1]) ** 2)


def saddle(x: Floats, y: Floats) -> Floats:
    """Return x² - y²."""
    return x * x - y * y


def wave(x: Floats, y: Floats) -> Floats:
    """Return two waves that run along x, and fade towards the sides."""
    return np.sin(2.0 * math.pi * x) * np.cos(0.5 * math.pi * y)


def ripple(x: Floats, y: Floats) -> Floats:
    """Return the waves around a drop: sin(k r) / (k r)."""
    return np.sinc(3.2 * np.hypot(x, y))


def crater(x: Floats, y: Floats) -> Floats:
    """Return a bowl with a raised rim, a central peak, and ejecta that thin out like r⁻³."""
    r = np.hypot(x, y)
    rim = 0.6
    bowl = -1.0 + 1.6 * (r / rim) ** 2
    ejecta = 0.6 * (rim / np.maximum(r, rim)) ** 3
    peak = 0.75 * np.exp(-((r / 0.11) ** 2))
    return np.where(r < rim, bowl, ejecta) + peak


def spiral(x: Floats, y: Floats) -> Floats:
    """Return a ridge along an Archimedean spiral of three turns that rises outwards."""
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    turn = 0.3
    off = (r - turn * angle / (2.0 * math.pi) + turn / 2) % turn - turn / 2
    ridge = np.exp(-((off / 0.085) ** 2))
    return ridge * (0.35 + 0.65 * r) * (r < 0.93)


def terrain(x: Floats, y: Floats) -> Floats:
    """Return hills: waves of random direction and phase, each octave 0.42 as high, valleys worn flat."""
    chance = np.random.default_rng(1983)
    height = np.zeros_like(x)
    for octave in range(6):
        for _ in range(7):
            angle, phase = chance.uniform(0.0, 2.0 * math.pi, 2)
            along = math.cos(angle) * x + math.sin(angle) * y
            height += 0.42**octave * np.sin(1.9 * 2.0**octave * along + phase)
    return between_0_and_1(height) ** 1.7


def heart(x: Floats, y: Floats) -> Floats:
    """Return a pillow inside the heart curve x² + (y - 0.7 √|x|)² = 1."""
    x, y = 1.15 * x, 1.2 * y + 0.15
    inside = 1.0 - x * x - (y - 0.7 * np.sqrt(np.abs(x))) ** 2
    return np.sqrt(np.maximum(inside, 0.0))


def segment(x: Floats, y: Floats, start: Point, end: Point) -> Floats:
    """Return distances to a straight stroke."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    part = np.clip(((x - start[0]) * dx + (y - start[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.hypot(x - start[0] - part * dx, y - start[1] - part * dy)


def arc(x: Floats, y: Floats, middle: Point, radius: float, gap: float) -> Floats:
    """Return distances to a circle that is open to the right over an angle of +- gap."""
    dx, dy = x - middle[0], y - middle[1]
    on = np.abs(np.hypot(dx, dy) - radius)
    tip = radius * math.cos(gap), radius * math.sin(gap)
    ends = np.hypot(dx - tip[0], np.abs(dy) - tip[1])
    return np.where(np.abs(np.arctan2(dy, dx)) < gap, ends, on)


def letters(x: Floats, y: Floats) -> Floats:
    """Return CLAY in round strokes, two letters above two."""
    distance = np.min(
        [
            arc(x, y, (-0.48, 0.49), 0.31, 0.8),
            segment(x, y, (0.22, 0.8), (0.22, 0.18)),
            segment(x, y, (0.22, 0.18), (0.68, 0.18)),
            segment(x, y, (-0.78, -0.8), (-0.47, -0.17)),
            segment(x, y, (-0.47, -0.17), (-0.16, -0.8)),
            segment(x, y, (-0.66, -0.57), (-0.28, -0.57)),
            segment(x, y, (0.18, -0.17), (0.46, -0.46)),
            segment(x, y, (0.74, -0.17), (0.46, -0.46)),
            segment(x, y, (0.46, -0.46), (0.46, -0.8)),
        ],
        axis=0,
    )
    return np.sqrt(np.maximum(1.0 - (distance / 0.11) ** 2, 0.0))


#: Dots of braille letters: columns 0 and 1, rows 0 to 2 from the top.
BRAILLE = {
    "c": ((0, 0), (1, 0)),
    "l": ((0, 0), (0, 1), (0, 2)),
    "a": ((0, 0),),
    "y": ((0, 0), (1, 0), (1, 1), (0, 2), (1, 2)),
}


def braille(x: Floats, y: Floats) -> Floats:
    """Return the line "clay" in braille: domes, dots 1 apart, letters 2.5 apart, as in print."""
    pitch = 0.19
    height = np.zeros_like(x)
    for number, letter in enumerate("clay"):
        for column, row in BRAILLE[letter]:
            at = ((number * 2.5 + column) - 4.25) * pitch, (1.0 - row) * pitch
            square = ((x - at[0]) ** 2 + (y - at[1]) ** 2) / (0.42 * pitch) ** 2
            height = np.maximum(height, np.sqrt(np.maximum(1.0 - square, 0.0)))
    return height


def face(x: Floats, y: Floats) -> Floats:
    """Return a face-like relief: half an egg, with brow, nose, eyes, cheeks, lips and chin laid on."""
    egg = np.sqrt(np.maximum(1.0 - (x / 0.72) ** 2 - ((y - 0.02) / 0.95) ** 2, 0.0))
    nose = bump(x, y, (0.0, -0.13), (0.11, 0.13)) + 0.6 * bump(x, y, (0.0, 0.1), (0.075, 0.22))
    sides = np.abs(x)
    eyes = bump(sides, y, (0.27, 0.2), (0.15, 0.09)) - 0.6 * bump(sides, y, (0.27, 0.19), (0.085, 0.05))
    brow = bump(sides, y, (0.25, 0.36), (0.2, 0.055))
    cheek = bump(sides, y, (0.36, -0.12), (0.16, 0.16))
    lips = bump(x, y, (0.0, -0.42), (0.19, 0.045)) + bump(x, y, (0.0, -0.53), (0.15, 0.05))
    mouth = bump(x, y, (0.0, -0.475), (0.2, 0.022))
    chin = bump(x, y, (0.0, -0.76), (0.17, 0.1))
    laid_on = 0.3 * nose - 0.22 * eyes + 0.09 * brow + 0.07 * cheek + 0.1 * lips - 0.08 * mouth + 0.1 * chin
    return egg * 0.62 + np.where(egg > 0.0, laid_on, 0.0) * np.minimum(egg * 3.0, 1.0)
