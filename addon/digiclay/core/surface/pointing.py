"""Intersection of a ray with the pins, and the contact of a fingertip pressed there."""

import math
from functools import lru_cache

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.fingertip import Fingertip, make_matrices
from ..model.layout import Grid

#: Steps per pitch at which the height of a ray over the bed is compared.
STEPS = 4
#: Distance behind the middle of an orthographic view at which its rays begin, in its own unit.
BEHIND = 1e5
#: Smaller components of a direction whose largest is 1 count as 0: a division by them may overflow.
PARALLEL = 1e-200


def find_ray(lens: Floats, seen: Floats, screen: Floats) -> tuple[Floats, Floats]:
    """Return origin and unit direction (3,) of the ray through a point of a picture, `screen` (2,), -1 to 1.

    `lens` (4, 4) maps the camera's space to the picture's; `seen` (4, 4) the space of the result to
    the camera's, which looks along -z. Blender's own function has single precision: it is off by up
    to a pixel.
    """
    across = np.array([lens[0, 0], lens[1, 1]])
    if lens[3, 2]:
        eye = np.zeros(3)
        direction = np.array([*((screen + lens[:2, 2]) / across), -1.0])
    else:
        eye = np.array([*((screen - lens[:2, 3]) / across), BEHIND])
        direction = np.array([0.0, 0.0, -1.0])
    inverse = np.linalg.inv(seen)
    direction = inverse[:3, :3] @ direction
    return inverse[:3, :3] @ eye + inverse[:3, 3], direction / np.linalg.norm(direction)


def intersect_surface(
    grid: Grid, height: Floats, origin: Floats, direction: Floats
) -> Floats | None:
    """Return where a ray meets flat tops (n,) without gaps, (3,), m: exactly on a top, or on a pin's side."""
    if not (np.isfinite(origin).all() and np.isfinite(direction).all() and direction.any()):
        return None
    direction = direction / np.abs(direction).max()
    plan = grid.layout
    half = np.array([plan.pitch, plan.row_spacing]) / 2
    low = np.array([grid.x.min() - half[0], grid.y.min() - half[1], height.min()])
    high = np.array([grid.x.max() + half[0], grid.y.max() + half[1], height.max()])
    first, last = _inside(origin, direction, low, high)
    if first > last:
        return None
    length = (last - first) * math.hypot(direction[0], direction[1])
    count = 2 + math.ceil(STEPS * length / min(plan.pitch, plan.row_spacing))
    times = np.linspace(first, last, count)
    points = origin + times[:, None] * direction
    # Rounding must not let the ray slip below the lowest top, nor pass over flat ones.
    points[:, 2] = points[:, 2].clip(low[2], high[2])
    tops = height[grid.at(points[:, 0], points[:, 1])]
    met = np.flatnonzero(points[:, 2] <= tops + 1e-12)
    if not met.size:
        return None
    at = int(met[0])
    start: Floats = points[max(0, at - 1)]
    if at == 0:
        return start
    onto = (tops[at] - origin[2]) / direction[2] if direction[2] else -math.inf
    return origin + onto * direction if times[at - 1] <= onto <= times[at] else start


def _inside(origin: Floats, direction: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Return when a ray enters and leaves a box; the first is after the last when it misses the box."""
    parallel = np.abs(direction) < PARALLEL
    if np.any(parallel & ((origin < low) | (origin > high))):
        return 1.0, 0.0
    times = np.sort((np.stack([low, high]) - origin)[:, ~parallel] / direction[~parallel], axis=0)
    return float(times[0].max(initial=0.0)), float(times[1].min(initial=math.inf))


def find_ground_height(grid: Grid, height: Floats, x: float, y: float, radius: float) -> float:
    """Return the mean height of the pins within a radius of a point, m; without any, that of the nearest."""
    cells = _find_ground(grid, x, y, radius)
    return float(np.add.reduce(height.take(cells))) / cells.size


@lru_cache(maxsize=1)  # strokes look up several surfaces at a place
def _find_ground(grid: Grid, x: float, y: float, radius: float) -> Cells:
    """Return the pins within a radius of a point, m; without any, the nearest one."""
    cells = grid.disc(x, y, radius)
    return cells if cells.size else grid.at(np.array([x]), np.array([y]))


def find_contact_outline(finger: Fingertip, turn: Floats, depth: float) -> Floats:
    """Return the outline of the fingertip (48, 2), m, a depth, m, above its lowest point; `turn` (4,)."""
    rotation = make_matrices(np.asarray(turn, np.float64)[None])[0]
    axes = np.array([finger.length, finger.width, finger.height])
    shape = rotation @ np.diag(axes**-2.0) @ rotation.T
    spread = rotation @ np.diag(axes**2) @ rotation.T
    half = math.sqrt(spread[2, 2])
    level = min(max(depth, 0.0), half) - half  # height of the section over the middle
    flat, tilt = shape[:2, :2], shape[:2, 2]
    lean = np.linalg.solve(flat, tilt)
    middle = -level * lean
    square = 1.0 - level**2 * (shape[2, 2] - tilt @ lean)
    angle = np.linspace(0.0, 2.0 * math.pi, 48, endpoint=False)
    circle = np.sqrt(max(0.0, square)) * np.array([np.cos(angle), np.sin(angle)])
    outline = np.linalg.solve(np.linalg.cholesky(flat).T, circle).T
    return outline + middle + spread[:2, 2] / half
