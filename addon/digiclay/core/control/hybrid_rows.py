"""Rows of a cell in Method III, and places of cells about the finger."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["OWN_ROWS", "Own", "Region", "split_rows"]

Floats = NDArray[np.float64]

#: Rows of a cell but for its filters and the speeds asked for.
OWN_ROWS = 6


class Own(NamedTuple):
    """State rows of cells by name: views.

    Attributes
    ----------
    filters : ndarray (k, m)
        Relaxation of the pulp over it, N.
    tension : ndarray (m,)
        N.
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

    filters: Floats
    tension: Floats
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
    distance, ahead : ndarray (m,)
        From it, and ahead of it, m.
    inside, ring : ndarray of bool (m,)
        In the blister, and in the ring around it.
    part : ndarray (m,)
        Profile of the blister.
    """

    aim: tuple[float, float, float]
    speed: float
    distance: Floats
    ahead: Floats
    inside: NDArray[np.bool_]
    ring: NDArray[np.bool_]
    part: Floats


def split_rows(own: Floats, filters: int) -> Own:
    """Return the rows of cells by name.

    Parameters
    ----------
    own : ndarray (rows, m)
    filters : int
        Number of relaxation filters, k.
    """
    tension, coming, later, residual, lead, stamp = own[filters : filters + OWN_ROWS]
    return Own(own[:filters], tension, coming, later, residual, lead, stamp, own[filters + OWN_ROWS :])
