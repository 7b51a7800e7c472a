"""Layout of the bed: number and spacing of the cells, and the cells near a point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Cells, Flags, Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity

#: Center x, y and radius, m.
Disc = tuple[float, float, float]
#: The same of a run, or arrays (b,) of a batch, in which a radius of -inf is no disc.
Discs = tuple[Any, Any, Any]


class Arrangement(NamedTuple):
    """Distance of rows and shift of odd ones along x, in pitches; meaning.

    A pin has four neighbors if rows are not shifted, and six if they are shifted by half a pitch;
    features that need neighbors refuse all other beds.
    """

    spacing: float
    shift: float
    meaning: str


#: Arrangements of the cells by name; all else is derived from this table.
ARRANGEMENTS = {
    "aligned": Arrangement(1.0, 0.0, "A square grid"),
    "staggered": Arrangement(
        1.0, 0.5, "Every other row shifted by half a pitch, rows one pitch apart"
    ),
    "hexagonal": Arrangement(
        math.sqrt(0.75), 0.5, "Every other row shifted, six neighbors at the same distance"
    ),
}
#: Steps (rows, columns) to the neighbors, counter-clockwise: in a square grid, with diagonal ones;
#: in a shifted one, of rows behind their neighbors along x, and of rows ahead of them.
SQUARE = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
BACK = ((0, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0))
FORWARD = ((0, 1), (1, 1), (1, 0), (0, -1), (-1, 0), (-1, 1))
#: Those of even and of odd rows, by twice the shift of odd rows, in pitches.
STEPS = {0: (SQUARE, SQUARE), 1: (BACK, FORWARD), -1: (FORWARD, BACK)}

#: Relative tolerance, so that cells exactly on a limit count alike on all sides of the center.
RELATIVE_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Layout(Parameters):
    """Rows and columns of cells, centered on the origin of the bed, in one of the `ARRANGEMENTS`."""

    rows: int = quantity(
        25, "number of rows, counted along y", symbol="n_y", source="P", at_least=1, at_most=10_000
    )
    columns: int = quantity(
        25,
        "number of cells in a row, along x",
        symbol="n_x",
        source="P",
        at_least=1,
        at_most=10_000,
    )
    # More is a number in millimeters whose unit was forgotten.
    pitch: float = quantity(
        3e-3,
        "distance of neighboring cells in a row",
        unit="m",
        symbol="p",
        source="P",
        above=0.0,
        at_most=0.5,
    )
    arrangement: str = quantity(
        "aligned",
        "offset of neighboring rows",
        source="P",
        choices=tuple(ARRANGEMENTS),
    )

    def check(self) -> None:
        """Refuse a bed larger than memory or integer indices can hold."""
        if self.rows * self.columns > 20_000_000:
            rule = "must have at most 20 million cells"
            raise ParameterError("Layout", "rows * columns", rule, f"{self.rows} x {self.columns}")

    @property
    def row_spacing(self) -> float:
        """Distance between rows, m."""
        return self.pitch * ARRANGEMENTS[self.arrangement].spacing

    @property
    def share(self) -> float:
        """Share f_d of a cell in the law of a flat plate: its area over 26.5 mm², to six digits.

        So a finger has the same force on every bed; 0.34 is that of the paper's, 3 mm by 3 mm.
        """
        paper = type(self).pitch
        return float(f"{0.34 * (self.pitch / paper) * (self.row_spacing / paper):.6g}")

    @property
    def shift(self) -> float:
        """Shift of odd rows along x, m."""
        return self.pitch * ARRANGEMENTS[self.arrangement].shift

    @property
    def shifted(self) -> bool:
        """Whether a cell has six neighbors, not four; ParameterError in a bed without a lattice."""
        return list_steps(ARRANGEMENTS[self.arrangement].shift).shape[1] == len(BACK)

    def find_neighbors(self, *, corners: bool) -> Cells:
        """Return the neighbors of all cells; see the function `find_neighbors`."""
        shift = ARRANGEMENTS[self.arrangement].shift
        return find_neighbors(self.rows, self.columns, shift, corners=corners)


@dataclass(frozen=True, eq=False)
class Grid:
    """Positions of the cells, and fast search for the cells near a point."""

    layout: Layout
    x: Floats
    y: Floats
    """(n,): Positions of the cells' axes, m; cell ``row * columns + column``."""

    @property
    def count(self) -> int:
        """Number of cells n."""
        return self.x.size

    @cached_property
    def corner(self) -> tuple[float, float]:
        """Position of the first cell, m."""
        return float(self.x[0]), float(self.y[0])

    @property
    def positions(self) -> Floats:
        """Positions of the cells, shape (n, 2), m."""
        return np.column_stack([self.x, self.y])

    def find_beside(self, *, corners: bool) -> Cells:
        """Return neighbors as `find_neighbors`, where there is none the cell itself."""
        beside = self.layout.find_neighbors(corners=corners)
        return np.where(beside < 0, np.arange(self.count)[:, None], beside)

    def box(self, x: float, y: float, radius: float) -> Cells:
        """Return the cells in the rows and columns that a disc may reach, m, in ascending order."""
        plan = self.layout
        spacing, (left, bottom) = plan.row_spacing, self.corner
        low_row = max(0, math.ceil((y - radius - bottom) / spacing - RELATIVE_TOLERANCE))
        high_row = min(
            plan.rows - 1, math.floor((y + radius - bottom) / spacing + RELATIVE_TOLERANCE)
        )
        low = max(0, math.ceil((x - radius - left - plan.shift) / plan.pitch - RELATIVE_TOLERANCE))
        high = min(
            plan.columns - 1, math.floor((x + radius - left) / plan.pitch + RELATIVE_TOLERANCE)
        )
        rows = np.arange(low_row * plan.columns, high_row * plan.columns + 1, plan.columns)
        return (rows[:, None] + np.arange(low, high + 1)).ravel()

    def disc(self, x: float, y: float, radius: float) -> Cells:
        """Return the cells within `radius` of a point, m, in ascending order, those on its limit included."""
        cells = self.box(x, y, radius)
        square = (self.x.take(cells) - x) ** 2 + (self.y.take(cells) - y) ** 2
        return cells[square <= radius * radius * (1.0 + RELATIVE_TOLERANCE)]

    def cover(self, discs: Discs | None) -> Flags:
        """Return which cells are in any of f discs, (n,); a disc of negative radius is empty."""
        covered = np.zeros(self.count, np.bool_)
        for x, y, radius in zip(*discs, strict=True) if discs else ():
            if radius >= 0.0:
                covered[self.disc(x, y, radius)] = True
        return covered

    def enclose(self, cells: Cells) -> Disc | None:
        """Return a disc around the axes of cells, m; None without cells."""
        if not cells.size:
            return None
        x, y = self.x[cells], self.y[cells]
        at_x, at_y = float(x.min() + x.max()) / 2, float(y.min() + y.max()) / 2
        return at_x, at_y, float(np.hypot(x - at_x, y - at_y).max())

    def covered(self, discs: Discs | None) -> Flags:
        """Return which cells are in the discs of b runs, shape (n, b); (n, 1) without discs."""
        if discs is None:
            return np.zeros((self.count, 1), np.bool_)
        x, y, radius = discs
        square = (self.x[:, None] - x) ** 2
        square += (self.y[:, None] - y) ** 2
        return square <= radius * np.abs(radius) * (1.0 + RELATIVE_TOLERANCE)

    def at(self, x: Floats, y: Floats) -> Cells:
        """Return the cells nearest to positions, m, (k,)."""
        plan, (left, bottom) = self.layout, self.corner
        row = np.clip(np.rint((y - bottom) / plan.row_spacing), 0, plan.rows - 1)
        column = np.clip(
            np.rint((x - left - (row % 2) * plan.shift) / plan.pitch), 0, plan.columns - 1
        )
        return (row * plan.columns + column).astype(np.intp)

    def compute_basis(self, cells: Cells) -> Floats:
        """Return rows 1, x, y, x², x y, y² of cells (m,) or (m, b), shape (6, m) or (6, m, b)."""
        x, y = self.x.take(cells), self.y.take(cells)
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def make_grid(layout: Layout) -> Grid:
    """Lay out the cells of a bed, centered on the origin."""
    column = np.arange(layout.columns) * layout.pitch
    row = np.arange(layout.rows)
    width = (layout.columns - 1) * layout.pitch + (layout.shift if layout.rows > 1 else 0.0)
    x = column - width / 2 + (row[:, None] % 2) * layout.shift
    y = np.broadcast_to(((row - (layout.rows - 1) / 2) * layout.row_spacing)[:, None], x.shape)
    return Grid(layout, x.ravel(), y.ravel())


def find_grid_shape(position: ArrayLike) -> tuple[int, int]:
    """Return the rows and columns of pins at positions (n, 2), m, in order, or raise ParameterError."""
    points = read_places(position)
    if not len(points):
        raise ParameterError("Surface", "position", "must hold at least one pin", "none")
    spacing = float(np.hypot(*(points[1] - points[0]))) if len(points) > 1 else 1.0
    other_row = np.flatnonzero(np.abs(points[:, 1] - points[0, 1]) > 0.1 * spacing)
    columns = int(other_row[0]) if len(other_row) else len(points)
    if len(points) % columns:
        raise ParameterError(
            "Surface", "position", f"must fill rows of {columns} pins", f"{len(points)} pins"
        )
    return len(points) // columns, columns


def read_places(position: ArrayLike) -> Floats:
    """Return `position` as an array (n, 2), or refuse its shape or a value."""
    points = np.asarray(position, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ParameterError(
            "Surface", "position", "must have two coordinates per pin", f"shape {points.shape}"
        )
    if not np.all(np.isfinite(points)):
        raise ParameterError(
            "Surface", "position", "must be finite", name_first_bad(points.sum(axis=1))
        )
    return points


def name_first_bad(values: Floats) -> str:
    """Name the first value that is not finite."""
    cell = int(np.flatnonzero(~np.isfinite(values))[0])
    return f"{values[cell]} at cell {cell}"


def list_steps(shift: float) -> Cells:
    """Return the steps to the neighbors of even and odd rows, (2, 8 or 6, 2), by their shift in pitches."""
    if abs(2.0 * shift - round(2.0 * shift)) > 0.02 or round(2.0 * shift) not in STEPS:
        rule = "must have its rows in line or shifted by half a pitch, where neighbors are needed"
        raise ParameterError("layout", "arrangement", rule, f"a shift of {shift:.3g} pitches")
    return np.array(STEPS[round(2.0 * shift)], np.intp)


# Several milliseconds for 10,000 cells, asked for at each move of a mouse.
@lru_cache(maxsize=8)
def find_neighbors(rows: int, columns: int, shift: float, *, corners: bool) -> Cells:
    """Return each cell's neighbors (n, 6), (n, 4) or with corners (n, 8), counter-clockwise; -1: none.

    The array is kept, and read-only.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    steps = list_steps(shift)
    steps = (steps if corners or steps.shape[1] != len(SQUARE) else steps[:, ::2])[row % 2]
    beside, along = row[:, None] + steps[..., 0], column[:, None] + steps[..., 1]
    on_bed = (beside >= 0) & (beside < rows) & (along >= 0) & (along < columns)
    neighbors = np.where(on_bed, beside * columns + along, -1).astype(np.intp)
    neighbors.flags.writeable = False
    return neighbors


def add_disc(discs: Any, other: Disc) -> Any:
    """Return the smallest disc around two; or the list of several fingers' discs with another one."""
    if isinstance(discs, list):
        return [*discs, other]
    return enclose_discs(discs or other, other)


def enclose_discs(disc: Disc, other: Disc) -> Disc:
    """Return the smallest disc, x, y and radius in m, around two."""
    (x, y, radius), (other_x, other_y, other_radius) = disc, other
    apart = math.hypot(other_x - x, other_y - y)
    if apart + other_radius <= radius:
        return disc
    if apart + radius <= other_radius:
        return other
    whole = (apart + radius + other_radius) / 2.0
    share = (whole - radius) / apart
    return x + share * (other_x - x), y + share * (other_y - y), whole


def widen_disc(disc: Discs | None, margin: float) -> Discs | None:
    """Return discs with a margin around them, m."""
    return disc and (disc[0], disc[1], disc[2] + margin)


def encloses(outer: Discs | None, inner: Discs | None) -> bool:
    """Return whether a disc, or each disc of a batch, contains another one."""
    if inner is None or outer is None:
        return inner is None
    (x, y, radius), (other_x, other_y, limit) = inner, outer
    # A disc that touches the limit is inside: the last bit, which may differ in a batch, must not
    # decide.
    limit = limit * (1.0 + RELATIVE_TOLERANCE)
    if isinstance(limit, float):
        return bool(math.hypot(x - other_x, y - other_y) + radius <= limit)
    return bool((np.hypot(x - other_x, y - other_y) + radius <= limit).all())


def join_discs(discs: Sequence[Disc | None] | None) -> Discs | None:
    """Return the discs of b runs as arrays (b,)."""
    if discs is None:
        return None
    x, y, radius = np.array([disc or (0.0, 0.0, -math.inf) for disc in discs]).T
    return x, y, radius
