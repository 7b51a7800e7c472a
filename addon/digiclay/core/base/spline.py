"""Monotone cubic splines, many at once, without overshoot.

The slope at a knot is the weighted harmonic mean of the slopes on both sides, and 0 where these
differ in sign: F. N. Fritsch and J. Butland, A method for constructing local monotone piecewise
cubic interpolants, SIAM J. Sci. Stat. Comput. 5 (1984) 300. At the ends it is the limited slope of
a parabola.
"""

import numpy as np

from .arrays import Floats


def interpolate_monotone(knot: Floats, value: Floats, at: Floats) -> Floats:
    """Return monotone cubic splines (m, s) through knots (k,), rising or falling, of values (k, s).

    Two knots give straight lines; beyond the outer knots the splines are straight. `at` (m,).
    """
    if knot[0] > knot[-1]:
        knot, value = knot[::-1], value[::-1]
    slope = _slopes(np.diff(knot), value)
    inside = np.clip(at, knot[0], knot[-1])
    cell = np.clip(np.searchsorted(knot, inside, side="right") - 1, 0, len(knot) - 2)
    width = (knot[cell + 1] - knot[cell])[:, None]
    right = (inside - knot[cell])[:, None] / width
    left = 1.0 - right
    # In terms of the difference of values, so that equal neighbors give exactly their value.
    step = value[cell + 1] - value[cell]
    bent = width * left * right * (left * slope[cell] - right * slope[cell + 1])
    curve = value[cell] + right * right * (1.0 + 2.0 * left) * step + bent
    beyond = (at - inside)[:, None]
    return np.asarray(curve + beyond * np.where(beyond < 0.0, slope[0], slope[-1]))


def compute_inner_slopes(width: Floats, value: Floats) -> Floats:
    """Return the slopes (k, s) at inner knots, 0 at both ends, of widths (k - 1,) and values (k, s)."""
    width = width[:, None]
    secant = np.diff(value, axis=0) / width
    slopes = np.zeros_like(value)
    before, after = secant[:-1], secant[1:]
    weight_before, weight_after = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    level_out = before * after <= 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        harmonic = (weight_before + weight_after) / (weight_before / before + weight_after / after)
    slopes[1:-1] = np.where(level_out, 0.0, harmonic)
    return slopes


def _slopes(width: Floats, value: Floats) -> Floats:
    """Return the slope at each knot, shape of `value`."""
    secant = np.diff(value, axis=0) / width[:, None]
    if len(value) == 2:
        return np.repeat(secant, 2, axis=0)
    slopes = compute_inner_slopes(width, value)
    slopes[0] = _end(width[0], width[1], secant[0], secant[1])
    slopes[-1] = _end(width[-1], width[-2], secant[-1], secant[-2])
    return slopes


def _end(near: np.float64, far: np.float64, first: Floats, second: Floats) -> Floats:
    """Return the slope at an end from the widths and secants of the two cells beside it."""
    slope = ((2.0 * near + far) * first - near * second) / (near + far)
    slope = np.where(slope * first > 0.0, slope, 0.0)
    too_steep = (first * second < 0.0) & (np.abs(slope) > 3.0 * np.abs(first))
    return np.where(too_steep, 3.0 * first, slope)
