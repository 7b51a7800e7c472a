"""Filling of small holes of an open mesh, such as a scan."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from ..model.layout import Grid
from ..surface.regions import label_components

#: A hole is small if no more than this share of the covered pins stands under it.
SMALL = 0.05
#: How often the heights over holes are evened out, after they have been reached from all sides.
ROUNDS = 300


def fill_holes(grid: Grid, value: Floats, missing: Flags) -> tuple[Floats, Flags]:
    """Return the values with those over small holes taken from around, and which pins these are.

    A hole is a group of neighboring pins that the surface misses, with pins under the surface all
    around: a group that reaches the rim of the bed is what lies beside the shape. The values over it
    are the flattest that join those around it: each becomes the mean of its neighbors.

    `value` (n,); `missing` bool (n,), pins whose value is not that of the surface.
    """
    beside = grid.layout.find_neighbors(corners=False)
    number = np.flatnonzero(missing)
    position = np.full(grid.count + 1, -1)  # the last one, at -1, stands for what is beyond the rim
    position[number] = np.arange(number.size)
    joined = position[beside[number]]
    start = np.repeat(np.arange(number.size), joined.shape[1])
    edges = np.column_stack([start, joined.ravel()])[joined.ravel() >= 0]
    group = label_components(number.size, edges)
    size = np.bincount(group, minlength=number.size)
    at_rim = np.zeros(number.size, np.bool_)
    at_rim[group[(beside[number] < 0).any(axis=1)]] = True
    small = (size <= SMALL * (grid.count - number.size)) & ~at_rim
    hole = np.zeros(grid.count, np.bool_)
    hole[number[small[group]]] = True
    return _evened(value, hole, beside), hole


def _evened(value: Floats, hole: Flags, beside: Cells) -> Floats:
    """Return the values with those in holes between those around: first ring by ring, then evened out."""
    found, waiting = value.copy(), hole.copy()
    while waiting.any():
        cells = np.flatnonzero(waiting)
        known = ~waiting[beside[cells]]  # a hole has no neighbor beyond the rim
        ring = known.any(axis=1)
        sums = np.where(known, found[beside[cells]], 0.0).sum(axis=1)
        found[cells[ring]] = sums[ring] / known.sum(axis=1)[ring]
        waiting[cells[ring]] = False
    cells = np.flatnonzero(hole)
    for _ in range(ROUNDS if cells.size else 0):
        found[cells] = found[beside[cells]].mean(axis=1)
    return found
