"""Metrics along the fingertip path: contact, lag, and the heights behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.modes import Mode

Rows = NDArray[np.bool_]

#: How far the fingertip must have gone on from a cell for it to count as left behind, m.
AWAY = 12e-3
#: Distances from a finger to cells looked at at a time: those of a long session on a large bed would not fit
#: in memory.
AT_ONCE = 2**17


def find_contact_rows(total_force: ArrayLike) -> Rows:
    """Return which rows have contact, shape (t,), from the total force in N."""
    touching: Rows = np.asarray(total_force, dtype=np.float64) > 0.0
    return touching


@dataclass(frozen=True, eq=False)
class CellSums:
    """Sums over the cells of t rows of n cells, (t,), and the first and last heights, (n,)."""

    total: Floats
    """Total force, N."""
    x: Floats
    y: Floats
    height: Floats
    """Sums of the force times place, and times height, N m."""
    strongest: Floats
    """Largest force on a cell, N."""
    following: NDArray[np.intp]
    """How many cells follow the force."""
    first: Floats
    last: Floats
    """Heights in the first and in the last row, m."""

    @property
    def touching(self) -> Rows:
        """Which rows have contact, shape (t,)."""
        return find_contact_rows(self.total)

    @property
    def shaping(self) -> Rows:
        """Which rows shape the clay, shape (t,): in contact, and a cell follows the force."""
        rows: Rows = self.touching & (self.following > 0)
        return rows


def sum_cells(history: Mapping[str, ArrayLike]) -> CellSums:
    """Return the sums over the cells of a history, the arrays of ``history.npz``, of at least one row."""
    total, height, force, position = (
        np.asarray(history[name], dtype=np.float64) for name in ("total_force", "height", "force", "position")
    )
    x, y = (np.broadcast_to(along[:, None], force.T.shape) for along in position.T)
    _, x, y, lifted, strongest = sum_row(force.T, x, y, height.T)
    following = np.count_nonzero(np.asarray(history["mode"]) == Mode.FORCE_FOLLOW, axis=1)
    return CellSums(total, x, y, lifted, strongest, following, height[0], height[-1])


def sum_row(force: Floats, x: Floats, y: Floats, height: Floats) -> Floats:
    """Return total, x, y, height and strongest of `CellSums`, (5, b), of b rows of k cells, all (k, b)."""
    sums = np.empty((5, force.shape[1]))
    np.add.reduce(force, out=sums[0])
    for values, found in zip((x, y, height), sums[1:4], strict=True):
        np.einsum("kb,kb->b", values, force, out=found)
    np.maximum.reduce(force, out=sums[4], initial=0.0)
    return sums


def measure_lag(sums: CellSums, fingertip: ArrayLike) -> Floats:
    """Return how far the blister is behind the fingertip, (t, 7), in the rows in contact, m.

    ``lag = |p - sum F_j r_j / sum F_j|`` in the horizontal plane, p the lowest point, r_j the positions.
    """
    rows = sums.touching
    centroid = np.column_stack([sums.x, sums.y])[rows] / sums.total[rows, None]
    distance: Floats = np.hypot(*(np.asarray(fingertip, dtype=np.float64)[rows, :2] - centroid).T)
    return distance


def measure_surface_under(sums: CellSums, fingertip: ArrayLike) -> Floats:
    """Return ``sum F_j H_j / sum F_j - z``, the surface under the fingertip, in the rows in contact, m."""
    rows, tip = sums.touching, np.asarray(fingertip, dtype=np.float64)
    above: Floats = sums.height[rows] / sums.total[rows] - tip[rows, 2]
    return above


def measure_ridge_errors(
    position: ArrayLike, final: ArrayLike, fingertip: ArrayLike, rows: Rows, away: float = AWAY
) -> Floats:
    """Return how far the cells the fingertip has passed over stand above its path at the end.

    ``e_j = H_j(end) - z(t_j)``, t_j the last row of `rows` in which no cell is nearer to the
    fingertip than cell j. A cell counts when the fingertip went on, in rows of the same unbroken
    stretch, to a place at least `away` from it: where it pressed or left is no ridge. Returned are the
    cells that count, in the order in which the fingertip passed them.
    """
    place, tip = np.asarray(position, dtype=np.float64), np.asarray(fingertip, dtype=np.float64)
    chosen = np.flatnonzero(rows)
    nearest = np.empty(chosen.size, dtype=np.intp)
    several = max(1, AT_ONCE // max(len(place), 1))
    for first in range(0, chosen.size, several):
        part = slice(first, first + several)
        square = (tip[chosen[part], 0, None] - place[:, 0]) ** 2
        square += (tip[chosen[part], 1, None] - place[:, 1]) ** 2
        nearest[part] = np.argmin(square, axis=1)
    last = {int(cell): i for i, cell in enumerate(nearest)}
    stretch = np.concatenate([[0], np.cumsum(np.diff(chosen) > 1)]) if chosen.size else chosen
    errors = []
    for cell, i in sorted(last.items(), key=lambda pair: pair[1]):
        after = chosen[i:][stretch[i:] == stretch[i]]
        if np.max(np.hypot(*(tip[after, :2] - place[cell]).T)) >= away:
            errors.append(float(np.asarray(final)[cell]) - float(tip[chosen[i], 2]))
    return np.array(errors)
