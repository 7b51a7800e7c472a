"""Exchange between neighboring cells: diffusion over a bed, which preserves the sum of the values."""

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.layout import Grid


@dataclass(frozen=True)
class Exchange:
    """Exchange between neighbors in one control period.

    Neighbors in a row exchange a share `along` of their difference, those in two rows `across`. If
    odd rows are `shifted`, a cell has six neighbors, not four.
    """

    columns: int
    shifted: bool
    along: float
    across: float

    def find_pairs(self, cells: Cells) -> list[tuple[Cells, Cells, float]]:
        """Return indices of neighbors among `cells`, each pair once, with the share that they exchange."""
        row, column = np.divmod(cells, self.columns)
        last = self.columns - 1
        steps = [(1, column < last, self.along), (self.columns, column <= last, self.across)]
        if self.shifted:  # even rows reach left as well, odd ones right
            odd = row % 2 == 1
            steps.append((self.columns - 1, ~odd & (column > 0), self.across))
            steps.append((self.columns + 1, odd & (column < last), self.across))
        order = np.argsort(cells)
        ascending = cells[order]
        pairs = []
        for step, exists, share in steps:
            start = np.flatnonzero(exists)
            goal = cells[start] + step
            at = np.minimum(np.searchsorted(ascending, goal), cells.size - 1)
            here = ascending[at] == goal
            pairs.append((start[here], order[at[here]], share))
        return pairs

    def even_out(self, cells: Cells, values: Floats, weight: Floats | None = None) -> Floats:
        """Return values of cells, (m,), after an exchange between neighbors among them, with the same sum.

        The smaller weight of two neighbors, (m,) from 0 to 1, scales their exchange.
        """
        change = np.zeros(cells.size)
        for first, second, share in self.find_pairs(cells):
            flow = share * (values[second] - values[first])
            if weight is not None:
                flow *= np.minimum(weight[first], weight[second])
            change += np.bincount(first, flow, cells.size) - np.bincount(second, flow, cells.size)
        return values + change


def make_exchange(grid: Grid, diffusivity: float, period: float) -> Exchange:
    """Return the exchange of a diffusivity, m²/s, isotropic, in a period, s.

    The rates give the diffusivity along x and y; their sum is limited so that neighbors do not
    overshoot in a period of any length.
    """
    plan = grid.layout
    if not plan.shifted:
        along, across = diffusivity / plan.pitch**2, diffusivity / plan.row_spacing**2
        total = 2.0 * (along + across)
    else:
        across = diffusivity / (2.0 * plan.row_spacing**2)
        along = diffusivity / plan.pitch**2 - across / 2.0
        total = 2.0 * along + 4.0 * across
    limited = -math.expm1(-2.0 * total * period) / (2.0 * total) if total else 0.0
    return Exchange(plan.columns, plan.shifted, along * limited, across * limited)
