"""Formed surface: a skin over the pin tops, and the closed solid under it.

The skin is structured. Between two neighboring rows every four pins, two of each row,
make a cell of the skin that is cut in two along one of its diagonals. Nothing but the
pins themselves decides which, so a mirrored or turned bed gives the mirrored or turned
solid:

1. The shorter diagonal in plan. In a staggered or hexagonal bed that is the zig-zag
   between the rows, the same for any heights; its outer edge is left as it is.
2. Both as long (an aligned bed): the one whose ends differ less in height, so that edges
   run along a ridge or crease and not across it.
3. Both as steep: the higher one. If they are as high too, the four pins are in one plane
   and both cuts are the same surface.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Faces, Floats
from ..base.errors import ParameterError

#: Material left under the lowest pin top unless a base is asked for, m. Enough for a
#: printed part to hold together, without 40 mm of plastic down to the bed's floor.
BASE_THICKNESS = 3e-3

#: Two diagonals are as long as each other when their squares agree to this fraction:
#: far above rounding, far below the smallest difference of an arrangement (staggered, 4/5).
SAME_LENGTH = 1e-6
#: Pins whose triangles are worked out at once, so that a large bed takes little more memory than its result.
BAND = 1 << 16


def find_grid_shape(position: ArrayLike) -> tuple[int, int]:
    """Return the rows and columns of pins at positions (n, 2), m, in order, or raise ParameterError."""
    place = _pins(position)
    if not len(place):
        raise ParameterError("Surface", "position", "must hold at least one pin", "none")
    spacing = float(np.hypot(*(place[1] - place[0]))) if len(place) > 1 else 1.0
    other_row = np.flatnonzero(np.abs(place[:, 1] - place[0, 1]) > 0.1 * spacing)
    columns = int(other_row[0]) if len(other_row) else len(place)
    if len(place) % columns:
        raise ParameterError("Surface", "position", f"must fill rows of {columns} pins", f"{len(place)} pins")
    return len(place) // columns, columns


def make_skin(position: ArrayLike, height: ArrayLike, rows: int, columns: int) -> Faces:
    """Return the triangles (f, 3) over pin tops (n,) at positions (n, 2), m, counter-clockwise from above."""
    place, top = check_heights(position, height, rows, columns)
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    clockwise = measure_areas(place, index[:2, :2].ravel()[None, :3])[0] < 0.0  # a mirrored bed
    faces = np.empty((rows - 1, 2 * (columns - 1), 3), np.int32)
    band = max(1, BAND // columns)
    for row in range(0, rows - 1, band):
        some = _triangles(place, top, index[row : row + band + 1])
        some = some[:, ::-1] if clockwise else some
        if not np.all(measure_areas(place, some) > 0.0):
            raise ParameterError("Surface", "position", "must order the pins row by row", "pins out of order")
        faces[row : row + band] = some.reshape(-1, 2 * (columns - 1), 3)
    return faces.reshape(-1, 3)


def _triangles(place: Floats, top: Floats, index: Faces) -> Faces:
    """Return the triangles between some rows of pins, two for every four of them."""
    # The corners of each cell, around it: a and c are the ends of one diagonal, b and d of the other.
    a, b, c, d = (part.ravel() for part in take_corners(index))
    along_ac = _cut_along_ac(place, top, a, b, c, d)
    return np.column_stack([a, b, np.where(along_ac, c, d), np.where(along_ac, a, b), c, d]).reshape(-1, 3)


def make_solid(
    position: ArrayLike, height: ArrayLike, rows: int, columns: int, base_thickness: float = BASE_THICKNESS
) -> tuple[Floats, Faces]:
    """Return vertices (2 n, 3), m, tops first, and faces of the solid over a base: skin, base, walls."""
    place, top = check_heights(position, height, rows, columns)
    level = find_base_level(top, base_thickness)
    over = make_skin(place, top, rows, columns)
    n, faced = len(place), len(over)
    vertices = np.empty((2 * n, 3))
    vertices[:n, :2] = vertices[n:, :2] = place
    vertices[:n, 2], vertices[n:, 2] = top, level
    start = take_outline(np.arange(n, dtype=np.int32).reshape(rows, columns))
    if measure_areas(place, np.array([[0, 1, columns]]))[0] < 0.0:
        start = start[::-1]
    end = np.roll(start, -1)
    walls = np.stack([end, start, start + n, end, start + n, end + n], axis=1).reshape(-1, 3)
    faces = np.empty((2 * faced + len(walls), 3), np.int32)
    faces[:faced], faces[2 * faced :] = over, walls
    np.add(over[:, ::-1], n, out=faces[faced : 2 * faced])
    return vertices, faces


def find_base_level(height: ArrayLike, base_thickness: float = BASE_THICKNESS) -> float:
    """Return the height of the flat base, m, `base_thickness` below the lowest of the pin tops."""
    if not (np.isfinite(base_thickness) and base_thickness > 0.0):
        thickness = f"{base_thickness * 1e3:.6g} mm"
        raise ParameterError("Surface", "base_thickness", "must be above 0 mm", thickness)
    return float(np.min(height)) - base_thickness


def _pins(position: ArrayLike) -> Floats:
    """Return `position` as an array, or refuse its shape or a number in it."""
    place = np.asarray(position, dtype=np.float64)
    if place.ndim != 2 or place.shape[1] != 2:
        raise ParameterError("Surface", "position", "must have two coordinates a pin", f"shape {place.shape}")
    if not np.all(np.isfinite(place)):
        raise ParameterError("Surface", "position", "must be finite", _first_bad(place.sum(axis=1)))
    return place


def check_heights(
    position: ArrayLike, height: ArrayLike, rows: int, columns: int, name: str = "height"
) -> tuple[Floats, Floats]:
    """Return positions (n, 2), m, and one value a pin as arrays, or refuse what cannot carry a skin."""
    if rows < 2 or columns < 2:
        rule = "must have 2 x 2 pins at least to carry a skin"
        raise ParameterError("Surface", "", rule, f"{rows} x {columns}")
    place, top = _pins(position), np.asarray(height, dtype=np.float64)
    if top.shape != (rows * columns,) or len(place) != rows * columns:
        rule = f"must have one value for each of the {rows} x {columns} pins"
        raise ParameterError("Surface", name, rule, f"{top.size} values at {len(place)} positions")
    if not np.all(np.isfinite(top)):
        raise ParameterError("Surface", name, "must be finite", _first_bad(top))
    return place, top


def _first_bad(values: Floats) -> str:
    """Name the first value that is not finite."""
    cell = int(np.flatnonzero(~np.isfinite(values))[0])
    return f"{values[cell]} at cell {cell}"


def _cut_along_ac(place: Floats, top: Floats, *corners: Faces) -> NDArray[np.bool_]:
    """Return the cells of the skin that are cut from a to c, and not from b to d (rules above)."""
    a, b, c, d = corners
    ac, bd = (np.sum((place[i] - place[j]) ** 2, axis=1) for i, j in ((a, c), (b, d)))
    steep_ac, steep_bd = np.abs(top[a] - top[c]), np.abs(top[b] - top[d])
    by_height = (steep_ac < steep_bd) | ((steep_ac == steep_bd) & (top[a] + top[c] >= top[b] + top[d]))
    return np.where(np.abs(ac - bd) <= SAME_LENGTH * (ac + bd), by_height, ac < bd)


def measure_areas(place: Floats, faces: Faces) -> Floats:
    """Return the area of each triangle seen from above, m²; negative when it runs clockwise."""
    a, b, c = (place[faces[:, corner]] for corner in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def take_corners(table: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return the four corners, around it, of each cell between the rows and columns of a table."""
    return table[:-1, :-1], table[:-1, 1:], table[1:, 1:], table[1:, :-1]


def take_outline(table: Faces) -> Faces:
    """Return the outer values: along the first row, up the last column, back, and down the first."""
    return np.concatenate([table[0, :-1], table[:-1, -1], table[-1, :0:-1], table[:0:-1, 0]])
