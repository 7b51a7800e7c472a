"""Press stroke: the path that the hand draws, and how far the fingertip has come along it. No Blender."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from ..core.base.arrays import Floats
from .tracking import Tracking

#: Factors of x and y of a path and of its mirror images about the middle of the bed.
Mirror = tuple[float, float]

#: What the fingertip does: it waits for its turn, goes above the path's first place, presses there, rises
#: with the blister (if its brush has one), goes along the path, leaves it, waits above until what it has left
#: has settled; and the end.
WAITING, ABOVE, PRESSING, RISING, DRAGGING, LEAVING, SETTLING, DONE = range(8)
#: Paths of a stroke, by its symmetry. There is one finger: it goes along them one after the other.
SYMMETRIES: dict[str, tuple[Mirror, ...]] = {
    "NONE": ((1.0, 1.0),),
    "X": ((1.0, 1.0), (-1.0, 1.0)),
    "Y": ((1.0, 1.0), (1.0, -1.0)),
    "XY": ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)),
}
#: Deepest press, and least one, m; also the greatest and the least height of a raise.
DEEPEST, SHALLOWEST = 30e-3, 0.1e-3
#: Moves that come within this time of each other have waited together while Blender drew, s: their times are
#: spread over the time since the one before, of which no more than this is taken for drawing, s.
BURST, DRAWING = 4e-3, 1.0


class Brush(Enum):
    """Effect of a press stroke on the surface."""

    LOWER = "LOWER"
    RAISE = "RAISE"
    LEVEL = "LEVEL"
    SMOOTH = "SMOOTH"

    @property
    def inverse(self) -> Brush:
        """What Ctrl makes of it."""
        return {Brush.LOWER: Brush.RAISE, Brush.RAISE: Brush.LOWER}.get(self, self)

    @property
    def has_amount(self) -> bool:
        """Whether it has a depth or height, not a strength alone."""
        return self in (Brush.LOWER, Brush.RAISE)

    @property
    def needs_blister(self) -> bool:
        """Whether the blister of the device has to follow the fingertip."""
        return self in (Brush.RAISE, Brush.LEVEL)


@dataclass(frozen=True)
class Sample:
    """Point of a press stroke."""

    #: Since the mouse went down, s.
    time: float
    #: Place on the bed, m.
    x: float
    y: float
    #: How far below the surface, or above it where it is raised, m.
    depth: float
    #: Share of the way from the surface to the level, or strength of the smoothing, from 0 to 1.
    share: float = 1.0
    #: How far the fingertip leans towards x and y of the bed, rad; see `stroke_motion.lean_finger`.
    lean: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Stroke:
    """Press stroke, and the progress of the fingertip along it."""

    #: Tells the strokes of a session apart.
    number: int
    #: The path, at least one place, in the order of time.
    samples: tuple[Sample, ...]
    #: Whether the hand still draws.
    held: bool = True
    #: What the fingertip does.
    phase: int = WAITING
    #: Index of the sample the fingertip is at, or past.
    reached: int = 0
    #: Time since the fingertip came above the path's first place, s: simulated, or by the wall less `LATE`.
    clock: float = 0.0
    #: When it came there, by the wall, s.
    began: float = 0.0
    #: (n,), heights of the pins when the fingertip began, m; None before.
    height: Floats | None = None
    #: Factors of x and y: the path itself, then its mirror images.
    mirrors: tuple[Mirror, ...] = SYMMETRIES["NONE"]
    #: Index of the one that the fingertip is at.
    image: int = 0
    #: Up to when every move has come, s; what was drawn since may still wait in Blender's queue.
    known: float = 0.0
    #: When the last sample came, s.
    heard: float = 0.0
    #: Index of the first sample that came together with the last one.
    burst: int = 0
    brush: Brush = Brush.LOWER
    #: How the blister follows, of a brush that needs one; found when the fingertip begins.
    tracking: Tracking | None = None
    #: How fast the fingertip rises with the blister, m/s.
    climb: float = 0.0
    #: When a fingertip that smooths, or waits, came to the end of the path, s of `clock`.
    left: float = 0.0
    #: (4,), orientation of the fingertip when it began, which it has again when it is done; None before.
    turn: Floats | None = None

    @property
    def done(self) -> bool:
        """Whether the fingertip has gone along all of the path and left it."""
        return self.phase == DONE

    @property
    def ahead(self) -> tuple[Floats, ...]:
        """Places the fingertip has yet to come to, (k, 2), m: of the path it is at, and of those after it."""
        path = np.array([(sample.x, sample.y) for sample in self.samples])
        later = tuple(path * mirror for mirror in self.mirrors[self.image + 1 :])
        return (path[self.reached :] * self.mirrors[self.image], *later)

    def place(self, index: int) -> tuple[float, float]:
        """Return where a sample is on the path the fingertip is at, m."""
        (along, across), sample = self.mirrors[self.image], self.samples[index]
        return along * sample.x, across * sample.y


def start(
    number: int, x: float, y: float, depth: float, mirrors: tuple[Mirror, ...] = SYMMETRIES["NONE"],
    brush: Brush = Brush.LOWER, share: float = 1.0, lean: tuple[float, float] = (0.0, 0.0),
) -> Stroke:  # fmt: skip
    """Return the stroke of a mouse that goes down at a place, m; see `Sample`."""
    first = Sample(0.0, x, y, _limit_depth(depth), share, lean)
    return Stroke(number, (first,), mirrors=mirrors, brush=brush)


def draw(
    stroke: Stroke, time: float, x: float, y: float, depth: float, share: float = 1.0,
    lean: tuple[float, float] = (0.0, 0.0),
) -> Stroke:  # fmt: skip
    """Return the stroke drawn on to a place at a time of the hand, s; a released one stays as it is."""
    if not stroke.held:
        return stroke
    samples = (*stroke.samples, Sample(time, x, y, _limit_depth(depth), share, lean))
    together = time - stroke.heard < BURST and stroke.burst > 0
    first = stroke.burst if together else len(samples) - 1
    start = max(samples[first - 1].time, time - DRAWING)
    count = len(samples) - first
    spread = (
        replace(sample, time=start + (time - start) * (index + 1) / count)
        for index, sample in enumerate(samples[first:])
    )
    return replace(stroke, samples=(*samples[:first], *spread), heard=time, burst=first)


def deepen(stroke: Stroke, time: float, by: float) -> Stroke:
    """Return the stroke with its depth changed where it is, m, within the limits."""
    last = stroke.samples[-1]
    return draw(stroke, time, last.x, last.y, last.depth + by, last.share, last.lean)


def _limit_depth(depth: float) -> float:
    return min(max(depth, SHALLOWEST), DEEPEST)


Place = tuple[float, float]

#: How fast a path is gone along that no hand has drawn, m/s: half of the fastest drag.
EVEN_SPEED = 0.05
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


def lay_ring(center: Place, rim: Place) -> Floats:
    """Return a closed polygon (k, 2), m, for the circle about a place through another."""
    radius = math.hypot(rim[0] - center[0], rim[1] - center[1])
    if radius < SMALLEST_RING:
        return np.array([center])
    count = max(12, math.ceil(2.0 * math.pi * radius / SIDE))
    angle = math.atan2(rim[1] - center[1], rim[0] - center[0]) + np.linspace(0.0, 2.0 * math.pi, count + 1)
    around: Floats = np.column_stack([np.cos(angle), np.sin(angle)])
    return radius * around + center


def lay_path(stroke: Stroke, points: Sequence[Place] | Floats) -> Stroke:
    """Return a stroke with the whole path (k, 2), m, drawn evenly, and released."""
    places = np.asarray(points, np.float64).reshape(-1, 2)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(steps)]) / EVEN_SPEED
    first = stroke.samples[0]
    samples = (
        replace(first, time=float(time), x=float(x), y=float(y))
        for time, (x, y) in zip(times, places, strict=True)
    )
    return replace(stroke, samples=tuple(samples), held=False)
