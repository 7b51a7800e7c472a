"""Lines laid over the pins: heights smoothed, so that a step between two pins makes no spike in a line."""

from __future__ import annotations

import numpy as np

from ..core.base.arrays import Floats
from ..core.model.layout import Grid

#: Standard deviation of the weights, and how far they reach, in pitches.
SPREAD, REACH = 1.0, 3


def drape(cells: Grid, height: Floats, places: Floats) -> Floats:
    """Return places (k, 2) with the mean height of the pins about each, (k, 3), m, weighted normally."""
    plan = cells.layout
    row, column = np.divmod(cells.at(places[:, 0], places[:, 1]), plan.columns)
    step = np.arange(-REACH, REACH + 1)
    rows, columns = row[:, None, None] + step[:, None], column[:, None, None] + step
    on_bed = (rows >= 0) & (rows < plan.rows) & (columns >= 0) & (columns < plan.columns)
    pins = np.where(on_bed, rows * plan.columns + columns, 0)
    square = (cells.x[pins] - places[:, 0, None, None]) ** 2 + (cells.y[pins] - places[:, 1, None, None]) ** 2
    # Relative to the nearest pin: far beyond the edge all weights would be 0.
    nearest = np.where(on_bed, square, np.inf).min(axis=(1, 2), keepdims=True)
    weight = np.where(on_bed, np.exp((nearest - square) / (2.0 * (SPREAD * plan.pitch) ** 2)), 0.0)
    mean = (weight * height[pins]).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    return np.column_stack([places, mean])
