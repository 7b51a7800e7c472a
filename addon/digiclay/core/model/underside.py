"""Underside of any mesh over the pins of a bed.

Each triangle is cut along the rows of sample points; its z at the sample points between the two cuts
is interpolated, and the lowest z is kept. So no slope is too steep, and the sides of triangles do not
matter: a mesh may be open, flipped or cross itself.

    body = check_mesh(vertices, triangles)              # once
    under = rasterize(posed, body.triangles, grid)      # at each instant; vertices in the bed's axes
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Array, Cells, Floats
from ..base.errors import ParameterError
from .layout import Grid

#: Farthest vertex of a mesh, m.
LARGEST = 1e6
#: Distance from an edge within which a sample point is on it, in distances of sample points:
#: rounding must not open a gap between two triangles.
ON_EDGE = 1e-9
#: Sample points that are computed at a time: few enough for the processor's cache.
CHUNK = 30_000
#: Most samples along a pitch.
MOST_SAMPLES = 99


class Mesh(NamedTuple):
    """Vertices (v, 3), m, and triangles (t, 3) of a body."""

    vertices: Floats
    triangles: Cells


def check_mesh(vertices: ArrayLike, triangles: ArrayLike, name: str = "body") -> Mesh:
    """Return a mesh that has a surface, or raise ParameterError; `name` is its owner in messages."""
    corners = np.asarray(triangles)
    if corners.size == 0 or corners.ndim != 2 or corners.shape[1] != 3:
        rule, shown = "must be triangles, three numbers of vertices each", f"shape {corners.shape}"
        raise ParameterError(name, "mesh", rule, shown if corners.size else "none")
    if corners.dtype.kind not in "iu":
        raise ParameterError(
            name, "mesh", "must have whole numbers of vertices", f"{corners.flat[0]!r}"
        )
    points = check_vertices(vertices, name)
    low, high = int(corners.min()), int(corners.max())
    if low < 0 or high >= len(points):
        rule = f"must have triangles of its vertices 0 to {len(points) - 1}"
        raise ParameterError(name, "mesh", rule, f"vertex {low if low < 0 else high}")
    corner = points[corners]
    sides = corner[:, 1:] - corner[:, :1]
    if not (np.abs(np.cross(sides[:, 0], sides[:, 1])) > ON_EDGE * np.abs(sides).max() ** 2).any():
        raise ParameterError(name, "mesh", "must have a surface", "triangles without area")
    return Mesh(points, corners.astype(np.intp))


def check_vertices(vertices: ArrayLike, name: str = "body") -> Floats:
    """Return vertices (v, 3), m, that are numbers near enough to calculate with, or raise ParameterError."""
    points = np.asarray(vertices, np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        rule = "must have vertices of three coordinates"
        raise ParameterError(name, "mesh", rule, f"shape {points.shape}")
    if not (np.abs(points) <= LARGEST).all():
        bad = int(np.flatnonzero(~(np.abs(points) <= LARGEST).all(axis=1))[0])
        shown = ", ".join(f"{value:g}" for value in points[bad])
        rule = f"must have vertices that are finite and at most {LARGEST:g} m away"
        raise ParameterError(name, "mesh", rule, f"vertex {bad} at {shown}")
    return points


def rasterize(
    vertices: Floats,
    triangles: Array,
    grid: Grid,
    samples: int = 1,
    tip_radius: float = 0.0,
    ceiling: float = np.inf,
) -> Floats:
    """Return the height at which the end of each pin meets a mesh that comes from above.

    Parameters
    ----------
    vertices : (v, 3)
        In the axes of the bed, m: z = 0 is a pin at its lowest.
    triangles : (t, 3)
        Numbers of vertices, of a mesh that `check_mesh` has checked.
    grid
        Pins in any arrangement.
    samples
        Sample points along a pitch, an odd number, of a rounded pin: what is narrower than their
        distance may slip through between them.
    tip_radius
        Radius of the end of a pin, m: a paraboloid as wide as the pitch, which a body beside the axis
        touches lower down. At 0 a pin is its axis, and has one sample point.
    ceiling
        Height, m, from which on nothing is computed: above all pins there is nothing to press.

    Returns
    -------
    (n,)
        Height, m, of the top of a pin that touches the mesh; inf where nothing is above the pin, or
        nothing below the ceiling.

    Raises
    ------
    ParameterError
        For vertices that are not finite.
    """
    points = check_vertices(vertices)
    count = samples if tip_radius > 0.0 else 1
    middle, plan, (left, bottom) = count // 2, grid.layout, grid.corner
    rows, columns = plan.rows * count, plan.columns * count
    shift = plan.shift / plan.pitch * count
    # How far below the axis the end of the pin is at each sample point.
    side = (np.arange(count) - middle) / count
    square = (side[:, None] * plan.row_spacing) ** 2 + (side * plan.pitch) ** 2
    drop = (square / (2.0 * tip_radius or 1.0)).ravel()

    # In distances of sample points, from the first one; vertices and corners by ascending y.
    order = np.argsort(points[:, 1])
    x = (points[order, 0] - left) * (count / plan.pitch) + middle
    y = (points[order, 1] - bottom) * (count / plan.row_spacing) + middle
    z = points[order, 2]
    rank = np.empty(len(order), np.intp)
    rank[order] = np.arange(len(order))
    near = points[:, 2] < ceiling
    a, b, c = np.ascontiguousarray(triangles.T)
    some = np.flatnonzero(near[a] | near[b] | near[c])
    a, b, c = rank[a[some]], rank[b[some]], rank[c[some]]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    mid = a + b + c - low - high
    # A wall along the rows, which has no two cuts with one: its three sides.
    wall = np.flatnonzero(y[high] - y[low] <= 2.0 * ON_EDGE)
    if wall.size:
        a, b, c = low[wall], mid[wall], high[wall]
        low = np.concatenate([low, a, b, a])
        mid, high = (np.concatenate([corner, b, c, c]) for corner in (mid, high))

    under = np.full(grid.count, np.inf)
    for triangle, row in _spread(y[low], y[high], rows):
        first, second, last = low[triangle], mid[triangle], high[triangle]
        # A row cuts the side from the lowest to the highest corner, and one of the others.
        upper = row > y[second] - ON_EDGE
        x0, z0 = _cut(x, y, z, first, last, row)
        x1, z1 = _cut(x, y, z, np.where(upper, second, first), np.where(upper, last, second), row)
        moved = row // count % 2 * shift
        wide = np.abs(x1 - x0) > 2.0 * ON_EDGE
        z0 = np.where(wide, z0, np.minimum(z0, z1))  # along a wall the lowest
        slope = np.divide(1.0, x1 - x0, out=np.zeros_like(x0), where=wide)
        x0, x1 = x0 - moved, x1 - moved
        for cut, column in _spread(np.minimum(x0, x1), np.maximum(x0, x1), columns):
            part = ((column - x0[cut]) * slope[cut]).clip(0.0, 1.0)
            height = z0[cut] + part * (z1 - z0)[cut]
            line = row[cut]
            cell = line // count * plan.columns + column // count
            if count > 1:
                height += drop[line % count * count + column % count]
            np.minimum.at(under, cell, height)
    return np.where(under < ceiling, under, np.inf)


def _cut(
    x: Floats, y: Floats, z: Floats, start: Cells, end: Cells, row: Cells
) -> tuple[Floats, Floats]:
    """Return x and z at which rows cut sides of triangles; of a side along the row its start."""
    run = y[end] - y[start]
    across = run > 2.0 * ON_EDGE
    part = np.divide(row - y[start], run, out=np.zeros_like(run), where=across).clip(0.0, 1.0)
    return x[start] + part * (x[end] - x[start]), z[start] + part * (z[end] - z[start])


def _spread(low: Floats, high: Floats, limit: int) -> Iterator[tuple[Cells, Cells]]:
    """Yield the whole numbers from `low` to `high` (k,), below `limit`, each with the index of its range."""
    first = np.ceil(low - ON_EDGE).clip(0, limit).astype(np.intp)
    count = np.floor(high + ON_EDGE).clip(-1, limit - 1).astype(np.intp) - first + 1
    some = np.flatnonzero(count > 0)
    first, count = first[some], count[some]
    ends = np.cumsum(count)
    for part in np.split(np.arange(some.size), np.flatnonzero(np.diff(ends // CHUNK)) + 1):
        if part.size:
            index = np.repeat(part, count[part])
            begin = ends[part] - count[part] - first[part]
            number = np.arange(ends[part[0]] - count[part[0]], ends[part[-1]])
            yield some[index], number - np.repeat(begin, count[part])
