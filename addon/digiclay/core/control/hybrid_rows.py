"""Rows of a cell in Method III, and places of cells about the finger."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .blister_cells import BlisterCells

__all__ = ["OWN_ROWS", "Own", "Region", "split_rows"]

Floats = NDArray[np.float64]

#: Rows of a cell but for its filters and the speeds asked for.
OWN_ROWS = 6


class Own(NamedTuple):
    """State rows of cells by name: views.

    Attributes
    ----------
    pulp : ndarray (k + 1, m)
        Relaxation of the pulp over it, and its tension, N.
    coming, later : ndarray (m,)
        Predicted undersides a period and two from now, m.
    residual : ndarray (m,)
        What the fit left of the measured underside; 0 where none is felt, m.
    lead : ndarray (m,)
        How far its commanded height is from the one it will be left at, m.
    stamp : ndarray (m,)
        Period in which its pulp was last observed; 0: never.
    speeds : ndarray (q, m)
        Asked for, the newest first, m/s.
    """

    pulp: Floats
    coming: Floats
    later: Floats
    residual: Floats
    lead: Floats
    stamp: Floats
    speeds: Floats


class Region(NamedTuple):
    """Cells about the predicted place of the finger.

    Attributes
    ----------
    aim : (float, float, float)
        Lowest point of the finger then, m.
    speed : float
        Of the finger in the plane, m/s.
    cells : BlisterCells
        About the aim.
    drop : ndarray (m,)
        How far they may stand from the top; see `LeadProfile.find_drop`, m.
    """

    aim: tuple[float, float, float]
    speed: float
    cells: BlisterCells
    drop: Floats


def split_rows(own: Floats, filters: int) -> Own:
    """Return the rows of cells by name.

    Parameters
    ----------
    own : ndarray (rows, m)
    filters : int
        Number of relaxation filters, k.
    """
    _, coming, later, residual, lead, stamp = own[filters : filters + OWN_ROWS]
    return Own(own[: filters + 1], coming, later, residual, lead, stamp, own[filters + OWN_ROWS :])
