"""Intended reliefs of the things that strokes form: drawings that depend on no stroke.

Lines, arcs and areas have the section that a designer expects of a brush: even up to the flat part
of its blister, then straight down to the ground.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

Corners = Sequence[tuple[float, float]]

#: Section of strokes by the bed's fingertip, a stylus of 6 mm and a palm: half of the flat part,
#: and of all.
TIP, STYLUS, PALM = (3.0, 7.5), (2.25, 5.625), (18.75, 46.875)


@dataclass(frozen=True)
class Line:
    """Drawn line: its corners, its height above what it is drawn on, and its section, mm; closed: an area."""

    corners: Corners
    height: float
    section: tuple[float, float] = TIP
    area: bool = False

    def evaluate(self, x, y):
        """Return heights at some places: even up to the flat part, and then down to nothing."""
        far = find_distance(self.corners, x, y)
        if self.area:
            far = np.where(_lies_inside(self.corners, x, y), 0.0, far)
        flat, half = self.section
        return np.asarray(self.height * np.clip((half - far) / (half - flat), 0.0, 1.0))


def _arc(x, y, radius, start, end):
    """Return the corners of an arc from angle to angle, degrees."""
    angles = np.radians(np.linspace(start, end, 1 + max(2, round(abs(end - start)))))
    return [(x + radius * np.cos(a), y + radius * np.sin(a)) for a in angles.tolist()]


def _round(corners):
    """Return a closed polygon with its corners cut off, and those that this leaves once more."""
    for _ in range(2):
        start, end = np.array(corners[:-1]), np.array(corners[1:])
        cut = np.stack([0.75 * start + 0.25 * end, 0.25 * start + 0.75 * end], axis=1).reshape(
            -1, 2
        )
        corners = [*map(tuple, cut.tolist()), tuple(cut[0].tolist())]
    return corners


def _mirror(*lines):
    """Return lines and their mirror images."""
    return [
        replace(line, corners=[(s * x, y) for x, y in line.corners])
        for line in lines
        for s in (1, -1)
    ]


def _draw_r(height):
    """Stem, bowl and leg of a letter R."""
    bowl = [(-28.0, 50.0), *_arc(4.0, 25.0, 25.0, 90.0, -90.0), (-28.0, 0.0)]
    return [
        Line(part, height)
        for part in ([(-28.0, -50.0), (-28.0, 50.0)], bowl, [(4.0, 0.0), (30.0, -50.0)])
    ]


#: Letter A without serifs, of one depth.
LETTER_A = [
    Line([(-40.0, -50.0), (0.0, 50.0), (40.0, -50.0)], -5.0), Line([(-25.2, -12.0), (25.2, -12.0)], -5.0),
]  # fmt: skip
#: Spiral whose turns are 18 mm apart: 400 mm between its first and its last radius.
SPIRAL = [
    (r * np.cos(a), r * np.sin(a))
    for r in np.linspace(4.0, 48.04, 1000)
    for a in (2 * np.pi * (r - 4) / 18,)
]
#: Leaf between two arcs from tip to tip, midrib with a stalk, and veins.
LEAF = [
    *_mirror(Line(_arc(-31.6, 2.5, 65.6, -61.2, 61.2), 5.0, STYLUS)),
    Line([(0.0, 60.0), (0.0, -68.0)], 5.0, STYLUS),
    *_mirror(*(Line(vein, 3.0, STYLUS) for vein in (
        [(0.0, -30.0), (23.0, -6.0)], [(0.0, -5.0), (23.0, 19.0)], [(0.0, 20.0), (16.0, 38.0)]))),
]  # fmt: skip
#: Coin: rim, star of five points, beads.
STAR = [(38.0 * np.sin(a), 38.0 * np.cos(a)) for a in np.radians(144.0 * np.arange(6)).tolist()]
COIN = [
    Line(_arc(0.0, 0.0, 62.0, 0.0, 360.0), 5.0), Line(STAR, 4.0, STYLUS),
    *(Line([bead], 3.0, STYLUS) for bead in _arc(0.0, 0.0, 46.0, 15.0, 345.0)[::30]),
]  # fmt: skip
SMILEY = [
    Line(_arc(0.0, 0.0, 52.0, 0.0, 360.0), 6.0), *_mirror(Line([(18.0, 22.0), (18.0, 12.0)], -5.0)),
    Line(_arc(0.0, 0.0, 29.0, 205.0, 335.0), -5.0),
]  # fmt: skip
#: Head in profile: its contour; on it an ear, an eye, a mouth and three waves of hair.
HEAD = _round([
    (-8, -60), (-12, -44), (-26, -41), (-34, -35), (-31, -28), (-37, -23), (-33, -19.5), (-38, -15),
    (-35, -11), (-49, -6), (-36, 12), (-39, 19), (-36, 34), (-23, 50), (0, 58), (23, 53), (39, 37), (43, 16),
    (34, -6), (26, -18), (24, -40), (28, -60), (-8, -60),
])  # fmt: skip
PORTRAIT = (
    [Line(HEAD, 5.0, area=True)],
    [
        Line(_arc(8.0, 2.0, 9.0, 120.0, -120.0), 2.5, STYLUS),
        Line([(-26.0, 8.0), (-20.0, 9.0)], -3.0, STYLUS),
        Line([(-34.0, -19.5), (-22.0, -20.0)], -2.0, STYLUS),
        *(Line(_arc(4.0, 6.0, *wave), -2.0, STYLUS) for wave in ((22, 130, 5), (32, 125, 5), (42, 115, 20))),
    ],
)  # fmt: skip
#: Layers of lines: where those of a layer cross the greater height counts; layers add up.
RELIEFS = {
    "letter_a": (LETTER_A,),
    "r_lowered": (_draw_r(-4.0),),
    "r_raised": (_draw_r(8.0),),
    "smiley": (SMILEY,),
    "spiral": ([Line(SPIRAL, -6.0)],),
    "ring": ([Line(_arc(0.0, 0.0, 45.0, 0.0, 360.0), 8.0)],),
    "lines": ([Line([(-50.0, y), (50.0, y)], -3.0) for y in range(-54, 60, 12)],),
    "coin": (COIN,),
    "portrait": PORTRAIT,
    "crater": ([Line([(0.0, 0.0)], -12.0, PALM)], [Line(_arc(0.0, 0.0, 48.0, 0.0, 360.0), 5.0)]),
    "leaf": (LEAF,),
}
#: The things: each has recorded strokes and an intended relief.
THINGS = tuple(RELIEFS)


def find_relief(name, x, y):
    """Return the intended heights of one of `THINGS` above rest at some places (n,), m."""
    layers = [
        np.array([line.evaluate(1e3 * x, 1e3 * y) for line in layer]) for layer in RELIEFS[name]
    ]
    heights = [one.max(axis=0).clip(0.0) + one.min(axis=0).clip(None, 0.0) for one in layers]
    return np.asarray(1e-3 * np.sum(heights, axis=0))


def find_distance(corners, x, y):
    """Return how far places (n,) are from a line through corners, or from a single one."""
    near = np.full(x.shape, np.inf)
    for (ax, ay), (bx, by) in pairwise(corners if len(corners) > 1 else [*corners, *corners]):
        along, across = bx - ax, by - ay
        share = ((x - ax) * along + (y - ay) * across) / (along**2 + across**2 or 1.0)
        share = np.clip(share, 0.0, 1.0)
        near = np.minimum(near, np.hypot(x - ax - share * along, y - ay - share * across))
    return near


def _lies_inside(corners, x, y):
    """Return whether places are inside a closed polygon, by how often a ray crosses it."""
    inside = np.zeros(x.shape, np.bool_)
    for (ax, ay), (bx, by) in pairwise(corners):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (bx - ax) * (y - ay) / (by - ay))
    return inside
