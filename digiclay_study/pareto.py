"""Pareto fronts of two outputs to be minimized, and the choice of a point on one."""

from __future__ import annotations

import numpy as np
from digiclay.core.base.arrays import Floats
from numpy.typing import NDArray


def find_front(values: Floats) -> NDArray[np.intp]:
    """Return the points that no other dominates, ordered by the first output.

    A point dominates another if it is at most as large in both outputs, and less in one. Of equal points the
    first one is returned.

    `values` (points, 2), points with a NaN are on no front.
    """
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    order = known[np.lexsort((values[known, 1], values[known, 0]))]
    front, least = [], np.inf
    for point in order:
        if values[point, 1] < least:
            least = values[point, 1]
            front.append(point)
    return np.array(front, dtype=np.intp)


def find_knee(front: Floats) -> int:
    """Return the index of the point of a front that is farthest below the line between its ends.

    With both outputs scaled to 0 to 1 over the front, the ends are (0, 1) and (1, 0), and that point has the
    least sum. It is the place where less of one output begins to cost much of the other.

    `front` (k, 2), of at least one point, ordered by the first output.
    """
    extent = np.ptp(front, axis=0)
    scaled = (front - front.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    return int(np.argmin(scaled.sum(axis=1)))
