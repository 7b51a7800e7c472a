"""Rows of a cell in Method III."""

from __future__ import annotations

from typing import NamedTuple

#: Rows of a cell but for its filters and the speeds asked for.
OWN_ROWS = 6


class OwnRows(NamedTuple):
    """Numbers of a cell's state rows.

    Attributes
    ----------
    pulp : slice
        Relaxation of the pulp over it, and its tension, N.
    tension : int
        N.
    coming, later : int
        Predicted undersides a period and two from now, m.
    residual : int
        What the last fit left of the measured underside; 0 where none was felt, m.
    lead : int
        How far its commanded height is from the one it will be left at, m.
    stamp : int
        Period in which its pulp was last observed; 0: never.
    speeds : slice
        Asked for, the newest first, m/s.
    """

    pulp: slice
    tension: int
    coming: int
    later: int
    residual: int
    lead: int
    stamp: int
    speeds: slice


def number_rows(filters: int) -> OwnRows:
    """Return the numbers of the rows of a cell with some relaxation filters."""
    k = filters
    return OwnRows(slice(k + 1), k, k + 1, k + 2, k + 3, k + 4, k + 5, slice(k + OWN_ROWS, None))
