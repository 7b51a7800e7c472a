"""The bed of cells: how many, how far apart, and which of them lie near a point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import ParameterError
from .quantity import Parameters, quantity

__all__ = ["Grid", "Layout", "grid"]

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]

#: Relative slack on a radius, so that cells exactly on it count the same on every side of the centre.
ON_THE_CIRCLE = 1.0 + 1e-9


@dataclass(frozen=True)
class Layout(Parameters):
    """Rows and columns of cells, centred on the origin of the bed.

    *aligned*: a square grid. *staggered*: every other row shifted by half a pitch, rows
    one pitch apart. *hexagonal*: shifted likewise, rows ``pitch * sqrt(3) / 2`` apart.
    """

    rows: int = quantity(25, "number of rows, counted along y", symbol="n_y", source="P", at_least=1, at_most=10_000)
    columns: int = quantity(25, "number of cells in a row, along x", symbol="n_x", source="P", at_least=1, at_most=10_000)
    pitch: float = quantity(3e-3, "distance between neighbours in a row", unit="m", symbol="p", source="P", above=0.0)
    arrangement: str = quantity(
        "aligned", "how neighbouring rows stand to each other", source="P", choices=("aligned", "staggered", "hexagonal")
    )

    def check(self) -> None:
        """Refuse a bed larger than memory or integer indices can hold."""
        if self.rows * self.columns > 20_000_000:
            rule = "must have at most 20 million cells"
            raise ParameterError("Layout", "rows * columns", rule, f"{self.rows} x {self.columns}")

    @property
    def row_spacing(self) -> float:
        """Distance between rows, m."""
        return self.pitch * (math.sqrt(0.75) if self.arrangement == "hexagonal" else 1.0)

    @property
    def shift(self) -> float:
        """How far odd rows are shifted along x, m."""
        return 0.0 if self.arrangement == "aligned" else self.pitch / 2


@dataclass(frozen=True, eq=False)
class Grid:
    """The cells' positions, and quick answers to "which cells are near here?".

    Attributes
    ----------
    layout : Layout
    x, y : ndarray (n,)
        Positions of the cells' axes, m; cell ``row * columns + column``.
    """

    layout: Layout
    x: Floats
    y: Floats

    @property
    def count(self) -> int:
        """Number of cells n."""
        return self.x.size

    @property
    def positions(self) -> Floats:
        """Positions of the cells, shape (n, 2), m."""
        return np.column_stack([self.x, self.y])

    def disc(self, x: float, y: float, radius: float) -> Cells:
        """Return the cells within `radius` of a point, in ascending order.

        Parameters
        ----------
        x, y : float
            Centre, m.
        radius : float
            Radius, m; cells exactly on it belong to the disc.

        Returns
        -------
        ndarray of int (k,)
            The cost follows the disc, not the bed.
        """
        plan = self.layout
        spacing, left, bottom = plan.row_spacing, float(self.x[0]), float(self.y[0])
        low_row = max(0, math.ceil((y - radius - bottom) / spacing - 1e-9))
        high_row = min(plan.rows - 1, math.floor((y + radius - bottom) / spacing + 1e-9))
        low = max(0, math.ceil((x - radius - left - plan.shift) / plan.pitch - 1e-9))
        high = min(plan.columns - 1, math.floor((x + radius - left) / plan.pitch + 1e-9))
        if low_row > high_row or low > high:
            return np.empty(0, np.intp)
        rows = np.arange(low_row, high_row + 1) * plan.columns
        cells = (rows[:, None] + np.arange(low, high + 1)).ravel()
        dx = self.x.take(cells)
        dx -= x
        dx *= dx
        dy = self.y.take(cells)
        dy -= y
        dy *= dy
        dx += dy
        return cells[dx <= radius * radius * ON_THE_CIRCLE]


def grid(layout: Layout) -> Grid:
    """Lay out the cells of a bed, centred on the origin.

    Returns
    -------
    Grid
        With arrays of ``rows * columns`` positions.
    """
    column = np.arange(layout.columns) * layout.pitch
    row = np.arange(layout.rows)
    width = (layout.columns - 1) * layout.pitch + (layout.shift if layout.rows > 1 else 0.0)
    x = column - width / 2 + (row[:, None] % 2) * layout.shift
    y = np.broadcast_to(((row - (layout.rows - 1) / 2) * layout.row_spacing)[:, None], x.shape)
    return Grid(layout, x.ravel(), y.ravel())
