"""Direction of the fingertip, and the cells behind it (Fig. 6 of the paper).

The direction depends on the distance traveled, not on speed: a fingertip that slows down or rests
keeps its direction, and cells that it has formed are not called back. The basis of cells has the
rows 1, x, y, x², x y, y², (6, m) of one run or (6, m, b) of a batch; numbers that differ between
runs are (b,).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Floats

#: A direction is opposite to another when the cosine of the angle between them is below this.
BACK = -0.5
#: A fingertip moves off the bed if the cosine between its direction and the outward normal is above
#: this: under one that moves along the rim the centroid of the forces varies.
OUTWARD = 0.1


#: Parts of a meter to which the position of a fingertip is rounded. A blister that rises under a
#: fingertip on a line of symmetry may be unstable across it: rounding errors must not grow.
PARTS = 1e13


class Rim(NamedTuple):
    """Outer cells of a bed: fewer of them carry a fingertip that leaves the bed, and must not rise for it."""

    x: float
    y: float
    """Distances of the outer cells from the middle, m; infinite in a bed no wider than a fingertip."""
    reach: float
    """Distance ahead of a fingertip at which cells carry it, m."""

    def is_under(self, x: float, y: float, farther: float = 0.0) -> bool:
        """Tell whether a position, m, moved outwards by `farther`, m, is over the outer cells or beyond."""
        return abs(x) + farther > self.x or abs(y) + farther > self.y

    def is_ahead(self, x: float, y: float, toward_x: float, toward_y: float) -> bool:
        """Tell whether a fingertip at a position, m, is near the rim and moves off the bed."""
        out_x, out_y = math.copysign(toward_x, toward_x * x), math.copysign(toward_y, toward_y * y)
        return (out_x > OUTWARD and abs(x) + self.reach * out_x > self.x) or (
            out_y > OUTWARD and abs(y) + self.reach * out_y > self.y
        )


class Heading(NamedTuple):
    """Position of the last direction, m, and the direction: a unit vector, 0, 0 before any travel."""

    x: float = 0.0
    y: float = 0.0
    toward_x: float = 0.0
    toward_y: float = 0.0


def update_heading(
    heading: Heading, x: float, y: float, travel: float, reversal: float = 0.0
) -> Heading:
    """Return the heading of a fingertip at x, y, m; a new one after a distance `travel`, m.

    A direction within 60 degrees of the opposite one takes `reversal`, m, if that is longer: on a
    slope the centroid of the forces varies under a fingertip that moves straight on.
    """
    dx, dy = x - heading.x, y - heading.y
    gone = math.hypot(dx, dy)
    along = dx * heading.toward_x + dy * heading.toward_y
    if not gone or gone < travel - TIE or (gone < reversal - TIE and along < BACK * gone - TIE):
        return heading
    return Heading(x, y, dx / gone, dy / gone)


def measure_offsets(
    x: Any, y: Any, toward_x: Any, toward_y: Any, basis: Floats
) -> tuple[Floats, Floats]:
    """Return the distances of cells from a point, and ahead of it in a direction, (m[, b]) each, m.

    Points and directions (m,): one per cell, for cells of several fingers.
    """
    if basis.ndim == 2 and not isinstance(x, np.ndarray):  # one product
        forward = (-x * toward_x - y * toward_y, toward_x, toward_y, 0.0, 0.0, 0.0)
        distance, ahead = np.array((_circle(x, y), forward)).dot(basis)
        np.abs(distance, distance)  # at the point itself rounding may leave a negative square
    else:
        dx, dy = basis[1] - x, basis[2] - y
        ahead = dx * toward_x
        ahead += dy * toward_y
        dx *= dx
        dy *= dy
        distance = np.add(dx, dy, out=dx)
    np.sqrt(distance, distance)
    return distance, ahead


def measure_excess(x: Any, y: Any, radius: Any, basis: Floats) -> Floats:
    """Return squared distances from a point less the square of a radius, (m[, b]), m²."""
    if basis.ndim == 2:  # one product
        return np.array(_circle(x, y, radius)).dot(basis)
    dx, dy = basis[1] - x, basis[2] - y
    dx *= dx
    dy *= dy
    square: Floats = np.add(dx, dy, out=dx)
    square -= radius * radius
    return square


def _circle(x: float, y: float, radius: float = 0.0) -> tuple[float, ...]:
    """Return the squared distance from a point, less that of a circle about it, as a form in 1, x, ... y²."""
    return (x * x + y * y - radius * radius, -2.0 * x, -2.0 * y, 1.0, 0.0, 1.0)


def measure_square(x: Floats | float, y: Floats | float, basis: Floats) -> Floats:
    """Return squared distances from one point, (m,), or from s points, (s, m), m²."""
    ones = x * 0.0 + 1.0
    form = np.array([x * x + y * y, -2.0 * x, -2.0 * y, ones, 0.0 * ones, ones]).T
    square: Floats = form.dot(basis)
    np.abs(square, square)  # at a point itself rounding may leave a negative one
    return square
