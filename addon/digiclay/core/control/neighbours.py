"""Neighbouring cells, and the exchange between them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.layout import Grid

__all__ = ["Exchange", "cells_at", "exchange"]

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]


def cells_at(grid: Grid, place: Floats) -> Cells:
    """Return the indices of the cells that stand at some places (rows 1, x, y, ..., shape (6, m))."""
    plan, (left, bottom) = grid.layout, grid.corner
    row = np.rint((place[2] - bottom) / plan.row_spacing).astype(np.intp)
    column = np.rint((place[1] - left - (row % 2) * plan.shift) / plan.pitch).astype(np.intp)
    cells: Cells = row * plan.columns + column
    return cells


@dataclass(frozen=True)
class Exchange:
    """Exchange between neighbours in one control period.

    Attributes
    ----------
    columns : int
        Cells in a row.
    shifted : bool
        Whether odd rows are shifted, so that a cell has six neighbours, not four.
    along, across : float
        Share of their difference that two neighbours exchange, in a row and between rows.
    """

    columns: int
    shifted: bool
    along: float
    across: float

    def pairs(self, cells: Cells) -> list[tuple[Cells, Cells, float]]:
        """Return where in `cells` neighbours stand, each pair once, with the share they exchange."""
        row, column = np.divmod(cells, self.columns)
        last = self.columns - 1
        steps = [(1, column < last, self.along), (self.columns, column <= last, self.across)]
        if self.shifted:  # even rows reach left as well, odd ones right
            odd = row % 2 == 1
            steps.append((self.columns - 1, ~odd & (column > 0), self.across))
            steps.append((self.columns + 1, odd & (column < last), self.across))
        order = np.argsort(cells)
        ascending = cells[order]
        found = []
        for step, exists, share in steps:
            start = np.flatnonzero(exists)
            goal = cells[start] + step
            at = np.minimum(np.searchsorted(ascending, goal), cells.size - 1)
            here = ascending[at] == goal
            found.append((start[here], order[at[here]], share))
        return found

    def evened(self, cells: Cells, values: Floats) -> Floats:
        """Return values of some cells, shape (m,), after neighbours among them have exchanged.

        What one gives the other gets, and nothing is exchanged with a cell that is not there: the
        sum stays what it was.
        """
        change = np.zeros(cells.size)
        for one, other, share in self.pairs(cells):
            flow = share * (values[other] - values[one])
            change += np.bincount(one, flow, cells.size) - np.bincount(other, flow, cells.size)
        evened: Floats = values + change
        return evened


def exchange(grid: Grid, diffusivity: float, period: float) -> Exchange:
    """Return the exchange that spreads values with a diffusivity, m²/s, alike in all directions.

    The rates come from matching ``D`` along x and y; their sum is limited so that no period,
    however long, makes neighbours overshoot one another.
    """
    plan = grid.layout
    if plan.arrangement == "aligned":
        along, across = diffusivity / plan.pitch**2, diffusivity / plan.row_spacing**2
        total = 2.0 * (along + across)
    else:
        across = diffusivity / (2.0 * plan.row_spacing**2)
        along = diffusivity / plan.pitch**2 - across / 2.0
        total = 2.0 * along + 4.0 * across
    limited = -math.expm1(-2.0 * total * period) / (2.0 * total) if total else 0.0
    return Exchange(plan.columns, plan.shift > 0.0, along * limited, across * limited)
