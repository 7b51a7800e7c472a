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

from ..base.arrays import Array, Cells, Flags, Floats
from ..base.errors import ParameterError
from .layout import Grid, Layout

#: Farthest vertex of a mesh, m.
LARGEST = 1e6
#: Distance from an edge within which a sample point is on it, in distances of sample points:
#: rounding must not open a gap between two triangles.
ON_EDGE = 1e-9
#: Thickness of a mesh, as a share of its length, below which it is flat.
THIN = 1e-6
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


def refuse_flat(mesh: Mesh, name: str, field: str = "mesh") -> None:
    """Refuse a mesh all of whose triangles are in a plane, or on a line; `field`: where it is from."""
    used = np.zeros(len(mesh.vertices), np.bool_)
    used[mesh.triangles] = True
    low, _, high = np.sqrt(np.abs(np.linalg.eigvalsh(np.cov(mesh.vertices[used].T))))
    if low < THIN * high:
        raise ParameterError(name, field, "must have a thickness", "a flat mesh")


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
    plan, count = grid.layout, samples if tip_radius > 0.0 else 1
    order = np.argsort(points[:, 1])
    places = _scale(points[order], grid, count)
    corners = _sort_corners(triangles, order, points[:, 2] < ceiling)
    corners = _add_sides_of_walls(corners, places[1])

    drop = _measure_end(plan, count, tip_radius)
    under = np.full(grid.count, np.inf)
    lowest, _, highest = places[1][corners]
    for triangle, row in _list_between(lowest, highest, plan.rows * count):
        shift = row // count % 2 * (plan.shift / plan.pitch * count)
        chord = _cut_triangles(places, corners[:, triangle], row, shift)
        left, right = np.minimum(chord.start, chord.end), np.maximum(chord.start, chord.end)
        for index, column in _list_between(left, right, plan.columns * count):
            height, line = chord.find_height(index, column), row[index]
            if count > 1:
                height += drop[line % count, column % count]
            np.minimum.at(under, line // count * plan.columns + column // count, height)
    return np.where(under < ceiling, under, np.inf)


def _measure_end(plan: Layout, count: int, radius: float) -> Floats:
    """Return how far below its axis the end of a pin is at its sample points, (count, count), m."""
    side = (np.arange(count) - count // 2) / count
    square = (side[:, None] * plan.row_spacing) ** 2 + (side * plan.pitch) ** 2
    return square / (2.0 * radius or 1.0)


def _scale(points: Floats, grid: Grid, count: int) -> Floats:
    """Return points (v, 3), m, as (3, v): x and y in distances of sample points from the first one."""
    plan, middle, (left, bottom) = grid.layout, count // 2, grid.corner
    x = (points[:, 0] - left) * (count / plan.pitch) + middle
    y = (points[:, 1] - bottom) * (count / plan.row_spacing) + middle
    return np.stack([x, y, points[:, 2]])


def _sort_corners(triangles: Array, order: Cells, near: Flags) -> Cells:
    """Return the triangles (3, t) with a vertex that is `near`, their corners as the `order` has them."""
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    a, b, c = np.ascontiguousarray(triangles.T)
    some = np.flatnonzero(near[a] | near[b] | near[c])
    a, b, c = rank[a[some]], rank[b[some]], rank[c[some]]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    return np.stack([low, a + b + c - low - high, high])


def _add_sides_of_walls(corners: Cells, y: Floats) -> Cells:
    """Return triangles, and of each wall along the rows, which has no two cuts with one, its three sides."""
    low, _, high = y[corners]
    walls = corners[:, high - low <= 2.0 * ON_EDGE]
    if not walls.size:
        return corners
    sides = (walls[side] for side in ([0, 1, 1], [1, 2, 2], [0, 2, 2]))
    return np.concatenate([corners, *sides], axis=1)


class _Chord(NamedTuple):
    """Cuts of k rows with triangles, each (k,)."""

    start: Floats
    end: Floats
    """x in distances of sample points."""
    height: Floats
    """At the start, m."""
    rise: Floats
    """From there to the end, m."""
    slope: Floats
    """Share of the rise per sample point."""

    def find_height(self, index: Cells, column: Cells) -> Floats:
        """Return the heights of cuts at columns, m."""
        share = ((column - self.start[index]) * self.slope[index]).clip(0.0, 1.0)
        return self.height[index] + share * self.rise[index]


def _cut_triangles(places: Floats, corners: Cells, row: Cells, shift: Floats) -> _Chord:
    """Return the cuts of rows (k,) with triangles (3, k); `shift`: of the rows along x."""
    first, second, last = corners
    # A row cuts the side from the lowest to the highest corner, and one of the others.
    upper = row > places[1][second] - ON_EDGE
    start, height = _cut_sides(places, first, last, row)
    end, top = _cut_sides(
        places, np.where(upper, second, first), np.where(upper, last, second), row
    )
    wide = np.abs(end - start) > 2.0 * ON_EDGE
    height = np.where(wide, height, np.minimum(height, top))  # along a wall the lowest
    slope = np.divide(1.0, end - start, out=np.zeros_like(start), where=wide)
    return _Chord(start - shift, end - shift, height, top - height, slope)


def _cut_sides(places: Floats, start: Cells, end: Cells, row: Cells) -> tuple[Floats, Floats]:
    """Return x and z at which rows cut sides of triangles; of a side along the row its start."""
    x, y, z = places
    run = y[end] - y[start]
    across = run > 2.0 * ON_EDGE
    share = np.divide(row - y[start], run, out=np.zeros_like(run), where=across).clip(0.0, 1.0)
    return x[start] + share * (x[end] - x[start]), z[start] + share * (z[end] - z[start])


def _list_between(low: Floats, high: Floats, limit: int) -> Iterator[tuple[Cells, Cells]]:
    """Yield, in parts, the index of a range and a whole number from `low` to `high` (k,), below `limit`."""
    first = np.ceil(low - ON_EDGE).clip(0, limit).astype(np.intp)
    count = np.floor(high + ON_EDGE).clip(-1, limit - 1).astype(np.intp) - first + 1
    some = np.flatnonzero(count > 0)
    first, count = first[some], count[some]
    ends = np.cumsum(count)
    begins = ends - count
    for part in np.split(np.arange(some.size), np.flatnonzero(np.diff(ends // CHUNK)) + 1):
        if part.size:
            index = np.repeat(part, count[part])
            number = np.arange(begins[part[0]], ends[part[-1]])
            yield some[index], number - np.repeat((begins - first)[part], count[part])
