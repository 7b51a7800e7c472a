"""Paths of press strokes: stabilized, straight, round; no Blender."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..core.base.arrays import Floats
from .stroke import Stroke

Place = tuple[float, float]

#: How fast a path is gone along that no hand has drawn, m/s: half of the fastest drag.
EVEN_SPEED = 0.05
#: Longest side of the polygon that stands for a ring, m, and least radius of one.
SIDE, SMALLEST_RING = 1e-3, 0.5e-3


def pull(place: Place, mouse: Place, radius: float) -> Place:
    """Return where a place comes that the mouse pulls behind it on a string.

    `place`, `mouse` (float, float), m; `radius`: length of the string, m: while the mouse is nearer the place
    stays.
    """
    away = math.hypot(mouse[0] - place[0], mouse[1] - place[1])
    if away <= radius:
        return place
    share = (away - radius) / away
    return place[0] + share * (mouse[0] - place[0]), place[1] + share * (mouse[1] - place[1])


def lay_line(start: Place, end: Place) -> Floats:
    """Return the ends of a line, (2, 2), m. `start`, `end` (float, float), m."""
    return np.array([start, end])


def lay_ring(center: Place, rim: Place) -> Floats:
    """Return a closed polygon for the circle about a place through another, (k, 2), m.

    `center`, `rim` (float, float), m. It begins and ends at the rim; one without a radius is its center
    alone.
    """
    radius = math.hypot(rim[0] - center[0], rim[1] - center[1])
    if radius < SMALLEST_RING:
        return np.array([center])
    count = max(12, math.ceil(2.0 * math.pi * radius / SIDE))
    angle = math.atan2(rim[1] - center[1], rim[0] - center[0]) + np.linspace(0.0, 2.0 * math.pi, count + 1)
    around: Floats = np.column_stack([np.cos(angle), np.sin(angle)])
    return radius * around + center


def lay_path(stroke: Stroke, points: Sequence[Place] | Floats) -> Stroke:
    """Return a stroke whose path is drawn already, evenly, and let go.

    `stroke`: all its places are pressed like its first; `points` (float, float), m; at least one.
    """
    places = np.asarray(points, np.float64).reshape(-1, 2)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(steps)]) / EVEN_SPEED
    first = stroke.samples[0]
    samples = (
        replace(first, time=float(time), x=float(x), y=float(y))
        for time, (x, y) in zip(times, places, strict=True)
    )
    return replace(stroke, samples=tuple(samples), held=False)
