"""Formed surface: the pins now and before, the skin over their tops, and bodies such as the solid under it.

The skin is structured. Between two neighboring rows every four pins, two of each row,
make a cell of the skin that is cut in two along one of its diagonals. The pins alone
decide which, so that a mirrored or turned bed gives the mirrored or turned solid:

1. The shorter diagonal in plan. In a staggered or hexagonal bed that is the zig-zag
   between the rows, the same for any heights; its outer edge is left as it is.
2. Both as long (an aligned bed): the one whose ends differ less in height, so that edges
   run along a ridge or crease and not across it.
3. Both as steep: the higher one. If they are as high too, the four pins are in one plane
   and both cuts are the same surface.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import TIE, Array, Faces, Flags, Floats, Indices
from ..base.errors import OutputError, ParameterError
from ..model.layout import find_grid_shape, find_neighbors, name_first_bad, read_places

#: Material left under the lowest pin top unless a base is asked for, m. Enough for a
#: printed part to hold together, without 40 mm of plastic down to the bed's floor.
BASE_THICKNESS = 3e-3

#: Two diagonals are equally long when their squares agree to this fraction: far above
#: rounding, far below the smallest difference of an arrangement (staggered, 4/5).
SAME_LENGTH = 1e-6
#: Pins whose triangles are computed at once, so that a large bed takes little more memory than its
#: result.
BAND = 1 << 16


def make_skin(position: ArrayLike, height: ArrayLike, rows: int, columns: int) -> Faces:
    """Return the triangles (f, 3) over pin tops (n,) at positions (n, 2), m, counter-clockwise from above."""
    position, top = check_heights(position, height, rows, columns)
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    clockwise = measure_areas(position, index[:2, :2].ravel()[None, :3])[0] < 0.0  # a mirrored bed
    faces = np.empty((rows - 1, 2 * (columns - 1), 3), np.int32)
    band = max(1, BAND // columns)
    for row in range(0, rows - 1, band):
        faces_of_band = _triangles(position, top, index[row : row + band + 1])
        faces_of_band = faces_of_band[:, ::-1] if clockwise else faces_of_band
        if not np.all(measure_areas(position, faces_of_band) > 0.0):
            raise ParameterError(
                "Surface", "position", "must order the pins row by row", "pins out of order"
            )
        faces[row : row + band] = faces_of_band.reshape(-1, 2 * (columns - 1), 3)
    return faces.reshape(-1, 3)


def _triangles(position: Floats, top: Floats, index: Faces) -> Faces:
    """Return the triangles between rows of pins, two for every four pins."""
    # The corners of each cell, around it: a and c are the ends of one diagonal, b and d of the
    # other.
    a, b, c, d = (part.ravel() for part in take_corners(index))
    along_ac = _cut_along_ac(position, top, a, b, c, d)
    return np.column_stack(
        [a, b, np.where(along_ac, c, d), np.where(along_ac, a, b), c, d]
    ).reshape(-1, 3)


def make_solid(
    position: ArrayLike,
    height: ArrayLike,
    rows: int,
    columns: int,
    base_thickness: float = BASE_THICKNESS,
) -> tuple[Floats, Faces]:
    """Return vertices (2 n, 3), m, tops first, and faces of the solid over a base: skin, base, walls."""
    position, top = check_heights(position, height, rows, columns)
    level = find_base_level(top, base_thickness)
    over = make_skin(position, top, rows, columns)
    n, faced = len(position), len(over)
    vertices = np.empty((2 * n, 3))
    vertices[:n, :2] = vertices[n:, :2] = position
    vertices[:n, 2], vertices[n:, 2] = top, level
    start = take_outline(np.arange(n, dtype=np.int32).reshape(rows, columns))
    if measure_areas(position, np.array([[0, 1, columns]]))[0] < 0.0:
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


def check_heights(
    position: ArrayLike, height: ArrayLike, rows: int, columns: int, name: str = "height"
) -> tuple[Floats, Floats]:
    """Return positions (n, 2), m, and one value a pin as arrays, or refuse what cannot carry a skin."""
    if rows < 2 or columns < 2:
        rule = "must have at least 2 x 2 pins, in rows along x"
        raise ParameterError("Surface", "", rule, f"{rows} x {columns}")
    position, top = read_places(position), np.asarray(height, dtype=np.float64)
    if top.shape != (rows * columns,) or len(position) != rows * columns:
        rule = f"must have one value for each of the {rows} x {columns} pins"
        raise ParameterError(
            "Surface", name, rule, f"{top.size} values at {len(position)} positions"
        )
    if not np.all(np.isfinite(top)):
        raise ParameterError("Surface", name, "must be finite", name_first_bad(top))
    return position, top


def _cut_along_ac(position: Floats, top: Floats, *corners: Faces) -> Flags:
    """Return which cells of the skin are cut from a to c, and not from b to d (rules above)."""
    a, b, c, d = corners
    ac, bd = (np.sum((position[i] - position[j]) ** 2, axis=1) for i, j in ((a, c), (b, d)))
    steep_ac, steep_bd = np.abs(top[a] - top[c]), np.abs(top[b] - top[d])
    higher = top[a] + top[c] >= top[b] + top[d] - TIE
    by_height = (steep_ac < steep_bd - TIE) | ((steep_ac <= steep_bd + TIE) & higher)
    return np.where(np.abs(ac - bd) <= SAME_LENGTH * (ac + bd), by_height, ac < bd)


def measure_areas(position: Floats, faces: Faces) -> Floats:
    """Return the area of each triangle seen from above, m²; negative when it runs clockwise."""
    a, b, c = (position[faces[:, corner]] for corner in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def take_corners(table: Array) -> tuple[Array, Array, Array, Array]:
    """Return the four corners, in sequence, of each cell between the rows and columns of a table."""
    return table[:-1, :-1], table[:-1, 1:], table[1:, 1:], table[1:, :-1]


def take_outline(table: Faces) -> Faces:
    """Return the outer values: along the first row, up the last column, back, and down the first."""
    return np.concatenate([table[0, :-1], table[:-1, -1], table[-1, :0:-1], table[:0:-1, 0]])


@dataclass(frozen=True, eq=False)
class Formed:
    """All pins of a bed, row by row.

    Raises ParameterError on fewer than 2 x 2 pins, arrays that do not fit, numbers that are not
    finite, or pins out of order.
    """

    position: Floats
    """(n, 2): Axes of the pins, m."""
    height: Floats
    """(n,): Pin tops, m."""
    former: Floats
    """(n,): The same before the surface was formed, m."""
    force: Floats
    """(n,): Force on each pin, N."""
    mode: Indices
    """(n,): Codes of `modes.Mode`."""
    rows: int
    columns: int
    """Found from the positions."""

    @classmethod
    def of(
        cls,
        position: ArrayLike,
        height: ArrayLike,
        former: ArrayLike,
        force: ArrayLike,
        mode: ArrayLike,
    ) -> Formed:
        """Check the arrays; one number will do for `former`, `force` and `mode`."""
        rows, columns = find_grid_shape(position)
        position, top = check_heights(position, height, rows, columns)
        _, before = check_heights(
            position, np.broadcast_to(former, top.shape), rows, columns, "former"
        )
        _, pressed = check_heights(
            position, np.broadcast_to(force, top.shape), rows, columns, "force"
        )
        codes = np.broadcast_to(np.asarray(mode, np.int64), top.shape)
        return cls(position, top, before, pressed, codes, rows, columns)

    @property
    def points(self) -> Floats:
        """The positions row by row, (rows, columns, 2), m."""
        return self.position.reshape(self.rows, self.columns, 2)

    @property
    def pitch(self) -> float:
        """Distance between neighbors in a row, m."""
        return float(np.hypot(*(self.position[1] - self.position[0])))

    @property
    def along(self) -> float:
        """Step from a pin to the next one in a row, m."""
        return float(self.position[1, 0] - self.position[0, 0])

    @property
    def across(self) -> float:
        """Step from a row to the next one, m."""
        return float(self.position[self.columns, 1] - self.position[0, 1])

    @property
    def shift(self) -> float:
        """Shift of every other row in the direction of the columns, m; 0 in an aligned bed."""
        shift = float(np.sign(self.along) * (self.position[self.columns, 0] - self.position[0, 0]))
        return shift if abs(shift) > 1e-3 * self.pitch else 0.0

    def nearest(self, points: Floats) -> Indices:
        """Return the pin in the nearest row that is nearest to each of points (k, 2), m."""
        row = np.rint((points[:, 1] - self.position[0, 1]) / self.across).clip(0, self.rows - 1)
        row = row.astype(np.int64)
        first = self.position[row * self.columns, 0]
        column = (
            np.rint((points[:, 0] - first) / self.along).clip(0, self.columns - 1).astype(np.int64)
        )
        return np.asarray(row * self.columns + column)

    @property
    def raised(self) -> Floats:
        """Height of each pin above its former height, m."""
        return self.height - self.former

    @property
    def spacing(self) -> float:
        """Mean of the distances in a row and of rows, m."""
        return 0.5 * (self.pitch + abs(self.across))

    @cached_property
    def neighbors(self) -> Indices:
        """Neighbors of the pins, (n, 8) in an aligned bed, else (n, 6), counter-clockwise; -1 off the bed."""
        return find_neighbors(self.rows, self.columns, self.shift / self.pitch, corners=True)

    def at(self, values: Floats, points: Floats) -> Floats:
        """Return values (n,) at points (..., 2), m: linear along rows, then across; NaN off the bed."""
        first = self.position[:: self.columns]
        row = (points[..., 1] - first[0, 1]) / self.across
        low = np.clip(np.floor(row), 0, self.rows - 2).astype(np.int64)
        up = row - low
        columns = [(points[..., 0] - first[low + step, 0]) / self.along for step in (0, 1)]
        parts = []
        for step, column in enumerate(columns):
            left = np.clip(np.floor(column), 0, self.columns - 2).astype(np.int64)
            over = np.clip(column - left, 0.0, 1.0)
            pin = (low + step) * self.columns + left
            parts.append(values[pin] * (1.0 - over) + values[pin + 1] * over)
        across = columns[0] * (1.0 - up) + columns[1] * up
        slack = 1e-6
        on_bed = (row >= -slack) & (row <= self.rows - 1 + slack)
        on_bed &= (across >= -slack) & (across <= self.columns - 1 + slack)
        share = np.clip(up, 0.0, 1.0)
        return np.where(on_bed, parts[0] * (1.0 - share) + parts[1] * share, np.nan)


def make_formed(history: Mapping[str, Array], row: int, former: int | float = 0) -> Formed:
    """Return a row of a history as a formed surface; `former`: a row (int), or one height, m (float)."""
    height = history["height"]
    count = len(height)
    for name, number in (("row", row), ("former", former)):
        if isinstance(number, int) and not -count <= number < count:
            raise OutputError(
                f"The history has {count} rows, 0 to {count - 1} (got {number} as {name})."
            )
    if isinstance(former, float) and not np.isfinite(former):
        raise ParameterError("Export", "former", "must be a finite height", f"{former} m")
    before = height[former] if isinstance(former, int) else former
    return Formed.of(
        history["position"], height[row], before, history["force"][row], history["mode"][row]
    )


#: Code of the mode at a vertex that belongs to no pin, such as one of the base.
NO_PIN = -1
#: Triangles, or vertices, that are processed at once: a few MB, however large the body.
PIECE = 1 << 16


@dataclass(frozen=True, eq=False)
class Body:
    """Vertices and triangles under one name."""

    name: str
    """Letters, digits and underscores."""
    vertices: Floats
    """(v, 3): m, z up, in the space of the bed."""
    faces: Faces
    """(f, 3): Counter-clockwise seen from outside."""
    values: Mapping[str, Floats] = field(default_factory=dict)
    """(v,): Empty, or height, m, force, N, and code of the control mode of each vertex."""
    groups: tuple[str, ...] = ()
    """Names of groups of faces, such as features."""
    group: Faces = field(default_factory=lambda: np.empty(0, np.int32))
    """(f,): Group of each face: 1 is the first of `groups`, 0 none. Empty without groups."""
    vertex_group: Faces = field(default_factory=lambda: np.empty(0, np.int32))
    """(v,): The same for vertices; empty without groups."""
    closed: bool = True
    """Whether it encloses a volume."""


def split_pieces(table: Array) -> Iterator[Array]:
    """Yield the rows of a table in order, at most `PIECE` at a time."""
    for start in range(0, len(table), PIECE):
        yield table[start : start + PIECE]
