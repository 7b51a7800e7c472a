"""Natural cubic splines, many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["natural"]

Floats = NDArray[np.float64]


def natural(knot: Floats, value: Floats, at: Floats) -> Floats:
    """Return natural cubic splines through some knots at some places.

    Parameters
    ----------
    knot : ndarray (k,)
        Rising or falling; two of them give straight lines.
    value : ndarray (k, s)
        A column a spline.
    at : ndarray (m,)
        Beyond the outer knots the splines go on straight.

    Returns
    -------
    ndarray (m, s)
    """
    if knot[0] > knot[-1]:
        knot, value = knot[::-1], value[::-1]
    bend = _second_derivatives(knot, value)
    inside = np.clip(at, knot[0], knot[-1])
    cell = np.clip(np.searchsorted(knot, inside, side="right") - 1, 0, len(knot) - 2)
    width = (knot[cell + 1] - knot[cell])[:, None]
    right = (inside - knot[cell])[:, None] / width
    left = 1.0 - right
    bent = (left**3 - left) * bend[cell] + (right**3 - right) * bend[cell + 1]
    curve: Floats = left * value[cell] + right * value[cell + 1] + bent * width**2 / 6.0
    beyond = (at - inside)[:, None]
    straight = (value[cell + 1] - value[cell]) / width
    turned = (1.0 - 3.0 * left**2) * bend[cell] + (3.0 * right**2 - 1.0) * bend[cell + 1]
    whole: Floats = curve + beyond * (straight + turned * width / 6.0)
    return whole


def _second_derivatives(knot: Floats, value: Floats) -> Floats:
    """Solve the tridiagonal system of the spline by elimination, no pivots needed: its diagonal dominates."""
    bend = np.zeros_like(value)
    if len(knot) < 3:
        return bend
    width = np.diff(knot)
    slope = np.diff(value, axis=0) / width[:, None]
    wanted, diagonal = 6.0 * np.diff(slope, axis=0), 2.0 * (width[:-1] + width[1:])
    for row in range(1, len(diagonal)):
        factor = width[row] / diagonal[row - 1]
        diagonal[row] -= factor * width[row]
        wanted[row] -= factor * wanted[row - 1]
    for row in range(len(diagonal) - 1, -1, -1):
        bend[row + 1] = (wanted[row] - width[row + 1] * bend[row + 2]) / diagonal[row]
    return bend
