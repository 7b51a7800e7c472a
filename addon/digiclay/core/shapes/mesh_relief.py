"""Mesh as a shape: its top surface by rays along the axes of the pins, holes filled."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Flags, Floats, Indices
from ..mesh_io.mesh_limits import CORNERS, LARGEST, make_refusal
from ..model.layout import RELATIVE_TOLERANCE, Grid
from ..surface.regions import label_components
from .request import UPWARDS, Placement, Tops

#: A hole is small if no more than this share of the covered pins stands under it.
SMALL = 0.05
#: How often the heights over holes are evened out, after they have been reached from all sides.
ROUNDS = 300


def fill_holes(grid: Grid, value: Floats, missing: Flags) -> tuple[Floats, Flags]:
    """Return the values (n,) with those over small holes taken from around, and which pins these are."""
    # A hole is a group of neighboring pins that the surface misses, with pins under the surface all around: a
    # group that reaches the rim of the bed is what lies beside the shape.
    beside = grid.layout.find_neighbors(corners=False)
    number = np.flatnonzero(missing)
    position = np.full(grid.count + 1, -1)  # the last one, at -1, stands for what is beyond the rim
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
    """Return the values with those in holes between those around: first ring by ring, then evened out."""
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


#: Pairs of a ray and a triangle that are worked on at a time.
CHUNK = 2_000_000
#: A pin that is over no triangle is over one it is beside by this share of a pitch at most: files round to
#: float32 or to six digits, which moves the rim by up to a micrometer, and no pin is placed as exactly.
EDGE = 1e-3
#: Faces of a mesh are turned outwards if more than this share of the pins sees an upper side.
UPPER = 0.8
#: Two hits of a ray are one when they are closer than this share of the mesh's height.
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
        return np.asarray(self.vertices[self.faces.ravel()])

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
        # One number an edge, whichever way it runs.
        edges = np.minimum(start, end) * len(self.vertices) + np.maximum(start, end)
        _, count = np.unique(edges[start != end], return_counts=True)
        return bool(np.all(count == 2))

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return the highest hit of each pin's ray, and where it passes through more than one layer."""
        none = np.empty(0, np.bool_)
        hits = [*self._hits(grid, at), (np.empty(0, np.intp), np.empty(0), none, none)]
        cell, z, over, up = (np.concatenate(parts) for parts in zip(*hits, strict=True))
        hit = np.zeros(grid.count, np.bool_)
        hit[cell[over]] = True
        used = over | ~hit[cell]  # what a ray closely passes counts where it hits nothing
        cell, z, up = cell[used], z[used], up[used]
        order = np.lexsort((up, z, cell))
        cell, z, up = cell[order], z[order], up[order]
        value, covered = np.zeros(grid.count), np.zeros(grid.count, np.bool_)
        last = np.append(cell[1:] != cell[:-1], True)[: cell.size]
        value[cell[last]], covered[cell[last]] = z[last], True
        same = SAME * float(np.ptp(self.used[:, 2]))
        new = np.append(True, (cell[1:] != cell[:-1]) | (np.diff(z) > same))[: cell.size]
        layers = np.bincount(cell[new], minlength=grid.count)
        # A closed mesh is passed through once, from its top to its underside; an open one is hit once.
        overhang = layers > (2 if self.closed else 1)
        if self.closed:
            return Tops(value, covered, overhang)
        missing = ~covered
        if np.count_nonzero(up[last]) > UPPER * np.count_nonzero(last):
            # Seen from below: through a hole, on the inside of what lies under it.
            missing[cell[last]] |= ~up[last]
        value, hole = fill_holes(grid, value, missing)
        return Tops(value, covered | hole, overhang & ~hole, int(np.count_nonzero(hole)))

    def _hits(self, grid: Grid, at: Placement) -> Iterator[tuple[NDArray[np.intp], Floats, Flags, Flags]]:
        """Give cells whose rays hit or closely pass a triangle: height, whether it is hit, and from above."""
        plan = self.vertices[:, :2] * (at.factor_x, at.factor_y) + (at.x, at.y)
        corners, z = plan[self.faces], self.vertices[self.faces, 2]
        sides = corners[:, 1:] - corners[:, :1]
        area = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
        size = np.abs(sides).max(axis=(1, 2))
        slack = EDGE * min(grid.layout.pitch, grid.layout.row_spacing)
        low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
        first_row, last_row, first, last = _window(grid, low, high)
        rows, columns = np.maximum(last_row - first_row + 1, 0), np.maximum(last - first + 1, 0)
        # A triangle on edge covers no pin; its neighbors have the same edges.
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
            one, two = (dx * by - dy * bx) / area[face], (ax * dy - ay * dx) / area[face]
            over = (np.minimum(one, two) >= -RELATIVE_TOLERANCE) & (one + two <= 1.0 + RELATIVE_TOLERANCE)
            # Beside an edge the triangle is as high as on it, however steep it is.
            one, two = np.maximum(one, 0.0), np.maximum(two, 0.0)
            whole = np.maximum(one + two, 1.0)
            one, two = one / whole, two / whole
            near = np.hypot(dx - one * ax - two * bx, dy - one * ay - two * by) <= slack
            cell, over, face, one, two = (part[near] for part in (cell, over, face, one, two))
            z0, z1, z2 = z[face].T
            height = z0 + one * (z1 - z0) + two * (z2 - z0)
            yield cell, height, over, area[face] > 0.0


def _merged(vertices: Floats) -> Indices:
    """Return a number for each vertex, the same for those at the same place, as in an STL."""
    order = np.lexsort(vertices.T)
    placed = vertices[order]
    number = np.empty(len(vertices), np.int64)
    number[order] = np.cumsum(np.append(False, np.any(placed[1:] != placed[:-1], axis=1)))
    return number


def _window(grid: Grid, low: Floats, high: Floats) -> tuple[Indices, Indices, Indices, Indices]:
    """Return the first and last rows and columns of the pins that lie in boxes (f, 2), m."""
    plan, (left, bottom) = grid.layout, grid.corner

    first_row = np.ceil((low[:, 1] - bottom) / plan.row_spacing).clip(0, plan.rows)
    last_row = np.floor((high[:, 1] - bottom) / plan.row_spacing).clip(-1, plan.rows - 1)
    first = np.ceil((low[:, 0] - left - plan.shift) / plan.pitch).clip(0, plan.columns)
    last = np.floor((high[:, 0] - left) / plan.pitch).clip(-1, plan.columns - 1)
    first_row, last_row, first, last = np.stack([first_row, last_row, first, last]).astype(np.int64)
    return first_row, last_row, first, last


def make_shape_mesh(name: str, vertices: Floats, faces: Indices, up: str, length: float) -> ShapeMesh:
    """Make a shape of vertices (v, 3), `length` meters a unit, and faces (f, 3); `up`: a key of UPWARDS."""
    place, corners = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if place.ndim != 2 or place.shape[1:] != (3,) or corners.ndim != 2 or not corners.size:
        raise make_refusal("must hold a surface made of faces", name, "no face")
    if corners.min() < 0 or corners.max() >= len(place):
        raise make_refusal(CORNERS, name, f"corner {corners.max()} of {len(place)}")
    bad = np.flatnonzero(~(np.abs(place) <= LARGEST).all(axis=1))
    if bad.size:
        shown = ", ".join(f"{value:g}" for value in place[bad[0]])
        rule = f"must have vertices that are finite numbers, of at most {LARGEST:g}"
        raise make_refusal(rule, name, f"vertex {bad[0]} at {shown}")
    axes, signs = UPWARDS[up]
    return ShapeMesh(name, place[:, axes] * signs, corners, length)
