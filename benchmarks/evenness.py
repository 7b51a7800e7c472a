"""Measures of a relief along the strokes that formed it: how even it is, and its spikes; no Blender."""

import math
from dataclasses import replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.model.layout import Grid
from digiclay.recorded.pointer_strokes import PointerStroke
from digiclay.strokes.stroke import lay_ring

from .intended import find_distance

#: Parts of the flat top, and of the slope, between which a section is straight.
PARTS = (3, 6)


def measure_distances(stroke: PointerStroke, grid: Grid) -> Floats:
    """Return how far pins are from the path of a stroke, or its nearest mirror image, (n,), m."""
    path = np.array([move[1:] for move in stroke.moves])
    if stroke.path != "free":
        path = lay_ring(path[0], path[-1]) if stroke.path == "ring" else path[[0, -1]]
    paths = [[image.place(x, y) for x, y in path.tolist()] for image in stroke.images]
    return np.asarray(np.min([find_distance(one, grid.x, grid.y) for one in paths], axis=0))


def measure_unevenness(height: Floats, near: Floats, blister: Blister) -> Floats:
    """Return how far pins (k,) differ, (k,), m, from the common section of those so far from a path, m."""
    flat, radius = blister.flat_radius, blister.radius
    knots = np.concatenate([
        np.linspace(0.0, flat, PARTS[0], endpoint=False), np.linspace(flat, radius, PARTS[1]),
        [max(2.0 * radius - flat, near.max() * (1.0 + 1e-9))],
    ])  # fmt: skip
    hats = np.array([np.interp(near, knots, row) for row in np.eye(len(knots))]).T
    return np.asarray(height - hats @ np.linalg.lstsq(hats, height, rcond=None)[0])


def find_unevenness(
    height: Floats, strokes: tuple[PointerStroke, ...], grid: Grid, blisters: tuple[Blister, ...]
) -> Floats:
    """Return `measure_unevenness` of the pins at just one stroke that raises or lowers, (k,), m."""
    near = np.array([measure_distances(stroke, grid) for stroke in strokes])
    reach = np.array([[blister.radius + grid.layout.pitch] for blister in blisters])
    alone, found = (near < reach).sum(axis=0) == 1, [np.zeros(1)]
    for stroke, row, (most,), blister in zip(strokes, near, reach, blisters, strict=True):
        cells = np.flatnonzero(alone & (row < most))
        if stroke.kind.has_amount and cells.size:
            found.append(measure_unevenness(height[cells], row[cells], blister))
    return np.concatenate(found)


def find_spikes(height: Floats, grid: Grid) -> Floats:
    """Return how far pins are above, or below, all their neighbors, (n,), m."""
    beside = np.append(height, np.nan)[grid.layout.find_neighbors(corners=True)]
    above = height - np.fmax.reduce(beside, axis=1)
    return np.asarray(np.maximum(above, np.fmin.reduce(beside, axis=1) - height).clip(0.0))


def move(
    strokes: tuple[PointerStroke, ...], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0),
    share: float = 1.0,
) -> tuple[PointerStroke, ...]:  # fmt: skip
    """Return strokes turned by an angle, rad, scaled, and shifted, m; depths and heights stay."""
    c, s, (x0, y0) = share * math.cos(angle), share * math.sin(angle), shift
    return tuple(
        replace(one, moves=tuple((t, c * x - s * y + x0, s * x + c * y + y0) for t, x, y in one.moves))
        for one in strokes
    )
