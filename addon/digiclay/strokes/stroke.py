"""Press stroke: the path that the hand draws, and how far the fingertip has come along it. No Blender.

What a stroke forms follows from its path alone, not from the times at which the hand was where: the
session waits for the hand, and the clay with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..core.base.arrays import Floats
from ..core.control.blister import Blister
from ..core.model.fingertip import Fingertip
from ..core.shapes.heightmap import HeightMap
from .falloff import Falloff
from .tracking import Tracking

Place = tuple[float, float]
Coordinate = TypeVar("Coordinate", float, Floats)

#: What the fingertip does: it waits for its turn, goes above the path's first place, presses there,
#: rises with the blister (if its brush has one), goes along the path, leaves it, waits above until
#: the valves have driven the pins to what the stroke is to leave; and the end. An image yields to
#: one before it that is too near: its fingertip lifts, and waits above. RETURNING: it waits until
#: pins that are locked in part are back by their shares.
WAITING, ABOVE, PRESSING, RISING, DRAGGING, LEAVING, FINISHING, DONE, YIELDING = range(9)
RETURNING = 9
#: Deepest press, and least one, m; also the greatest and the least height of a raise.
DEEPEST, SHALLOWEST = 30e-3, 0.1e-3


class Image(NamedTuple):
    """Plane isometry, (x, y) -> (xx x + xy y + x0, yx x + yy y + y0), m: the path itself, or its image."""

    xx: float = 1.0
    xy: float = 0.0
    yx: float = 0.0
    yy: float = 1.0
    x0: float = 0.0
    y0: float = 0.0

    def place(self, x: Coordinate, y: Coordinate) -> tuple[Coordinate, Coordinate]:
        """Return where a place comes to, or places (n,), m."""
        return self.xx * x + self.xy * y + self.x0, self.yx * x + self.yy * y + self.y0

    def trace(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return where places (n,), m, have come from."""
        x, y = x - self.x0, y - self.y0
        return self.xx * x + self.yx * y, self.xy * x + self.yy * y

    @property
    def mirrors(self) -> bool:
        """Whether it turns left into right."""
        return self.xx * self.yy - self.xy * self.yx < 0.0


#: The path alone.
ALONE = (Image(),)
#: Symmetries of strokes; of RADIAL, how many images there may be, the path itself among them.
SYMMETRIES = ("NONE", "X", "Y", "XY", "RADIAL")
FEWEST, MOST = 2, 24


def make_images(
    symmetry: str, count: int = FEWEST, center: Place = (0.0, 0.0), angle: float = 0.0
) -> tuple[Image, ...]:
    """Return a stroke's path and its images by a symmetry about a center, m.

    X mirrors along x, which `angle`, rad, turns, Y across it; RADIAL turns the path `count` times.
    """
    if symmetry == "NONE":
        return ALONE
    if symmetry == "RADIAL":
        angles = 2.0 * math.pi * np.arange(count) / count
        turns = [(math.cos(turn), math.sin(turn), 1.0) for turn in angles.tolist()]
    else:
        # A mirror image across the line at an angle a is (cos 2a, sin 2a; sin 2a, -cos 2a).
        cos, sin = math.cos(2.0 * angle), math.sin(2.0 * angle)
        x, y, opposite = (-cos, -sin, -1.0), (cos, sin, -1.0), (-1.0, 0.0, 1.0)
        turns = [(1.0, 0.0, 1.0), *{"X": [x], "Y": [y], "XY": [x, opposite, y]}[symmetry]]
    return tuple(_about(center, cos, sin, side) for cos, sin, side in turns)


def _about(center: Place, cos: float, sin: float, side: float) -> Image:
    """Return a turn (`side` 1) or a mirror image (-1) about a center, m."""
    (x, y), xy = center, -sin * side
    return Image(cos, xy, sin, cos * side, x - cos * x - xy * y, y - sin * x - cos * side * y)


class Brush(Enum):
    """Effect of a press stroke on the surface."""

    LOWER = "LOWER"
    RAISE = "RAISE"
    LEVEL = "LEVEL"
    SMOOTH = "SMOOTH"
    ERASE = "ERASE"
    LOCK = "LOCK"
    UNLOCK = "UNLOCK"
    STAMP = "STAMP"
    IMPRINT = "IMPRINT"
    INVERT_LOCKS = "INVERT_LOCKS"
    CLEAR_LOCKS = "CLEAR_LOCKS"
    CREASE = "CREASE"
    CREST = "CREST"
    FLATTEN = "FLATTEN"
    SET_BASE = "SET_BASE"
    LOCK_PINS = "LOCK_PINS"
    UNLOCK_PINS = "UNLOCK_PINS"
    GROW_LOCKS = "GROW_LOCKS"
    SHRINK_LOCKS = "SHRINK_LOCKS"
    BLUR_LOCKS = "BLUR_LOCKS"

    @property
    def inverse(self) -> Brush:
        """What Ctrl makes of it."""
        return INVERSES.get(self, self)

    @property
    def has_amount(self) -> bool:
        """Whether it has a depth or height, not a strength alone."""
        return self in (Brush.LOWER, Brush.RAISE, *PLACED)

    @property
    def rises(self) -> bool:
        """Whether that is a height, not a depth."""
        return self in (Brush.RAISE, Brush.STAMP, Brush.CREST)


#: Brushes without a strength.
LOCKS = tuple(brush for brush in Brush if "LOCK" in brush.value)
#: Brushes that put a shape onto the surface, up or down.
STAMPS = (Brush.STAMP, Brush.IMPRINT)
#: Brushes that press nothing: the valves bring the pins to their nominal surface.
PLACED = (*STAMPS, Brush.CREASE, Brush.CREST, Brush.FLATTEN)
#: Brushes that the valves sweep along the path, or place where they have a falloff or limits.
SWEPT = (Brush.SMOOTH, Brush.ERASE, Brush.LOCK, Brush.UNLOCK)
#: Brushes that work in the ring.
RINGED = (*SWEPT, *PLACED[2:])
INVERSES = {
    Brush.LOWER: Brush.RAISE,
    Brush.LOCK: Brush.UNLOCK,
    Brush.STAMP: Brush.IMPRINT,
    Brush.CREASE: Brush.CREST,
}
INVERSES |= {other: brush for brush, other in INVERSES.items()}


def needs_blister(brush: Brush, falloff: Falloff = Falloff.DEVICE) -> bool:
    """Return whether the blister of the device has to follow the fingertip."""
    shaped = brush is Brush.LOWER and falloff is not Falloff.DEVICE
    return shaped or brush in (Brush.RAISE, Brush.LEVEL)


#: Limits of a stroke that has none, m.
UNLIMITED = (-math.inf, math.inf)


class Combine(Enum):
    """What a stroke leaves where something is formed already.

    HIGHEST and LOWEST leave the higher or lower one of the surface and of what the stroke forms on the
    base, ADD puts that onto the surface, REPLACE leaves it alone. USUAL: Level replaces, others add.
    """

    USUAL = "USUAL"
    HIGHEST = "HIGHEST"
    LOWEST = "LOWEST"
    ADD = "ADD"
    REPLACE = "REPLACE"


#: How strokes may combine, by their brush; those of others do so as usual.
EVERY = tuple(Combine)
COMBINATIONS = {
    Brush.LOWER: (Combine.USUAL, Combine.ADD, Combine.LOWEST),
    Brush.RAISE: (Combine.USUAL, Combine.ADD, Combine.HIGHEST),
    **dict.fromkeys((Brush.LEVEL, *STAMPS), EVERY),
}


@dataclass(frozen=True)
class Sample:
    """Point of a press stroke."""

    #: Place on the bed, m.
    x: float
    y: float
    #: How far below the surface, or above it where it is raised, m.
    depth: float
    #: Share of the way from the surface to the level, or strength of the smoothing, from 0 to 1.
    share: float = 1.0
    #: How far the fingertip leans towards x and y of the bed, rad; see `pose.lean_finger`.
    lean: Place = (0.0, 0.0)


class Correction(NamedTuple):
    """How far pins about a path are from the nominal surface when the fingertip has left, m."""

    rms: float
    largest: float
    #: Whether the valves bring them there.
    made: bool


@dataclass(frozen=True, eq=False)
class Stroke:
    """Press stroke, and the progress of the fingertip along it."""

    #: Tells the strokes of a session apart.
    number: int
    #: The path, at least one place.
    samples: tuple[Sample, ...]
    brush: Brush = Brush.LOWER
    #: The path itself, then its images.
    images: tuple[Image, ...] = ALONE
    #: Whether a path that comes back to where it was counts from what it has left there.
    accumulate: bool = False
    #: What is stamped, with values from 0 to 1.
    stamp: HeightMap | None = None
    falloff: Falloff = Falloff.DEVICE
    #: What it leaves where something is formed, and the lowest and the highest that it forms, m above
    #: rest.
    combine: Combine = Combine.USUAL
    limits: tuple[float, float] = UNLIMITED
    #: Pins that it locks or unlocks, those within its limits; None: all.
    pins: tuple[int, ...] | None = None
    #: Whether what the finger and the method have formed stays, not brought to the nominal surface.
    as_left: bool = False
    #: Fingertip that forms it, and the blister that follows; None: those of the scene.
    finger: Fingertip | None = None
    blister: Blister | None = None
    #: Whether the hand still draws.
    held: bool = True
    #: The stroke along each image alone, while fingertips go along several at once.
    parts: tuple[Stroke, ...] = ()
    #: Whether this image is gone along from the end of the path: near its beginning there was
    #: another one.
    backward: bool = False
    #: What the fingertip does.
    phase: int = WAITING
    #: Index of the image that the fingertip is at, and of the sample it is at, or past.
    image: int = 0
    reached: int = 0
    #: (n,), heights of the pins when the fingertip began, and those that its depth counts from
    #: where it is, m; None before.
    height: Floats | None = None
    ground: Floats | None = None
    #: (n,), heights of the pins when the fingertip came down to the image that it is at, m; None
    #: before.
    standing: Floats | None = None
    #: How high it is when it first touches one of those, m; whether that is beside its lowest
    #: point; and how low it is to be where it is, m.
    touch: float = 0.0
    slopes: bool = False
    lowest: float = 0.0
    #: First sample of the present pass of a path that accumulates.
    first: int = 0
    #: How the blister follows, of a device that has one; found when the fingertip begins.
    tracking: Tracking | None = None
    #: How fast the fingertip rises with the blister, m/s.
    climb: float = 0.0
    #: How fast the fingertip drags, m/s.
    pace: float = 0.0
    #: (4,), orientation of the fingertip when it began, which it has again when it is done; None
    #: before.
    turn: Floats | None = None
    #: (n,), heights to which the valves drive pins after the fingertip has left, m, NaN: not
    #: driven; of a stroke finished as left those at the last look.
    finish: Floats | None = None
    #: How far the pins are from the nominal surface when the fingertip has left; None before.
    correction: Correction | None = None
    #: Control periods since the fingertip waits for its pins, and whether they stood at the last
    #: look.
    waited: int = 0
    arrived: bool = False

    @property
    def from_base(self) -> bool:
        """Whether it counts from the base, not from the surface."""
        if self.brush is Brush.LEVEL:
            return self.combine is Combine.ADD
        return self.combine not in (Combine.USUAL, Combine.ADD) and not self.accumulate

    @property
    def done(self) -> bool:
        """Whether the fingertip has gone along all of the path and left it."""
        return self.phase == DONE

    @property
    def ahead(self) -> tuple[Floats, ...]:
        """Places fingertips have yet to come to, (k, 2), m: along each image that is not finished."""
        path = [(sample.x, sample.y) for sample in self.samples]
        left = {part.image: (part.reached, part.backward) for part in self.parts if not part.left}
        later = dict.fromkeys(range(self.image + 1, len(self.images)), (0, False))
        return tuple(
            np.array(
                [
                    self.images[image].place(*place)
                    for place in path[:: -1 if backward else 1][reached:]
                ]
            )
            for image, (reached, backward) in (
                left or {self.image: (self.reached, False), **later}
            ).items()
        )

    @property
    def placed(self) -> bool:
        """Whether the valves alone bring the pins to its nominal surface."""
        limited = self.limits != UNLIMITED and self.brush not in LOCKS
        shaped = self.falloff is not Falloff.DEVICE or limited
        return self.brush in PLACED or (self.brush in SWEPT and shaped)

    @property
    def left(self) -> bool:
        """Whether the fingertip has left the image that it was at."""
        return self.phase in (FINISHING, DONE)

    @property
    def drawn(self) -> bool:
        """Whether the fingertip has come to the end of the path, and the hand draws no more."""
        return not self.held and self.reached == len(self.samples) - 1

    def place(self, index: int) -> Place:
        """Return where a sample is on the path the fingertip is at, m."""
        sample = self.samples[index]
        return self.images[self.image].place(sample.x, sample.y)


def start(
    number: int,
    x: float,
    y: float,
    depth: float,
    images: tuple[Image, ...] = ALONE,
    brush: Brush = Brush.LOWER,
    share: float = 1.0,
    lean: Place = (0.0, 0.0),
    **more: Any,
) -> Stroke:
    """Return the stroke of a mouse that goes down at a place, m; see `Sample`. `more`: of `Stroke`."""
    first = Sample(x, y, _limit_depth(depth), share, lean)
    return Stroke(number, (first,), brush, images, **more)


def draw(
    stroke: Stroke,
    x: float,
    y: float,
    depth: float,
    share: float = 1.0,
    lean: Place = (0.0, 0.0),
) -> Stroke:
    """Return the stroke drawn on to a place; a released one stays as it is."""
    if not stroke.held:
        return stroke
    return replace(
        stroke, samples=(*stroke.samples, Sample(x, y, _limit_depth(depth), share, lean))
    )


def let_go(stroke: Stroke) -> Stroke:
    """Return the stroke as the hand leaves it."""
    return replace(stroke, held=False)


def alter(stroke: Stroke, **values: Any) -> Stroke:
    """Return a stroke with some values, itself where it has them: a copy takes a tenth of a step."""
    same = all(getattr(stroke, name) == value for name, value in values.items())
    return stroke if same else replace(stroke, **values)


def deepen(stroke: Stroke, by: float) -> Stroke:
    """Return the stroke with its depth changed where it is, m, within the limits."""
    last = stroke.samples[-1]
    return draw(stroke, last.x, last.y, last.depth + by, last.share, last.lean)


def _limit_depth(depth: float) -> float:
    return min(max(depth, SHALLOWEST), DEEPEST)


#: Longest side of the polygon that stands for a ring, m, and least radius of one.
SIDE, SMALLEST_RING = 1e-3, 0.5e-3


def pull(place: Place, mouse: Place, radius: float) -> Place:
    """Return where a place gets that the mouse pulls on a string of a length, m."""
    away = math.hypot(mouse[0] - place[0], mouse[1] - place[1])
    if away <= radius:
        return place
    share = (away - radius) / away
    return place[0] + share * (mouse[0] - place[0]), place[1] + share * (mouse[1] - place[1])


def lay_line(start: Place, end: Place) -> Floats:
    """Return the ends of a line, (2, 2), m."""
    return np.array([start, end])


def lay_square(middle: Place, side: Place) -> Floats:
    """Return a closed square (5, 2), m, about a place, with the middle of its right side at another."""
    along = np.subtract(side, middle)
    across = np.array([-along[1], along[0]])
    corners = [along - across, along + across, across - along, -along - across]
    return np.array([*corners, corners[0]]) + middle


def lay_ring(center: Place, rim: Place) -> Floats:
    """Return a closed polygon (k, 2), m, for the circle about a place through another."""
    radius = math.hypot(rim[0] - center[0], rim[1] - center[1])
    if radius < SMALLEST_RING:
        return np.array([center])
    count = max(12, math.ceil(2.0 * math.pi * radius / SIDE))
    angle = math.atan2(rim[1] - center[1], rim[0] - center[0]) + np.linspace(
        0.0, 2.0 * math.pi, count + 1
    )
    around: Floats = np.column_stack([np.cos(angle), np.sin(angle)])
    return radius * around + center


def lay_path(stroke: Stroke, points: Sequence[Place] | Floats) -> Stroke:
    """Return a stroke with the whole path (k, 2), m, drawn and released."""
    places = np.asarray(points, np.float64).reshape(-1, 2).tolist()
    samples = tuple(replace(stroke.samples[0], x=x, y=y) for x, y in places)
    return replace(stroke, samples=samples, held=False)
