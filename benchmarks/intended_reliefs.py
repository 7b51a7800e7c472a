"""Intended reliefs of the made things, from their drawings: height above rest at any place, m.

They know nothing of strokes, fingertip or bed. Lengths in the drawings are in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from digiclay.core.base.arrays import Floats
from numpy.typing import NDArray

Relief = Callable[[Floats, Floats], Floats]
Corners = Sequence[tuple[float, float]]

#: Letter A without serifs: outlines of its left leg, its right leg and its bar, and its depth.
LETTER_A: tuple[Corners, ...] = (
    ((-46.0, -53.0), (-34.0, -53.0), (6.0, 53.0), (-6.0, 53.0)),
    ((46.0, -53.0), (34.0, -53.0), (-6.0, 53.0), (6.0, 53.0)),
    ((-28.0, -17.5), (28.0, -17.5), (28.0, -6.5), (-28.0, -6.5)),
)
LETTER_DEPTH = 5.0
#: Half of a torus: radius of its center line, and of its tube.
RING, TUBE = 45.0, 8.0
#: Paraboloid of a bowl: radius and depth; its rim: radius, height and half its breadth.
BOWL, RIM = (44.0, 12.0), (48.0, 5.0, 10.0)
#: Leaf between two arcs from tip to tip, each so far from the midrib at most; half the breadth of its lines.
TIPS, BULGE, LINE = ((0.0, -55.0), (0.0, 60.0)), 34.0, 6.0
#: Heights of outline and midrib, and of the veins; the midrib goes on as a stalk to here.
OUTLINE_HEIGHT, VEIN_HEIGHT, STALK = 5.0, 3.0, -70.0
#: Beginnings and ends of the veins on the right.
VEINS = (((0.0, -30.0), (24.0, -5.0)), ((0.0, -5.0), (24.0, 20.0)), ((0.0, 20.0), (18.0, 40.0)))


def find_relief(name: str, x: Floats, y: Floats) -> Floats:
    """Return the intended heights above rest at some places, m. `name`: one of `RELIEFS`; `x`, `y`, m."""
    return 1e-3 * RELIEFS[name](1e3 * x, 1e3 * y)


def _letter_a(x: Floats, y: Floats) -> Floats:
    """Cut to one depth within the outlines."""
    inside = np.any([_lies_inside(part, x, y) for part in LETTER_A], axis=0)
    return np.where(inside, -LETTER_DEPTH, 0.0)


def _lies_inside(corners: Corners, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Return whether places are inside a convex polygon."""
    sides = zip(corners, (*corners[1:], corners[0]), strict=True)
    turns = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for (ax, ay), (bx, by) in sides]
    return np.asarray(np.all(np.array(turns) >= 0.0, axis=0) | np.all(np.array(turns) <= 0.0, axis=0))


def _ring(x: Floats, y: Floats) -> Floats:
    """Upper half of a torus."""
    return np.sqrt(np.clip(TUBE**2 - (np.hypot(x, y) - RING) ** 2, 0.0, None))


def _crater(x: Floats, y: Floats) -> Floats:
    """Bowl with a round rim."""
    far, (radius, depth), (at, height, breadth) = np.hypot(x, y), BOWL, RIM
    bowl = -depth * np.clip(1.0 - (far / radius) ** 2, 0.0, None)
    return bowl + height * _bump((far - at) / breadth)


def _leaf(x: Floats, y: Floats) -> Floats:
    """Outline, midrib and veins as round lines."""
    side = np.abs(x)
    (_, foot), (_, top) = TIPS
    half, middle = (top - foot) / 2.0, (top + foot) / 2.0
    radius = (half**2 + BULGE**2) / (2.0 * BULGE)
    arc = np.abs(np.hypot(side + radius - BULGE, y - middle) - radius)
    # Beyond the tips the nearest place of the arc is a tip.
    tips = np.minimum(np.hypot(side, y - foot), np.hypot(side, y - top))
    arc = np.where((y >= foot) & (y <= top), arc, tips)
    lines = [OUTLINE_HEIGHT * _bump(arc / LINE)]
    lines.append(OUTLINE_HEIGHT * _bump(_find_distance((0.0, STALK), TIPS[1], side, y) / LINE))
    lines += [VEIN_HEIGHT * _bump(_find_distance(*vein, side, y) / LINE) for vein in VEINS]
    return np.asarray(np.max(lines, axis=0))


def _face(x: Floats, y: Floats) -> Floats:
    """Half an ellipsoid with eyes, nose and mouth."""
    side = np.abs(x)
    head = 10.0 * np.sqrt(np.clip(1.0 - (x / 46.0) ** 2 - (y / 56.0) ** 2, 0.0, None))
    eyes = -5.0 * _bump(np.hypot((side - 17.0) / 10.0, (y - 14.0) / 7.0))
    nose = 6.0 * _bump(_find_distance((0.0, 12.0), (0.0, -8.0), x, y) / 6.0)
    smile = np.hypot(x, y + 2.0) - 26.0
    mouth = -4.0 * _bump(np.hypot(smile / 5.0, np.clip(side - 14.0, 0.0, None) / 5.0)) * (y < -2.0)
    return np.asarray(head + eyes + nose + mouth)


def _bump(far: Floats) -> Floats:
    """Return a round hill of height 1 that ends at the distance 1."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(np.abs(far), 1.0)))


def _find_distance(start: tuple[float, float], end: tuple[float, float], x: Floats, y: Floats) -> Floats:
    """Return how far places are from a line between two places."""
    along, across = end[0] - start[0], end[1] - start[1]
    share = ((x - start[0]) * along + (y - start[1]) * across) / (along**2 + across**2)
    share = np.clip(share, 0.0, 1.0)
    return np.hypot(x - start[0] - share * along, y - start[1] - share * across)


RELIEFS: dict[str, Relief] = {
    "letter_a": _letter_a, "ring": _ring, "crater": _crater, "leaf": _leaf, "face": _face,
}  # fmt: skip
