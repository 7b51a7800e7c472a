"""Height map: a shape as a grid of values, bilinear over its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..model.layout import ON_THE_SIDE, Grid
from .picture_heights import MOST
from .relief import Placement, Tops

#: Values a map keeps; more, and its pixels are averaged in squares when it is read.
KEPT = 4_000_000
#: Pixels averaged at a time, so that memory is bounded by the picture itself.
CHUNK = 4_000_000


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights over a rectangle of pixels; a pixel is one unit wide, with its value in the middle.

    Attributes
    ----------
    name : str
    values : ndarray (r, c)
        The first row lies at the lowest y. Each is the mean of up to `block` x `block` pixels.
    pixels : (int, int)
        Rows and columns of pixels.
    block : int
    value_length : float or None
        Meters in the unit of the values; None where they are no lengths.
    """

    name: str
    values: Floats
    pixels: tuple[int, int]
    block: int = 1
    value_length: float | None = None

    length = None
    underside = None

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The rectangle of all pixels."""
        return 0.0, 0.0, float(self.pixels[1]), float(self.pixels[0])

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return the heights at the pins: bilinear, of the means over a pin's own square of pixels."""
        across, along = (grid.x - at.x) / at.factor_x, (grid.y - at.y) / at.factor_y
        covered = _within(across, self.pixels[1]) & _within(along, self.pixels[0])
        under_a_pin = min(grid.layout.pitch / at.factor_x, grid.layout.row_spacing / at.factor_y)
        block = max(1, int(min(under_a_pin / self.block, max(self.values.shape)) + ON_THE_SIDE))
        values = average_blocks(self.values, block)
        rows = _places(along, self.pixels[0], block * self.block, values.shape[0])
        columns = _places(across, self.pixels[1], block * self.block, values.shape[1])
        value = np.where(covered, _bilinear(values, rows, columns), 0.0)
        return Tops(value, covered, np.zeros(grid.count, np.bool_))


def make_height_map(name: str, values: NDArray[np.generic], value_length: float | None = None) -> HeightMap:
    """Make a map of an array of numbers, the first row at the lowest y.

    `name`: what messages call it; `values` (r, c); `value_length`: meters in the unit of the values; by
    default they are no lengths. Raises ParameterError when it is no map: not two-dimensional, smaller than 2
    x 2, or with numbers that are not finite.
    """
    shown = " x ".join(map(str, values.shape)) or "a single number"
    if values.ndim != 2 or min(values.shape) < 2:
        rule = "must hold at least 2 x 2 heights"
        raise ParameterError("shape", "file", rule, f"{name}: {shown}")
    if values.size > MOST:
        rule = f"must hold at most {MOST // 1_000_000} million heights"
        raise ParameterError("shape", "file", rule, f"{name}: {shown}")
    if values.dtype.kind not in "biuf":
        raise ParameterError("shape", "file", "must hold numbers", f"{name}: {values.dtype}")
    block = int(np.ceil(np.sqrt(values.size / KEPT)))
    with np.errstate(over="ignore", invalid="ignore"):
        kept = average_blocks(values, block)
    bad = np.argwhere(~np.isfinite(kept))
    if bad.size:
        row, column = (bad[0] * block).tolist()
        rule = "must hold finite numbers only"
        raise ParameterError("shape", "file", rule, f"{name}: {kept[tuple(bad[0])]} at {row}, {column}")
    return HeightMap(name, kept, (values.shape[0], values.shape[1]), block, value_length)


def average_blocks(values: NDArray[np.generic], block: int) -> Floats:
    """Return the means over squares of `block` x `block` values; those at the end may be smaller.

    `values` (r, c).
    """
    if block == 1:
        return np.asarray(values, np.float64)
    rows, columns = values.shape
    lines = max(1, CHUNK // (columns * block)) * block
    left = np.arange(0, columns, block)
    width = np.minimum(left + block, columns) - left
    parts = []
    for first in range(0, rows, lines):
        part = np.asarray(values[first : first + lines], np.float64)
        top = np.arange(0, len(part), block)
        tall = np.minimum(top + block, len(part)) - top
        sums = np.add.reduceat(np.add.reduceat(part, left, axis=1), top, axis=0)
        parts.append(sums / (tall[:, None] * width))
    return np.concatenate(parts)


def _within(places: Floats, pixels: int) -> NDArray[np.bool_]:
    """Return the positions that lie on the pixels, those on the edge included."""
    slack = ON_THE_SIDE * pixels
    inside: NDArray[np.bool_] = (places >= -slack) & (places <= pixels + slack)
    return inside


def _places(places: Floats, pixels: int, block: int, count: int) -> Floats:
    """Return places in pixels as places between `count` means, whose middles have the numbers 0, 1, ..."""
    starts = np.arange(count) * block
    middles = (starts + np.minimum(starts + block, pixels)) / 2
    return np.interp(places, middles, np.arange(count, dtype=np.float64))


def _bilinear(values: Floats, rows: Floats, columns: Floats) -> Floats:
    """Return values between the numbers of a table, shape (n,)."""
    row = np.minimum(rows.astype(np.intp), values.shape[0] - 1)
    column = np.minimum(columns.astype(np.intp), values.shape[1] - 1)
    below, right = np.minimum(row + 1, values.shape[0] - 1), np.minimum(column + 1, values.shape[1] - 1)
    up, over = rows - row, columns - column
    first = values[row, column] * (1.0 - over) + values[row, right] * over
    second = values[below, column] * (1.0 - over) + values[below, right] * over
    between: Floats = first * (1.0 - up) + second * up
    return between
