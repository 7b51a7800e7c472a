"""Extended Kalman filter of the fingertip: position, velocity, size and elongation, from the undersides.

The state is the lowest point x, y, z, m; its velocity, m/s; the logarithm of the fingertip's size
relative to the nominal one; and the elongations along x and along the diagonal. The last three are
curvatures of the underside at the lowest point. They absorb errors of the model: a pulp stiffer
than the nominal one makes the fingertip look flatter, that is larger; a longer or tilted fingertip
looks elongated. The basis of cells has the rows 1, x, y, x², x y, y², (6, m).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..model.fingertip import LEVEL, Fingertip, compute_forms, join_surfaces
from .finger_sections import WHOLE, Whole

#: Coefficients of 1, x, y, x², x y, y².
Form = tuple[float, float, float, float, float, float]
#: Lowest point of a fingertip, m.
Aim = tuple[float, float, float]


class Tip(NamedTuple):
    """Lowest point of a level fingertip, m, logarithm of its relative size, and elongations."""

    x: float
    y: float
    z: float
    size: float
    along: float
    askew: float


class Slopes(NamedTuple):
    """Underside over cells, (m,), m, and its slopes, (6, m), by size, x, y, the two elongations and z."""

    under: Floats
    slopes: Floats


class _Profile(NamedTuple):
    """Numbers of ``h(q) = slope q - lowest + (sqrt(max(bend (1 - q), least)) - root)²``, m.

    They are those of `fingertip.compute_forms`; `mean`: M of the nominal fingertip, 1/m²; `root`:
    of `least`.
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
        return _Profile(
            mean / (k * k), k * slope, k * bend, k * lowest, k * least, math.sqrt(k) * root
        )


def _find_radius(profile: _Profile, tip: Tip) -> Form:
    """Return q."""
    x, y, _, _, along, askew = tip
    mean = profile.mean
    return _place_form(x, y, mean * (1.0 - along), -2.0 * mean * askew, mean * (1.0 + along))


def _place_form(x: float, y: float, xx: float, xy: float, yy: float) -> Form:
    """Return a quadratic form of the distance from a point."""
    by_x, by_y = 2.0 * xx * x + xy * y, xy * x + 2.0 * yy * y
    return (0.5 * (by_x * x + by_y * y), -by_x, -by_y, xx, xy, yy)


def _list_surfaces(profile: _Profile, tip: Tip, radius: Form) -> tuple[Form, Form]:
    """Return what `fingertip.join_surfaces` joins: ``bend (1 - q)``, and ``z - lowest + slope q``."""
    free, x, y, xx, xy, yy = radius
    r, t = -profile.bend, profile.slope
    return (
        (r * free - r, r * x, r * y, r * xx, r * xy, r * yy),
        (t * free + tip.z - profile.lowest, t * x, t * y, t * xx, t * xy, t * yy),
    )


def _list_slopes(profile: _Profile, tip: Tip, radius: Form) -> tuple[Form, ...]:
    """Return the slopes of q by size, x, y and the two elongations."""
    free, x, y, xx, xy, yy = radius
    mean = profile.mean
    return (
        (-2.0 * free, -2.0 * x, -2.0 * y, -2.0 * xx, -2.0 * xy, -2.0 * yy),
        (-x, -2.0 * xx, -xy, 0.0, 0.0, 0.0),
        (-y, -xy, -2.0 * yy, 0.0, 0.0, 0.0),
        _place_form(tip.x, tip.y, -mean, 0.0, mean),
        _place_form(tip.x, tip.y, 0.0, -2.0 * mean, 0.0),
    )


#: Indices of the state variables that an underside depends on, in the order of `Slopes`.
SEEN = np.array([6, 0, 1, 7, 8, 2])
STATES = 9
EYE = np.eye(6)
#: Digits of the state: rounding errors must not grow where an estimate is unstable across a line of
#: symmetry, as when a single pin at the edge of a bed is touched.
DIGITS = 11
#: The size is at most this, as a logarithm: a factor of 2.7.
LARGEST = 1.0
#: The elongation is at most this: three times as long as wide.
LONGEST = 0.8
#: Least elongation of the turning fingertip that gives the drift of the estimated elongation.
LEAST = 0.05
#: Standard deviations before the first contact: m, m/s, 1.
FIRST = (2e-3, 2e-3, 1e-3, 2e-2, 2e-2, 2e-2, 0.1, 0.2, 0.2)


class Estimate(NamedTuple):
    """Estimated state of the fingertip, (9,), and its covariance, (9, 9)."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True)
class Spread:
    """Standard deviations of a fingertip's motion, and of the model's errors.

    Acceleration, m/s²; turn and relative size within a second, rad and 1; measured underside, m.
    """

    acceleration: float
    turn: float
    size: float
    underside: float


@dataclass(frozen=True, eq=False)
class FingerFilter:
    """Filter for a nominal fingertip; `period`: control period, s."""

    fingertip: Fingertip
    spread: Spread
    period: float

    def begin(self, x: float, y: float, z: float) -> Estimate:
        """Return the estimate of a fingertip that has just touched, at rest; lowest point, m."""
        return Estimate(np.array([x, y, z, *(0.0,) * (STATES - 3)]), np.diag(np.square(FIRST)))

    def predict(self, before: Estimate) -> Estimate:
        """Return the estimate a control period later, before its measurement."""
        step, noise = self._motion
        return Estimate(step.dot(before.mean), step.dot(before.covariance).dot(step.T) + noise)

    @cached_property
    def _motion(self) -> tuple[Floats, Floats]:
        """Transition matrix, and covariance of the process noise: white acceleration, drifting shape."""
        time, spread = self.period, self.spread
        step, noise = np.eye(STATES), np.zeros((STATES, STATES))
        strength = spread.acceleration**2 * time
        for axis in range(3):
            speed = axis + 3
            step[axis, speed] = time
            noise[axis, axis] = strength * time * time / 3.0
            noise[axis, speed] = noise[speed, axis] = strength * time / 2.0
            noise[speed, speed] = strength
        noise[6, 6] = spread.size**2 * time
        length, width = self.fingertip.length**2, self.fingertip.width**2
        elongation = abs(length - width) / (length + width)
        noise[7, 7] = noise[8, 8] = (2.0 * spread.turn * max(elongation, LEAST)) ** 2 * time
        return step, noise

    def correct(
        self,
        guesses: list[Estimate],
        at: Slopes,
        seen: Floats,
        variance: Floats,
        sections: Whole = WHOLE,
    ) -> tuple[list[Estimate], Floats]:
        """Return the estimates after undersides (m,), m, with variances (m,), m², and the errors left, m."""
        error = seen - at.under
        weighted = at.slopes / variance
        parts = map(sections.cut, (at.slopes, weighted, error))
        return [self._update(*finger) for finger in zip(guesses, *parts, strict=True)], error

    def _update(self, guess: Estimate, slopes: Floats, weighted: Floats, error: Floats) -> Estimate:
        """Return the estimate of one finger after errors (m,), m, reduced to the remaining ones in place."""
        weight = weighted.dot(slopes.T)
        wide = guess.covariance.take(SEEN, 0)
        spread = weight.dot(wide)
        gain = wide.T.dot(invert_six(EYE + spread.take(SEEN, 1)))
        change = gain.dot(weighted.dot(error))
        covariance = guess.covariance - gain.dot(spread)
        error -= change.take(SEEN).dot(slopes)
        mean = np.round(guess.mean + change, DIGITS)
        *_, size, along, askew = mean.tolist()
        if abs(size) > LARGEST:
            mean[6] = math.copysign(LARGEST, size)
        longest = math.hypot(along, askew)
        if longest > LONGEST:
            mean[7:] *= LONGEST / longest
        return Estimate(mean, 0.5 * (covariance + covariance.T))

    def measure(self, means: list[Floats], basis: Floats, sections: Whole = WHOLE) -> Slopes:
        """Return the undersides of fingertips of estimated states, (9,), over cells, with their slopes."""
        forms, numbers = [], []
        for mean in means:
            x, y, z, _, _, _, *shape = mean.tolist()
            tip = Tip(x, y, z, *shape)
            profile = self._profile.resize(tip.size)
            radius = _find_radius(profile, tip)
            forms.append(
                (*_list_surfaces(profile, tip, radius), *_list_slopes(profile, tip, radius))
            )
            _, slope, bend, _, least, root = profile
            numbers.append((least, root, bend * root, slope - bend, z))
        least, root, product, rest, z = sections.spread(numbers)
        rows = np.empty((8, basis.shape[1]))
        sections.multiply(forms, basis, rows[:7])
        under, tangent, slopes = rows[0], rows[1], rows[2:]
        bend = np.sqrt(np.maximum(under, least))
        join_surfaces(under, tangent, least, root)
        # h'(q) of each cell, by which the slopes of q are multiplied.
        np.divide(product, bend, out=bend)
        bend += rest
        by_form, by_size = slopes[:5], slopes[0]
        by_form *= bend
        # With the size h grows, while q shrinks.
        by_size += under
        by_size -= z
        slopes[5] = 1.0
        return Slopes(under, slopes)

    def find_underside(
        self, aims: list[Aim], like: list[Estimate], basis: Floats, sections: Whole = WHOLE
    ) -> Floats:
        """Return the undersides over cells, (m,), m, of fingertips like the estimated ones at places, m."""
        surfaces, numbers = [], []
        for aim, estimate in zip(aims, like, strict=True):
            tip = Tip(*aim, *estimate.mean.tolist()[6:])
            profile = self._profile.resize(tip.size)
            surfaces.append(_list_surfaces(profile, tip, _find_radius(profile, tip)))
            numbers.append((profile.least, profile.root))
        inner, tangent = sections.multiply(surfaces, basis)
        return join_surfaces(inner, tangent, *sections.spread(numbers))

    @cached_property
    def _profile(self) -> _Profile:
        """Underside of the nominal fingertip, level."""
        outline = self.fingertip.outline(np.array([[0.0, 0.0, 0.0, *LEVEL]]))
        (inner, tangent), join = compute_forms(outline)
        bend, (least, root) = inner[0], join.ravel()
        lowest = (math.sqrt(bend) - root) ** 2
        mean, slope = 0.5 * (outline[0, 3] + outline[0, 5]), tangent[3] / outline[0, 3]
        return _Profile(*map(float, (mean, slope, bend, lowest, least, root)))


def invert_six(matrix: Floats) -> Floats:
    """Return the inverse of a matrix, (6, 6), by elimination with pivots; NaN of a singular one.

    In plain numbers: LAPACK wakes threads, which takes milliseconds on a busy machine.
    """
    rows: list[tuple[float, ...]] = list(map(tuple, matrix.tolist()))
    swaps = []
    for step in range(6):
        sizes = [abs(row[0]) for row in rows[step:]]
        pivot = step + sizes.index(max(sizes))
        if pivot != step:
            rows[step], rows[pivot] = rows[pivot], rows[step]
            swaps.append((step, pivot))
        first, a, b, c, d, e = rows[step]
        # Singular is only a crafted snapshot: no fit comes of NaN.
        scale = 1.0 / (first or math.nan)
        head = a, b, c, d, e, _ = a * scale, b * scale, c * scale, d * scale, e * scale, scale
        # The first column is eliminated; that of the inverse comes in as the last one.
        rows = [
            (u - by * a, v - by * b, w - by * c, x - by * d, y - by * e, -by * scale)
            for by, u, v, w, x, y in rows
        ]
        rows[step] = head
    inverse = np.array(rows)
    for step, pivot in reversed(swaps):
        inverse[:, [step, pivot]] = inverse[:, [pivot, step]]
    return inverse
