"""Lattice of the pins: neighbors, and heights between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .formed import Formed

Pins = NDArray[np.int64]

#: Steps to the neighbors, (rows, columns), counter-clockwise; a shifted bed has one list for rows
#: that stand back and one for rows that are shifted forward along x.
SQUARE = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
BACK = ((0, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0))
FORWARD = ((0, 1), (1, 1), (1, 0), (0, -1), (-1, 0), (-1, 1))
#: Steps a pitch with which a distance is looked for.
STEPS = 2
#: Pairs of a place and a step that are looked at at once.
CHUNK = 1 << 20


@dataclass(frozen=True, eq=False)
class Lattice:
    """Pins and their neighbors.

    Attributes
    ----------
    formed : Formed
    neighbor : ndarray of int (n, 8 or 6)
        Counter-clockwise; -1 beyond the edge of the bed.
    """

    formed: Formed
    neighbor: Pins

    @classmethod
    def of(cls, formed: Formed) -> Lattice:
        """Return the neighbors of all pins of a bed: 8 in an aligned one, else 6."""
        row, column = np.divmod(np.arange(formed.rows * formed.columns), formed.columns)
        lists = (SQUARE, SQUARE) if not formed.shift else (BACK, FORWARD)
        lists = lists[::-1] if formed.shift < 0.0 else lists
        steps = np.array(lists)[row % 2]
        rows, columns = row[:, None] + steps[..., 0], column[:, None] + steps[..., 1]
        on_bed = (rows >= 0) & (rows < formed.rows) & (columns >= 0) & (columns < formed.columns)
        return cls(formed, np.where(on_bed, rows * formed.columns + columns, -1))

    @property
    def pitch(self) -> float:
        """Distance of neighbors, the mean of that along a row and that of the rows, m."""
        return 0.5 * (self.formed.pitch + self.formed.row_spacing)

    def at(self, values: Floats, position: Floats) -> Floats:
        """Return what has a value at each pin, (n,), at places (..., 2), m; NaN beyond the bed.

        It is straight along each row, and then between two rows.
        """
        bed = self.formed
        first = bed.position[:: bed.columns]
        along = bed.position[1, 0] - bed.position[0, 0]
        row = (position[..., 1] - first[0, 1]) / (first[1, 1] - first[0, 1])
        low = np.clip(np.floor(row), 0, bed.rows - 2).astype(np.int64)
        up = row - low
        columns = [(position[..., 0] - first[low + step, 0]) / along for step in (0, 1)]
        parts = []
        for step, column in enumerate(columns):
            left = np.clip(np.floor(column), 0, bed.columns - 2).astype(np.int64)
            over = np.clip(column - left, 0.0, 1.0)
            pin = (low + step) * bed.columns + left
            parts.append(values[pin] * (1.0 - over) + values[pin + 1] * over)
        across = columns[0] * (1.0 - up) + columns[1] * up
        slack = 1e-6
        on_bed = (row >= -slack) & (row <= bed.rows - 1 + slack)
        on_bed &= (across >= -slack) & (across <= bed.columns - 1 + slack)
        share = np.clip(up, 0.0, 1.0)
        found: Floats = np.where(on_bed, parts[0] * (1.0 - share) + parts[1] * share, np.nan)
        return found


def measure_distance(
    lattice: Lattice, values: Floats, position: Floats, direction: Floats, level: Floats, most: float
) -> Floats:
    """Return how far it is, m, from places (k, 2) along unit vectors to where values (n,) fall to levels.

    Infinite where they stay above their level (k,), as far as the bed or `most`, m, reaches.
    """
    step = lattice.pitch / STEPS
    steps = np.arange(1, int(np.ceil(most / step)) + 1) * step
    found = np.full(len(position), np.inf)
    for start in range(0, len(position), max(1, CHUNK // len(steps))):
        part = slice(start, start + max(1, CHUNK // len(steps)))
        here = position[part, None] + steps[:, None] * direction[part, None]
        above = np.column_stack([lattice.at(values, position[part]), lattice.at(values, here)])
        above -= level[part, None]
        falls = above < 0.0  # not where the bed has ended: NaN
        first = np.argmax(falls, axis=1)
        row = np.arange(len(first))
        over, under = above[row, np.maximum(first - 1, 0)], above[row, first]
        with np.errstate(invalid="ignore", divide="ignore"):
            reached = np.where(first > 0, step * (first - 1 + over / (over - under)), 0.0)
        ended = np.isnan(above).argmax(axis=1)
        out = np.isnan(above).any(axis=1) & (ended < first)
        found[part] = np.where(falls.any(axis=1) & ~out, reached, np.inf)
    return found
