"""Membrane skin: Laplace's equation between the flat ends of the pins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .formed import Formed
from .skin_mesh import make_skin

#: The skin is as wanted when no point would move further than this under its own pull, m.
STILL = 1e-9
#: A point is at most a pitch or so from a fixed one: some 40 rounds settle a bed of any size.
ROUNDS = 1000


def relax_membrane(formed: Formed, position: Floats, start: Floats, parts: int, cap: float) -> Floats:
    """Return the heights of the skin, m, shape (rows, columns) of its points.

    Finite elements on the triangles of the skin; the points on a pin's end keep its height.

    `formed`: the pins; `position` (rows, columns, 2), the skin's points, m; `start` (rows, columns), heights
    to begin with, m, those of the pins at the pins; `parts`: points a pitch; `cap`: radius of a pin's flat
    end, m.
    """
    flat = position.reshape(-1, 2)
    height, free = _laid(formed, position, start, parts, cap)
    faces = make_skin(flat, np.zeros(len(flat)), *start.shape)
    stiffness = _Stiffness(flat, faces)
    # Conjugate gradients on the free points, with the diagonal taken out.
    weight = np.where(free, 1.0 / stiffness.diagonal, 0.0)
    rest = -stiffness(height) * free
    step = weight * rest
    direction, power = step, float(rest @ step)
    for _ in range(ROUNDS):
        if np.abs(step).max() <= STILL:
            break
        pull = stiffness(direction) * free
        length = power / float(direction @ pull)
        height = height + length * direction
        rest = rest - length * pull
        step = weight * rest
        power, former = float(rest @ step), power
        direction = step + power / former * direction
    return height.reshape(start.shape)


def _laid(
    formed: Formed, position: Floats, start: Floats, parts: int, cap: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return heights with every end of a pin level, and which points no pin carries."""
    height, free = start.copy(), np.ones(start.shape, bool)
    pins = position[::parts, ::parts]
    reach = int(np.ceil(cap / min(formed.pitch, formed.row_spacing) * parts * 1.5)) + 1
    lines, points = start.shape
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            row = np.arange(formed.rows) * parts + down
            column = np.arange(formed.columns) * parts + across
            inside = ((row >= 0) & (row < lines))[:, None] & ((column >= 0) & (column < points))
            spot = np.ix_(np.clip(row, 0, lines - 1), np.clip(column, 0, points - 1))
            near = inside & (np.sum((position[spot] - pins) ** 2, axis=-1) <= (cap * (1.0 + 1e-9)) ** 2)
            at = spot[0].repeat(formed.columns, 1)[near], spot[1].repeat(formed.rows, 0)[near]
            height[at] = start[::parts, ::parts][near]
            free[at] = False
    height[::parts, ::parts], free[::parts, ::parts] = start[::parts, ::parts], False
    return height.ravel(), free.ravel()


class _Stiffness:
    """The cotangent Laplacian of a flat triangle mesh, applied to heights."""

    def __init__(self, position: Floats, faces: NDArray[np.int32]) -> None:
        starts, ends, weights = [], [], []
        for corner in range(3):
            tip, start, end = (faces[:, (corner + k) % 3] for k in range(3))
            one, other = position[start] - position[tip], position[end] - position[tip]
            area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
            weight = 0.5 * np.sum(one * other, axis=1) / area
            kept = np.abs(weight) > 1e-12  # across a right angle nothing pulls
            starts.append(start[kept])
            ends.append(end[kept])
            weights.append(weight[kept])
        self._start, self._end = np.concatenate(starts), np.concatenate(ends)
        self._weight, self._count = np.concatenate(weights), len(position)
        self.diagonal = self._gathered(self._weight, self._weight)

    def __call__(self, height: Floats) -> Floats:
        """Return the pull on each point, m."""
        pull = self._weight * (height[self._start] - height[self._end])
        return self._gathered(pull, -pull)

    def _gathered(self, at_start: Floats, at_end: Floats) -> Floats:
        """Add up what the edges give to their ends."""
        total: Floats = np.zeros(self._count)
        total += np.bincount(self._start, at_start, self._count)
        total += np.bincount(self._end, at_end, self._count)
        return total
