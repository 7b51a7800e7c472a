"""Primitive shapes of the device's parts as vertices and faces; numpy only, no Blender."""

import math
from collections.abc import Sequence

import numpy as np

from ..core.base.arrays import Floats

#: Vertices (k, 3) and faces (tuples of vertex indices, counter-clockwise from outside).
Shape = tuple[Floats, list[tuple[int, ...]]]


def loft(rings: Sequence[Floats], first: bool = False, last: bool = False) -> Shape:
    """Join rings of points, each going round counter-clockwise seen from above, bottom to top."""
    starts = np.cumsum([0] + [len(ring) for ring in rings])
    faces: list[tuple[int, ...]] = []
    for low, high, a, b in zip(starts, starts[1:], rings, rings[1:], strict=False):
        count = max(len(a), len(b))
        for i in range(count):
            j = (i + 1) % count
            if len(a) == 1:
                faces.append((int(low), int(high + j), int(high + i)))
            elif len(b) == 1:
                faces.append((int(low + i), int(low + j), int(high)))
            else:
                faces.append((int(low + i), int(low + j), int(high + j), int(high + i)))
    if first:
        faces.append(tuple(range(len(rings[0])))[::-1])
    if last:
        faces.append(tuple(range(int(starts[-2]), int(starts[-1]))))
    return np.concatenate(rings), faces


def _revolve(profile: Sequence[tuple[float, float]], segments: int) -> Shape:
    """Turn a profile of (radius, z), bottom to top, about the z axis."""
    angle = np.arange(segments) * (2 * math.pi / segments)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(segments)])
    pole = circle[:1] * 0.0
    return loft(
        [(circle * radius if radius > 0.0 else pole) + [0.0, 0.0, z] for radius, z in profile]
    )


def rod(radius: float, length: float, segments: int = 24, dome: float = 0.4) -> Shape:
    """Return a pin, its top at the origin and its rod below, the cap a flat dome."""
    turns = np.linspace(0.0, math.pi / 2, 2 + segments // 4)
    cap = [(radius * math.cos(t), radius * dome * (math.sin(t) - 1.0)) for t in turns[:-1]]
    return _revolve([(radius, -length), *cap, (0.0, 0.0)], segments)


def ball(segments: int = 64) -> Shape:
    """Return the unit sphere."""
    turns = np.linspace(-math.pi / 2, math.pi / 2, segments // 2 + 1)[1:-1]
    return _revolve(
        [(0.0, -1.0), *((math.cos(t), math.sin(t)) for t in turns), (0.0, 1.0)], segments
    )


def arrow(radius: float, segments: int = 16) -> Shape:
    """Return an arrow of length 1 that points down and ends at the origin, its head of a radius."""
    shaft = 0.4 * radius
    return _revolve([(0.0, 0.0), (radius, 0.3), (shaft, 0.3), (shaft, 1.0), (0.0, 1.0)], segments)


def housing(
    half: tuple[float, float], wall: float, bottom: float, deck: float, rim: float
) -> Shape:
    """Return an open box with rounded corners: the case the pins stand in."""
    bevel = 0.22 * wall
    round_edge = [
        (bevel * (1.0 - math.sin(t)), rim + bevel * (math.cos(t) - 1.0))
        for t in np.linspace(0, math.pi / 2, 5)
    ]
    outside = [_ring(half, wall - inset, z) for inset, z in reversed(round_edge)]
    inside = [_ring(half, inset, z) for inset, z in round_edge]
    return loft(
        [_ring(half, wall, bottom), *outside, *inside, _ring(half, 0.0, deck)],
        first=True,
        last=True,
    )


def _ring(half: tuple[float, float], grow: float, z: float, steps: int = 9) -> Floats:
    """Return a rounded rectangle, its inner corner radius a part of the smaller side."""
    radius = 0.04 * min(half)
    quarter = np.linspace(0.0, math.pi / 2, steps)
    turns = np.concatenate([quarter + corner * math.pi / 2 for corner in range(4)])
    middle = np.repeat([[1, 1], [-1, 1], [-1, -1], [1, -1]], steps, axis=0) * (
        np.array(half) - radius
    )
    xy = middle + (radius + grow) * np.column_stack([np.cos(turns), np.sin(turns)])
    return np.column_stack([xy, np.full(len(xy), z)])
