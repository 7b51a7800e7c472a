"""Set point of a control method: force of all cells together, or of each following cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats


@dataclass(frozen=True)
class SetPoint:
    """Set point of the total force.

    Attributes
    ----------
    force : float
        F_ref, N.
    per_cell : bool
        Whether every cell that follows the finger is asked for it, and not all cells together.
    """

    force: float
    per_cell: bool = False

    def total(self, following: ArrayLike) -> Floats:
        """Return the set point for a number of following cells, N.

        ``F_ref`` for all cells together, ``n F_ref`` for n cells that follow; NaN where none does,
        since then no force is asked for.

        `following`: numbers of cells in the mode `FORCE_FOLLOW`.
        """
        count = np.asarray(following, dtype=np.float64)
        if not self.per_cell:
            return np.full(count.shape, self.force)
        total: Floats = np.where(count > 0.0, self.force * count, np.nan)
        return total


def find_set_point(set_point: SetPoint | None, following: ArrayLike) -> Floats:
    """Return the `SetPoint.total`, N; NaN throughout for a method without a set point.

    `following`: numbers of cells in the mode `FORCE_FOLLOW`.
    """
    return np.full(np.shape(following), np.nan) if set_point is None else set_point.total(following)
