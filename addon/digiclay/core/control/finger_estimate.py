"""Extended Kalman filter of the fingertip: position, velocity, size and elongation, from the undersides.

The state is x, y, z of the lowest point, m; their velocities, m/s; the logarithm of the fingertip's size over
the known one; its elongation along x and along the diagonal (`level_fingertip`). The last three are the
curvatures of the underside at the lowest point, which take in what is known wrongly: a pulp that is stiffer
than known makes the fingertip look flatter, that is larger; a fingertip too long, or tilted, is elongated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..model.fingertip import Fingertip
from .level_fingertip import LevelFingertip, Place, Slopes

#: Places in the state of what an underside depends on, in the order of `Slopes`: size, x, y, turn, z.
SEEN = np.array([6, 0, 1, 7, 8, 2])
STATES = 9
EYE = np.eye(6)
#: The size is at most this, as a logarithm: a factor of 2.7.
LARGEST = 1.0
#: The elongation is at most this: three times as long as wide.
LONGEST = 0.8
#: The elongation drifts like that of a turning fingertip whose own is at least this.
LEAST = 0.05
#: Standard deviations before the first contact: m, m/s, 1.
FIRST = (2e-3, 2e-3, 1e-3, 2e-2, 2e-2, 2e-2, 0.1, 0.2, 0.2)


class Estimate(NamedTuple):
    """Estimated fingertip.

    Attributes
    ----------
    mean : ndarray (9,)
        State.
    covariance : ndarray (9, 9)
    """

    mean: Floats
    covariance: Floats


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

        `x`, `y`, `z`: lowest point, m.
        """
        return Estimate(np.array([x, y, z, *(0.0,) * (STATES - 3)]), np.diag(np.square(FIRST)))

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
        noise[6, 6] = spread.size**2 * time
        noise[7, 7] = noise[8, 8] = (2.0 * spread.turn * max(abs(self._level.elongation), LEAST)) ** 2 * time
        return step, noise

    def correct(self, guess: Estimate, at: Slopes, seen: Floats, variance: Floats) -> tuple[Estimate, Floats]:
        """Return an estimate corrected by measured undersides, and what it leaves of their errors, m.

        `at`: undersides of `guess`; `seen` (m,), measured, m; `variance` (m,), m².
        """
        slopes = at.slopes
        error = seen - at.under
        weighted = slopes / variance
        weight = weighted.dot(slopes.T)
        wide = guess.covariance.take(SEEN, 0)
        spread = weight.dot(wide)
        gain = wide.T.dot(invert_six(EYE + spread.take(SEEN, 1)))
        change = gain.dot(weighted.dot(error))
        covariance = guess.covariance - gain.dot(spread)
        error -= change.take(SEEN).dot(slopes)
        mean = guess.mean + change
        *_, size, along, askew = mean.tolist()
        if abs(size) > LARGEST:
            mean[6] = math.copysign(LARGEST, size)
        longest = math.hypot(along, askew)
        if longest > LONGEST:
            mean[7:] *= LONGEST / longest
        return Estimate(mean, 0.5 * (covariance + covariance.T)), error

    def measure(self, mean: Floats, basis: Floats) -> Slopes:
        """Return the undersides of an estimated fingertip over cells, with their slopes.

        `mean` (9,), state; `basis` (6, m), rows 1, x, y, ... of the cells.
        """
        x, y, z, _, _, _, *shape = mean.tolist()
        return self._level.measure(Place(x, y, z, *shape), basis)

    def find_underside(self, place: tuple[float, float, float], known: Estimate, basis: Floats) -> Floats:
        """Return the underside over cells, (m,), m, of the estimated fingertip at another place.

        `place`: x, y, z of the lowest point, m; `known`: gives size and elongation; `basis` (6, m), rows 1,
        x, y, ... of the cells.
        """
        return self._level.find_underside(Place(*place, *known.mean[6:].tolist()), basis)

    @cached_property
    def _level(self) -> LevelFingertip:
        """Underside of the known fingertip."""
        return LevelFingertip(self.fingertip)


def invert_six(matrix: Floats) -> Floats:
    """Return the inverse of a matrix of six rows by elimination with pivots, in plain numbers.

    LAPACK wakes threads, which takes milliseconds on a busy machine.

    `matrix` (6, 6).
    """
    rows: list[tuple[float, ...]] = list(map(tuple, matrix.tolist()))
    swaps = []
    for step in range(6):
        pivot = max(range(step, 6), key=[abs(row[0]) for row in rows].__getitem__)
        if pivot != step:
            rows[step], rows[pivot] = rows[pivot], rows[step]
            swaps.append((step, pivot))
        first, a, b, c, d, e = rows[step]
        scale = 1.0 / first
        head = a, b, c, d, e, _ = a * scale, b * scale, c * scale, d * scale, e * scale, scale
        # The first column is eliminated; that of the inverse comes in as the last one.
        rows = [
            (u - by * a, v - by * b, w - by * c, x - by * d, y - by * e, -by * scale)
            for by, u, v, w, x, y in rows
        ]
        rows[step] = head
    made = np.array(rows)
    for one, other in reversed(swaps):
        made[:, [one, other]] = made[:, [other, one]]
    return made
