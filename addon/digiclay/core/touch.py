"""From the finger's pose to the force on each pin (equations 10 to 14)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .contact import Contact
from .fingertip import Fingertip, reach, underside
from .layout import Grid
from .places import Pulp

__all__ = ["Touch", "force", "window"]

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]


@dataclass(frozen=True)
class Touch:
    """Fingertip, contact law and relaxation of the pulp."""

    fingertip: Fingertip
    contact: Contact
    pulp: Pulp


def force(touch: Touch, height: Floats, under: Floats, filters: Floats) -> Floats:
    """Return the force on each cell, N, pressing down is positive.

    ``F = f_d max(T(x) - Σ ĉ_i z_i, 0)``: the pulp pushes but does not stick.

    Parameters
    ----------
    touch : Touch
    height : ndarray (k,)
        Pin tops H, m.
    under : ndarray (k,)
        Underside of the finger over them, m; x = H - underside.
    filters : ndarray (r, k)
        The relaxation's state rows z_i, N.
    """
    tension = touch.contact.tension(height - under)
    return touch.contact.share * np.maximum(tension - touch.pulp.relaxed(filters), 0.0)


def window(grid: Grid, outline: Floats, peak: float) -> tuple[Cells, Floats]:
    """Find the cells the finger may be over while it takes up some poses.

    Parameters
    ----------
    grid : Grid
    outline : ndarray (p, 10)
        Poses of one control period, from `Fingertip.outline`, in the order of time.
    peak : float
        No pin top is higher than this, m.

    Returns
    -------
    cells : ndarray of int (k,)
        All cells whose top could be above the underside, and usually some more.
    under : ndarray (p, k)
        The underside over them, m.
    """
    first, last = outline[0].tolist(), outline[-1].tolist()
    radius = max(reach(first, peak), reach(last, peak))
    if radius < 0.0:
        return np.empty(0, np.intp), np.empty((len(outline), 0))
    radius += 0.5 * math.hypot(last[0] - first[0], last[1] - first[1])
    cells = grid.box(0.5 * (first[0] + last[0]), 0.5 * (first[1] + last[1]), radius)
    return cells, underside(outline, grid.x.take(cells), grid.y.take(cells))
