"""Heights that Smooth and Flatten leave of a surface, and flanks where it would have steps. No Blender."""

import math

import numpy as np

from ..core.base.arrays import Cells, Floats
from ..core.control.exchange import make_exchange
from ..core.model.layout import Grid

#: What a weight of 1 spreads: diffusivity times time, in squares of the ring's radius. One stroke
#: leaves about an eighth of what differs from pin to pin.
SPREAD = 0.2
#: Steps of a diffusion over a pitch: more change heights by less than 1 %.
STEPS = 16.0


def smooth(grid: Grid, height: Floats, weight: Floats, radius: float) -> Floats:
    """Return heights (n,), m, after the diffusion ``dh/dt = w D ∇²h`` with weights (n,) from 0 to 1.

    Planes stay, and so do pins without weight. No slope between neighbors becomes steeper than the
    steepest within a radius, m, was.
    """
    plan, amount = grid.layout, SPREAD * radius**2
    beside = grid.find_beside(corners=False)
    cells = np.flatnonzero(weight[beside].any(axis=1) | (weight > 0.0))
    count = math.ceil(STEPS * amount / min(plan.pitch, plan.row_spacing) ** 2)
    exchange, smoothed = make_exchange(grid, amount, 1.0 / count), height[cells]
    for _ in range(count):
        smoothed += weight[cells] * (exchange.even_out(cells, smoothed) - smoothed)
    spread = height.copy()
    spread[cells] = smoothed
    length = measure_distances(grid, beside)
    steep = np.abs(height[beside] - height[:, None]) / np.where(length > 0.0, length, 1.0)
    steepest = steep.max(axis=1)
    for _ in range(math.ceil(radius / plan.pitch)):
        steepest = steepest[beside].max(axis=1).clip(steepest)
    limit = np.maximum(steepest[:, None], steepest[beside]) * length
    # Across the edge of the weights a slope can become steeper where the surface bends along it.
    fixed = weight == 0.0
    low = -bound(beside, limit, np.where(fixed, -height, np.inf))
    high = bound(beside, limit, np.where(fixed, height, np.inf))
    return np.where(fixed, height, bound(beside, limit, spread).clip(low, high))


def slant(grid: Grid, formed: Floats, before: Floats, slope: float) -> Floats:
    """Return the highest heights (n,), m, up to `formed` that are no steeper than a slope.

    The surface `before` stays as steep as it is, and so does what is formed of it.
    """
    beside = grid.find_beside(corners=True)
    length = measure_distances(grid, beside)
    limit = np.maximum(slope * length, np.abs(before[beside] - before[:, None]))
    changed = formed != before
    inside = changed[beside] & changed[:, None]
    limit = np.maximum(limit, np.where(inside, np.abs(formed[beside] - formed[:, None]), 0.0))
    return bound(beside, limit, formed)


def measure_distances(grid: Grid, beside: Cells) -> Floats:
    """Return the distances of cells from those `beside` each, (n, k), m."""
    return np.hypot(grid.x[beside] - grid.x[:, None], grid.y[beside] - grid.y[:, None])


def bound(beside: Cells, limit: Floats, values: Floats) -> Floats:
    """Return the largest values (n,) that are none above `values` and differ by no more than limits.

    `limit` (n, k): largest difference from each of the cells `beside` (n, k).
    """
    while True:
        lower = np.minimum(values, (values[beside] + limit).min(axis=1))
        if np.array_equal(lower, values):
            return values
        values = lower


def flatten(grid: Grid, height: Floats, weight: Floats, limit: float) -> Floats:
    """Return how far, m, pins (n,) move by their weights to the plane that fits them best."""
    basis, root = np.column_stack([np.ones(grid.count), grid.positions]), np.sqrt(weight)
    plane, *_ = np.linalg.lstsq(root[:, None] * basis, root * height, rcond=None)
    move: Floats = (weight * (basis @ plane - height)).clip(-limit, limit)
    return move
