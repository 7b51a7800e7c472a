"""Extended Kalman filter of the fingertip: position, velocity, turn and size, from undersides over cells.

The state is x, y, z of the lowest point, m; their velocities, m/s; the turn about the vertical, rad; the
logarithm of the fingertip's size over the known one. Size and turn are what undersides tell of the rest: a
pulp that is stiffer than known makes the fingertip look flatter, that is larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model.fingertip import Fingertip, compute_forms, compute_underside

__all__ = ["Estimate", "FingerFilter", "Slopes", "Spread", "invert_small"]

Floats = NDArray[np.float64]

#: Places in the state of what an underside depends on: x, y, z, turn, size.
SEEN = np.array([0, 1, 2, 6, 7])
STATES = 8
EYE = np.eye(5)
#: Differences with which slopes are taken, m; and in turn, rad, and size.
STEP, SMALL = 1e-5, 1e-3
#: Points from which the slopes by x and y are taken, m.
STEPS_X, STEPS_Y = np.array([[0.0], [STEP], [0.0]]), np.array([[0.0], [0.0], [STEP]])
#: Turn, rad, and size are rounded to these for the outline; slopes make up for the rest.
ROUNDED = (0.02, 0.01)
#: Outlines that are kept.
KEPT = 256
#: The size is at most this, as a logarithm: a factor of 2.7.
LARGEST = 1.0
#: Standard deviations before the first contact: m, m/s, rad, 1.
FIRST = (2e-3, 2e-3, 1e-3, 2e-2, 2e-2, 2e-2, 0.5, 0.1)


class Estimate(NamedTuple):
    """Estimated fingertip.

    Attributes
    ----------
    mean : ndarray (8,)
        State.
    covariance : ndarray (8, 8)
    """

    mean: Floats
    covariance: Floats


class Slopes(NamedTuple):
    """Underside over cells, and its slopes.

    Attributes
    ----------
    under : ndarray (m,)
        m.
    slopes : ndarray (5, m)
        By x, y, z, turn and size.
    """

    under: Floats
    slopes: Floats


@dataclass(frozen=True)
class Spread:
    """Standard deviations of a finger's motion, and of what the model leaves out.

    Attributes
    ----------
    acceleration : float
        m/s².
    turn, size : float
        Change within a second, rad and 1.
    underside : float
        m.
    """

    acceleration: float
    turn: float
    size: float
    underside: float


@dataclass(frozen=True, eq=False)
class FingerFilter:
    """Filter of a known fingertip.

    Attributes
    ----------
    fingertip : Fingertip
    spread : Spread
    period : float
        Control period, s.
    """

    fingertip: Fingertip
    spread: Spread
    period: float

    def begin(self, x: float, y: float, z: float) -> Estimate:
        """Return the estimate of a fingertip that has just touched, at rest.

        Parameters
        ----------
        x, y, z : float
            Lowest point, m.
        """
        return Estimate(np.array([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0]), np.diag(np.square(FIRST)))

    def predict(self, before: Estimate) -> Estimate:
        """Return the estimate a control period later, before its measurement."""
        step, noise = self._motion
        return Estimate(step.dot(before.mean), step.dot(before.covariance).dot(step.T) + noise)

    @cached_property
    def _motion(self) -> tuple[Floats, Floats]:
        """Transition of the state, and covariance of what is random: white acceleration, drifting shape."""
        time, spread = self.period, self.spread
        step, noise = np.eye(STATES), np.zeros((STATES, STATES))
        strength = spread.acceleration**2 * time
        for place in range(3):
            speed = place + 3
            step[place, speed] = time
            noise[place, place] = strength * time * time / 3.0
            noise[place, speed] = noise[speed, place] = strength * time / 2.0
            noise[speed, speed] = strength
        noise[6, 6], noise[7, 7] = spread.turn**2 * time, spread.size**2 * time
        return step, noise

    def correct(self, guess: Estimate, at: Slopes, seen: Floats, variance: Floats) -> tuple[Estimate, Floats]:
        """Return an estimate corrected by measured undersides, and what it leaves of their errors, m.

        Parameters
        ----------
        guess : Estimate
        at : Slopes
            Undersides of `guess`.
        seen : ndarray (m,)
            Measured, m.
        variance : ndarray (m,)
            m².
        """
        slopes = at.slopes
        weighted = slopes / variance
        weight = weighted.dot(slopes.T)
        wide = guess.covariance[:, SEEN]
        spread = weight.dot(wide.T)
        gain = wide.dot(invert_small(EYE + spread[:, SEEN]))
        error = seen - at.under
        change = gain.dot(weighted.dot(error))
        covariance = guess.covariance - gain.dot(spread)
        error -= change[SEEN].dot(slopes)
        mean = guess.mean + change
        mean[7] = min(max(mean[7], -LARGEST), LARGEST)
        return Estimate(mean, 0.5 * (covariance + covariance.T)), error

    def measure(self, mean: Floats, basis: Floats) -> Slopes:
        """Return the undersides of an estimated fingertip over cells, with their slopes.

        Parameters
        ----------
        mean : ndarray (8,)
            State.
        basis : ndarray (6, m)
            Rows 1, x, y, ... of the cells.
        """
        x, y, z, _, _, _, turn, size = mean.tolist()
        count = basis.shape[1]
        rows = self._look_up(turn, size, _shift(basis, x + STEPS_X, y + STEPS_Y))
        slopes = np.empty((5, count))
        slopes[2] = 1.0
        slopes[3:] = rows[1:, :count]
        under = rows[0].reshape(3, count)
        np.subtract(under[1:], under[0], out=slopes[:2])
        slopes[:2] *= 1.0 / STEP
        return Slopes(under[0] + z, slopes)

    def find_underside(self, place: tuple[float, float, float], known: Estimate, basis: Floats) -> Floats:
        """Return the underside over cells, (m,), m, of the estimated fingertip at another place.

        Parameters
        ----------
        place : tuple of float
            x, y, z of the lowest point, m.
        known : Estimate
            Gives turn and size.
        basis : ndarray (6, m)
            Rows 1, x, y, ... of the cells.
        """
        x, y, z = place
        *_, turn, size = known.mean.tolist()
        under: Floats = self._look_up(turn, size, _shift(basis, np.array([[x]]), np.array([[y]])))[0]
        under += z
        return under

    def _look_up(self, turn: float, size: float, basis: Floats) -> Floats:
        """Return the underside about its lowest point, m, and its slopes by turn and size, (3, m)."""
        near_turn, near_size = (round(turn / ROUNDED[0]) * ROUNDED[0], round(size / ROUNDED[1]) * ROUNDED[1])
        rows = compute_underside(*_outline(self.fingertip, near_turn, near_size), basis)
        rows[1:] -= rows[0]
        rows[1:] *= 1.0 / SMALL
        rows[0] += np.dot((turn - near_turn, size - near_size), rows[1:])
        return rows


@lru_cache(KEPT)
def _outline(fingertip: Fingertip, turn: float, size: float) -> tuple[Floats, Floats]:
    """Return forms of a level fingertip, of one turned a little more, and of one a little larger."""
    outlines = []
    for angle, log in ((turn, size), (turn + SMALL, size), (turn, size + SMALL)):
        axes = (fingertip.length, fingertip.width, fingertip.height)
        scaled = Fingertip(*(axis * math.exp(log) for axis in axes))
        pose = np.array([[0.0, 0.0, 0.0, math.cos(angle / 2.0), 0.0, 0.0, math.sin(angle / 2.0)]])
        outlines.append(scaled.outline(pose)[0])
    return compute_forms(np.array(outlines))


def _shift(basis: Floats, x: Floats, y: Floats) -> Floats:
    """Return the rows 1, x, y, x², x y, y² of m cells as seen from c points, (6, c m).

    Parameters
    ----------
    basis : ndarray (6, m)
    x, y : ndarray (c, 1)
        m.
    """
    moved = np.empty((6, len(x), basis.shape[1]))
    moved[0] = 1.0
    np.subtract(basis[1], x, out=moved[1])
    np.subtract(basis[2], y, out=moved[2])
    np.multiply(moved[1], moved[1:3], out=moved[3:5])
    np.multiply(moved[2], moved[2], out=moved[5])
    return moved.reshape(6, -1)


def invert_small(matrix: Floats) -> Floats:
    """Return the inverse of a matrix of a few rows by elimination with pivots, in plain numbers.

    LAPACK wakes threads, which takes milliseconds on a busy machine.

    Parameters
    ----------
    matrix : ndarray (n, n)
    """
    size = len(matrix)
    rows = [row + unit for row, unit in zip(matrix.tolist(), np.eye(size).tolist(), strict=True)]
    for column in range(size):
        pivot = max(range(column, size), key=[abs(row[column]) for row in rows].__getitem__)
        head = rows[pivot]
        rows[pivot] = rows[column]
        scale = 1.0 / head[column]
        rows[column] = head = [value * scale for value in head]
        for other in range(column + 1, size):
            factor = rows[other][column]
            rows[other] = [a - factor * b for a, b in zip(rows[other], head, strict=True)]
    upper = np.array(rows)
    made = upper[:, size:]
    for row in range(size - 2, -1, -1):
        made[row] -= upper[row, row + 1 : size].dot(made[row + 1 :])
    return made
