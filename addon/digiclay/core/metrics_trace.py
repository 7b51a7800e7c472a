"""What the metrics take of a session: sums over the cells in each row, and the first and last heights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .metrics_path import Rows, in_contact
from .modes import Mode

__all__ = ["Trace", "trace_of"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trace:
    """What the metrics take of t rows of n cells.

    Attributes
    ----------
    total : ndarray (t,)
        Total force, N.
    x, y, height : ndarray (t,)
        Sums over the cells of the force times place, and times height, N m.
    strongest : ndarray (t,)
        Largest force on a cell, N.
    following : ndarray of int (t,)
        How many cells follow the force.
    first, last : ndarray (n,)
        Heights in the first and in the last row, m.
    """

    total: Floats
    x: Floats
    y: Floats
    height: Floats
    strongest: Floats
    following: NDArray[np.intp]
    first: Floats
    last: Floats

    @property
    def touching(self) -> Rows:
        """Which rows have contact, shape (t,)."""
        return in_contact(self.total)

    @property
    def shaping(self) -> Rows:
        """Which rows shape the clay, shape (t,): in contact, and a cell follows the force."""
        rows: Rows = self.touching & (self.following > 0)
        return rows


def trace_of(history: Mapping[str, ArrayLike]) -> Trace:
    """Return the trace of a history.

    Parameters
    ----------
    history : mapping
        The arrays of ``history.npz``, of at least one row: height, force, mode, total_force and
        position.
    """
    total, height, force, position = (
        np.asarray(history[name], dtype=np.float64) for name in ("total_force", "height", "force", "position")
    )
    x, y = (force @ position).T
    lifted = np.einsum("tn,tn->t", force, height)
    following = np.count_nonzero(np.asarray(history["mode"]) == Mode.FORCE_FOLLOW, axis=1)
    return Trace(total, x, y, lifted, force.max(axis=1), following, height[0], height[-1])
