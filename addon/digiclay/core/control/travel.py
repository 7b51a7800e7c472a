"""Direction of the fingertip, and the cells behind it (Fig. 6 of the paper).

The direction is settled by distance travelled, not by speed: a finger that slows down or
rests keeps its direction, and what it has formed is not called back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["ABEAM", "Heading", "ahead_of", "beyond", "seen_from", "square_distance", "turned"]

Floats = NDArray[np.float64]

#: A cell no farther behind than this is abeam, and counts as ahead, m: cells lie in rows that a finger
#: may cross at a right angle, and rounding must not decide on them.
ABEAM = 1e-12


class Heading(NamedTuple):
    """Position of the last direction, m, and the direction: a unit vector, 0, 0 before any travel."""

    x: float = 0.0
    y: float = 0.0
    toward_x: float = 0.0
    toward_y: float = 0.0


def turned(heading: Heading, x: float, y: float, travel: float) -> Heading:
    """Return the heading of a finger that is now at x, y, m; new once it has travelled `travel`, m."""
    dx, dy = x - heading.x, y - heading.y
    way = math.hypot(dx, dy)
    return heading if way < travel else Heading(x, y, dx / way, dy / way)


def ahead_of(heading: Heading, x: float, y: float, place: Floats) -> Floats:
    """Return how far cells lie ahead of a point, m; negative behind it, 0 before any travel.

    Parameters
    ----------
    heading : Heading
    x, y : float
        The point, m.
    place : ndarray (6, m)
        Rows 1, x, y, ... of the cells.
    """
    _, _, toward_x, toward_y = heading
    ahead: Floats = np.dot([-x * toward_x - y * toward_y, toward_x, toward_y], place[:3])
    return ahead


def seen_from(heading: Heading, x: float, y: float, place: Floats) -> tuple[Floats, Floats]:
    """Return distances from a point, and how far cells lie ahead of it, see `ahead_of`; shape (m,), m.

    Parameters
    ----------
    heading : Heading
    x, y : float
        The point, m.
    place : ndarray (6, m)
        Rows 1, x, y, x², x y, y² of the cells.
    """
    _, _, toward_x, toward_y = heading
    forward = (-x * toward_x - y * toward_y, toward_x, toward_y, 0.0, 0.0, 0.0)
    distance, ahead = np.array((_circle(x, y), forward)).dot(place)
    np.abs(distance, distance)  # at the point itself rounding may leave a negative square
    np.sqrt(distance, distance)
    return distance, ahead


def beyond(x: float, y: float, radius: float, place: Floats) -> Floats:
    """Return by how much the squares of distances from a point exceed that of a radius, shape (m,), m².

    Parameters
    ----------
    x, y, radius : float
        m.
    place : ndarray (6, m)
        Rows 1, x, y, x², x y, y² of the cells.
    """
    excess: Floats = np.array(_circle(x, y, radius)).dot(place)
    return excess


def _circle(x: float, y: float, radius: float = 0.0) -> tuple[float, ...]:
    """Return the squared distance from a point, less that of a circle about it, as a form in 1, x, ... y²."""
    return (x * x + y * y - radius * radius, -2.0 * x, -2.0 * y, 1.0, 0.0, 1.0)


def square_distance(x: Floats | float, y: Floats | float, place: Floats) -> Floats:
    """Return squared distances from one point, shape (m,), or from s points, shape (s, m), m².

    Parameters
    ----------
    x, y : float or ndarray (s,)
        m.
    place : ndarray (6, m)
        Rows 1, x, y, x², x y, y² of the cells.
    """
    one = x * 0.0 + 1.0
    form = np.array([x * x + y * y, -2.0 * x, -2.0 * y, one, 0.0 * one, one]).T
    square: Floats = form.dot(place)
    np.abs(square, square)  # at a point itself rounding may leave a negative one
    return square
