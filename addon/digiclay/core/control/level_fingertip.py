"""Underside of a level fingertip of any size, elongation and turn, and its slopes.

The squared reduced radius of a cell is ``q = M ((1 - e) u² + (1 + e) v² - 2 d u v)``, with u and v from the
lowest point along x and y. A fingertip with the semi-axes a and b has ``M = (1/a² + 1/b²) / 2``; turned by φ
``e = n cos 2φ`` and ``d = n sin 2φ`` with ``n = (a² - b²) / (a² + b²)``. q is linear in e and d, as it is not
in φ: a fingertip across the expected one is found like any other. The underside depends on q alone, and goes
with the size k: ``H = z + k h(q)``, ``M ~ 1/k²``. So its slopes follow from those of q and h'.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..model.fingertip import LEVEL, Fingertip, compute_forms, join_surfaces

#: Coefficients of 1, x, y, x², x y, y².
Form = tuple[float, float, float, float, float, float]


class Place(NamedTuple):
    """Place of a level fingertip.

    Attributes
    ----------
    x, y, z : float
        Lowest point, m.
    size : float
        Logarithm of its size over the known one.
    along, askew : float
        Elongation along x, and along the diagonal between x and y; see above.
    """

    x: float
    y: float
    z: float
    size: float
    along: float
    askew: float


class Slopes(NamedTuple):
    """Underside over cells, and its slopes.

    Attributes
    ----------
    under : ndarray (m,)
        m.
    slopes : ndarray (6, m)
        By size, x, y, the two elongations and z.
    """

    under: Floats
    slopes: Floats


class _Profile(NamedTuple):
    """Numbers of ``h(q) = slope q - lowest + (sqrt(max(bend (1 - q), least)) - root)²``.

    They are those of `fingertip.compute_forms`.

    Attributes
    ----------
    mean : float
        M of the known fingertip, 1/m².
    slope, bend, lowest, least : float
        m.
    root : float
        Root of `least`.
    """

    mean: float
    slope: float
    bend: float
    lowest: float
    least: float
    root: float

    def resize(self, size: float) -> _Profile:
        """Return the numbers of k h(q), and M, at the logarithm of a size."""
        k = math.exp(size)
        mean, slope, bend, lowest, least, root = self
        return _Profile(mean / (k * k), k * slope, k * bend, k * lowest, k * least, math.sqrt(k) * root)


@dataclass(frozen=True, eq=False)
class LevelFingertip:
    """Known fingertip, level.

    Attributes
    ----------
    fingertip : Fingertip
    """

    fingertip: Fingertip

    @cached_property
    def elongation(self) -> float:
        """Elongation n of the known fingertip, below 0 where it is wider than long."""
        length, width = self.fingertip.length**2, self.fingertip.width**2
        return (length - width) / (length + width)

    @cached_property
    def _profile(self) -> _Profile:
        """What the underside is computed with."""
        outline = self.fingertip.outline(np.array([[0.0, 0.0, 0.0, *LEVEL]]))
        (inner, tangent), join = compute_forms(outline)
        bend, (least, root) = inner[0], join.ravel()
        lowest = (math.sqrt(bend) - root) ** 2
        mean, slope = 0.5 * (outline[0, 3] + outline[0, 5]), tangent[3] / outline[0, 3]
        return _Profile(*map(float, (mean, slope, bend, lowest, least, root)))

    def find_underside(self, place: Place, basis: Floats) -> Floats:
        """Return the underside over cells, (m,), m.

        `basis` (6, m), rows 1, x, y, x², x y, y² of the cells.
        """
        known = self._profile.resize(place.size)
        inner, tangent = np.array(_list_surfaces(known, place, _find_radius(known, place))).dot(basis)
        return join_surfaces(inner, tangent, known.least, known.root)

    def measure(self, place: Place, basis: Floats) -> Slopes:
        """Return the underside over cells, with its slopes.

        `basis` (6, m), rows 1, x, y, x², x y, y² of the cells.
        """
        known = self._profile.resize(place.size)
        radius = _find_radius(known, place)
        rows = np.empty((8, basis.shape[1]))
        forms = (*_list_surfaces(known, place, radius), *_list_slopes(known, place, radius))
        np.array(forms).dot(basis, out=rows[:7])
        under, tangent, slopes = rows[0], rows[1], rows[2:]
        bend = np.sqrt(np.maximum(under, known.least))
        join_surfaces(under, tangent, known.least, known.root)
        # h'(q) of each cell: what the slopes of q are to be multiplied with.
        np.divide(known.bend * known.root, bend, out=bend)
        bend += known.slope - known.bend
        slopes[:5] *= bend
        # With the size h grows, while q shrinks.
        slopes[0] += under
        slopes[0] -= place.z
        slopes[5] = 1.0
        return Slopes(under, slopes)


def _find_radius(known: _Profile, place: Place) -> Form:
    """Return q."""
    x, y, _, _, along, askew = place
    mean = known.mean
    return _place_form(x, y, mean * (1.0 - along), -2.0 * mean * askew, mean * (1.0 + along))


def _place_form(x: float, y: float, xx: float, xy: float, yy: float) -> Form:
    """Return a quadratic form of the distance from a point."""
    by_x, by_y = 2.0 * xx * x + xy * y, xy * x + 2.0 * yy * y
    return (0.5 * (by_x * x + by_y * y), -by_x, -by_y, xx, xy, yy)


def _list_surfaces(known: _Profile, place: Place, radius: Form) -> tuple[Form, Form]:
    """Return what `fingertip.join_surfaces` joins: ``bend (1 - q)``, and ``z - lowest + slope q``."""
    one, x, y, xx, xy, yy = radius
    r, t = -known.bend, known.slope
    return (
        (r * one - r, r * x, r * y, r * xx, r * xy, r * yy),
        (t * one + place.z - known.lowest, t * x, t * y, t * xx, t * xy, t * yy),
    )


def _list_slopes(known: _Profile, place: Place, radius: Form) -> tuple[Form, ...]:
    """Return the slopes of q by size, x, y and the two elongations."""
    one, x, y, xx, xy, yy = radius
    mean = known.mean
    return (
        (-2.0 * one, -2.0 * x, -2.0 * y, -2.0 * xx, -2.0 * xy, -2.0 * yy),
        (-x, -2.0 * xx, -xy, 0.0, 0.0, 0.0),
        (-y, -xy, -2.0 * yy, 0.0, 0.0, 0.0),
        _place_form(place.x, place.y, -mean, 0.0, mean),
        _place_form(place.x, place.y, 0.0, -2.0 * mean, 0.0),
    )
