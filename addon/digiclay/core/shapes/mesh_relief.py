"""Mesh as a shape: its top surface by rays along the axes of the pins, holes filled."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Flags, Floats, Indices
from ..mesh_io.mesh_limits import CORNERS, LARGEST, make_refusal
from ..mesh_io.obj_reader import turn_up
from ..model.layout import RELATIVE_TOLERANCE, Grid
from ..surface.regions import label_components
from .request import Placement, Tops

#: A hole is small if no more than this share of the covered pins stands under it.
SMALL = 0.05
#: Rounds of averaging the heights over holes, after these are filled from all sides.
ROUNDS = 300


def fill_holes(grid: Grid, value: Floats, missing: Flags) -> tuple[Floats, Flags]:
    """Return the values (n,), those over small holes interpolated from around, and which pins these are."""
    # A hole is a group of neighboring pins that the surface misses, surrounded by pins under the
    # surface: a group that reaches the rim of the bed is beside the shape.
    beside = grid.layout.find_neighbors(corners=False)
    number = np.flatnonzero(missing)
    position = np.full(grid.count + 1, -1)  # the last one, at -1, is beyond the rim
    position[number] = np.arange(number.size)
    joined = position[beside[number]]
    start = np.repeat(np.arange(number.size), joined.shape[1])
    edges = np.column_stack([start, joined.ravel()])[joined.ravel() >= 0]
    group = label_components(number.size, edges)
    size = np.bincount(group, minlength=number.size)
    at_rim = np.zeros(number.size, np.bool_)
    at_rim[group[(beside[number] < 0).any(axis=1)]] = True
    small = (size <= SMALL * (grid.count - number.size)) & ~at_rim
    hole = np.zeros(grid.count, np.bool_)
    hole[number[small[group]]] = True
    return _evened(value, hole, beside), hole


def _evened(value: Floats, hole: Flags, beside: Cells) -> Floats:
    """Return the values, those in holes filled from around: ring by ring, then averaged."""
    filled, waiting = value.copy(), hole.copy()
    while waiting.any():
        cells = np.flatnonzero(waiting)
        valid = ~waiting[beside[cells]]  # a hole has no neighbor beyond the rim
        ring = valid.any(axis=1)
        sums = np.where(valid, filled[beside[cells]], 0.0).sum(axis=1)
        filled[cells[ring]] = sums[ring] / valid.sum(axis=1)[ring]
        waiting[cells[ring]] = False
    cells = np.flatnonzero(hole)
    for _ in range(ROUNDS if cells.size else 0):
        filled[cells] = filled[beside[cells]].mean(axis=1)
    return filled


#: Pairs of a ray and a triangle that are computed at a time.
CHUNK = 2_000_000
#: A pin over no triangle belongs to one that is at most this share of a pitch away: files round to
#: float32 or to six digits, which moves the rim by up to a micrometer, and no pin is positioned so
#: exactly.
EDGE = 1e-3
#: Faces of a mesh count as oriented outwards if more than this share of the pins sees an upper
#: side.
UPPER = 0.8
#: Hits of a ray closer than this share of the mesh's height count as one.
SAME = 1e-5


@dataclass(frozen=True, eq=False)
class ShapeMesh:
    """Triangles with z up."""

    name: str
    vertices: Floats
    """(v, 3): In the file's unit."""
    faces: Indices
    """(f, 3)."""
    length: float
    """Meters in that unit."""

    @property
    def value_length(self) -> float:
        """Meters in the unit of the heights."""
        return self.length

    @cached_property
    def used(self) -> Floats:
        """The corners of the triangles, shape (3 f, 3)."""
        return self.vertices[self.faces.ravel()]

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The plan."""
        (left, front), (right, back) = self.used[:, :2].min(axis=0), self.used[:, :2].max(axis=0)
        return float(left), float(front), float(right), float(back)

    @property
    def underside(self) -> float:
        """The lowest point."""
        return float(self.used[:, 2].min())

    @cached_property
    def closed(self) -> bool:
        """Whether every edge belongs to two triangles: the mesh has an inside."""
        corners = _merged(self.vertices)[self.faces]
        start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
        # One number per edge, in either direction.
        edges = np.minimum(start, end) * len(self.vertices) + np.maximum(start, end)
        _, count = np.unique(edges[start != end], return_counts=True)
        return bool(np.all(count == 2))

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return the highest hit of each pin's ray, and where it passes through more than one layer."""
        none = np.empty(0, np.bool_)
        hits = [*self.hits(grid, at), (np.empty(0, np.intp), np.empty(0), none, none)]
        cell, z, over, up = (np.concatenate(parts) for parts in zip(*hits, strict=True))
        hit = np.zeros(grid.count, np.bool_)
        hit[cell[over]] = True
        used = over | ~hit[cell]  # a triangle that a ray narrowly misses counts if it hits none
        cell, z, up = cell[used], z[used], up[used]
        order = np.lexsort((up, z, cell))
        cell, z, up = cell[order], z[order], up[order]
        value, covered = np.zeros(grid.count), np.zeros(grid.count, np.bool_)
        last = np.append(cell[1:] != cell[:-1], True)[: cell.size]
        value[cell[last]], covered[cell[last]] = z[last], True
        same = SAME * float(np.ptp(self.used[:, 2]))
        new = np.append(True, (cell[1:] != cell[:-1]) | (np.diff(z) > same))[: cell.size]
        layers = np.bincount(cell[new], minlength=grid.count)
        # A ray enters a closed mesh at its top and leaves it at its underside; it hits an open one
        # once.
        overhang = layers > (2 if self.closed else 1)
        if self.closed:
            return Tops(value, covered, overhang)
        missing = ~covered
        if np.count_nonzero(up[last]) > UPPER * np.count_nonzero(last):
            # A hit from below: the ray passed a hole and hit the inside of the surface under it.
            missing[cell[last]] |= ~up[last]
        value, hole = fill_holes(grid, value, missing)
        return Tops(value, covered | hole, overhang & ~hole, int(np.count_nonzero(hole)))

    def hits(
        self, grid: Grid, at: Placement
    ) -> Iterator[tuple[NDArray[np.intp], Floats, Flags, Flags]]:
        """Yield cells whose rays hit or narrowly miss a triangle: height, whether hit, whether from above."""
        plan = self.vertices[:, :2] * (at.factor_x, at.factor_y) + (at.x, at.y)
        corners, z = plan[self.faces], self.vertices[self.faces, 2]
        sides = corners[:, 1:] - corners[:, :1]
        area = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
        size = np.abs(sides).max(axis=(1, 2))
        slack = EDGE * min(grid.layout.pitch, grid.layout.row_spacing)
        low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
        first_row, last_row, first, last = _window(grid, low, high)
        rows, columns = np.maximum(last_row - first_row + 1, 0), np.maximum(last - first + 1, 0)
        # A vertical triangle covers no pin; its neighbors have the same edges.
        candidates = np.where(np.abs(area) > 1e-12 * size * size, rows * columns, 0)
        flat = np.flatnonzero(candidates)
        cuts = np.cumsum(candidates[flat]) // CHUNK
        for part in np.split(flat, np.flatnonzero(np.diff(cuts)) + 1):
            count = candidates[part]
            face = np.repeat(part, count)
            k = np.arange(face.size) - np.repeat(np.cumsum(count) - count, count)
            row, column = first_row[face] + k // columns[face], first[face] + k % columns[face]
            cell = (row * grid.layout.columns + column).astype(np.intp)
            dx, dy = grid.x[cell] - corners[face, 0, 0], grid.y[cell] - corners[face, 0, 1]
            (ax, ay), (bx, by) = sides[face, 0].T, sides[face, 1].T
            u, v = (dx * by - dy * bx) / area[face], (ax * dy - ay * dx) / area[face]
            over = (np.minimum(u, v) >= -RELATIVE_TOLERANCE) & (u + v <= 1.0 + RELATIVE_TOLERANCE)
            # Beside an edge the height is that on the edge, however steep the triangle is.
            u, v = np.maximum(u, 0.0), np.maximum(v, 0.0)
            whole = np.maximum(u + v, 1.0)
            u, v = u / whole, v / whole
            near = np.hypot(dx - u * ax - v * bx, dy - u * ay - v * by) <= slack
            cell, over, face, u, v = (part[near] for part in (cell, over, face, u, v))
            z0, z1, z2 = z[face].T
            height = z0 + u * (z1 - z0) + v * (z2 - z0)
            yield cell, height, over, area[face] > 0.0


def _merged(vertices: Floats) -> Indices:
    """Return a number for each vertex; those at the same position, as in an STL, have the same."""
    order = np.lexsort(vertices.T)
    placed = vertices[order]
    number = np.empty(len(vertices), np.int64)
    number[order] = np.cumsum(np.append(False, np.any(placed[1:] != placed[:-1], axis=1)))
    return number


def _window(grid: Grid, low: Floats, high: Floats) -> tuple[Indices, Indices, Indices, Indices]:
    """Return the first and last rows and columns of the pins in boxes (f, 2), m."""
    plan, (left, bottom) = grid.layout, grid.corner
    first_row = np.ceil((low[:, 1] - bottom) / plan.row_spacing).clip(0, plan.rows)
    last_row = np.floor((high[:, 1] - bottom) / plan.row_spacing).clip(-1, plan.rows - 1)
    first = np.ceil((low[:, 0] - left - plan.shift) / plan.pitch).clip(0, plan.columns)
    last = np.floor((high[:, 0] - left) / plan.pitch).clip(-1, plan.columns - 1)
    first_row, last_row, first, last = np.stack([first_row, last_row, first, last]).astype(np.int64)
    return first_row, last_row, first, last


def make_shape_mesh(
    name: str, vertices: Floats, faces: Indices, up: str, length: float
) -> ShapeMesh:
    """Make a shape of vertices (v, 3), `length` meters per unit, and faces (f, 3); `up`: a key of UPWARDS."""
    points, corners = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if points.ndim != 2 or points.shape[1:] != (3,) or corners.ndim != 2 or not corners.size:
        raise make_refusal("must hold a surface made of faces", name, "no face")
    if corners.min() < 0 or corners.max() >= len(points):
        raise make_refusal(CORNERS, name, f"corner {corners.max()} of {len(points)}")
    bad = np.flatnonzero(~(np.abs(points) <= LARGEST).all(axis=1))
    if bad.size:
        shown = ", ".join(f"{value:g}" for value in points[bad[0]])
        rule = f"must have vertices that are finite numbers, of at most {LARGEST:g}"
        raise make_refusal(rule, name, f"vertex {bad[0]} at {shown}")
    return ShapeMesh(name, turn_up(points, up), corners, length)
