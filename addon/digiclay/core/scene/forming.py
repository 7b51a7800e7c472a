"""Forming of a shape: duration of its display, and a fingertip path to its highest part."""

import math
from dataclasses import replace

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..control.displays import Handover, ShapeDisplayControl
from ..engine.system import System
from ..model.fingertip import LEVEL, Fingertip, compute_forms, compute_underside
from ..model.layout import Grid
from ..model.trajectory import Path, Waypoint
from .schema import Scene

#: Paths of the fingertip, in s and m above the height of first contact.
GESTURES: dict[str, tuple[tuple[float, float], ...]] = {
    "pull": (
        (0.0, 20e-3), (0.6, 2e-3), (1.6, -5e-3), (1.8, -5e-3), (2.2, -4e-3), (4.2, 6e-3), (4.5, 6e-3),
        (4.8, 30e-3), (5.5, 30e-3),
    ),
    "press": ((0.0, 20e-3), (0.6, 2e-3), (2.0, -5e-3), (2.4, -5e-3), (2.7, 30e-3), (3.4, 30e-3)),
    "away": ((0.0, 20e-3), (0.5, 20e-3)),
}  # fmt: skip
#: Cells within this share of the relief below the highest one belong to the summit.
NEARLY = 0.1
#: Time for the last micrometers and a margin, s.
MARGIN = 0.5


def find_display(system: System) -> ShapeDisplayControl | None:
    """Return the display of a scene's shape, or None."""
    controller = system.controller
    if isinstance(controller, Handover):
        return controller.display
    return controller if isinstance(controller, ShapeDisplayControl) else None


def compute_display_time(display: ShapeDisplayControl) -> float:
    """Return the time in which a free bed displays its shape, s, rounded up to a tenth.

    A move lasts as long as its distance takes at the slower reservoir's speed, plus the settling of
    the height control to the dead band; at most its patience.
    """
    shape, motion = display.parameters, display.motion
    distance = float(np.abs(display.heights - display.actuator.rest_height).max(initial=0.0))
    if shape.refresh != "one_time":
        distance /= shape.surfaces
    speed = min(float(motion.up[-1]), float(motion.down[-1]))
    settling = motion.settling_time * math.log(
        max(distance / max(motion.dead_band, 1e-9), 1.0) + 1.0
    )
    move = min(distance / speed + settling + 0.05, shape.patience)
    return math.ceil(10.0 * (MARGIN + len(display.moves) * move)) / 10.0


def find_summit(grid: Grid, heights: Floats) -> tuple[float, float]:
    """Return the position, m, nearest to the bed's middle, of the highest cells; `heights` (n,), m."""
    high = np.flatnonzero(heights >= heights.max() - NEARLY * np.ptp(heights))
    cell = int(high[np.argmin(np.hypot(grid.x[high], grid.y[high]))])
    return float(grid.x[cell]), float(grid.y[cell])


def find_touch_height(grid: Grid, heights: Floats, finger: Fingertip, x: float, y: float) -> float:
    """Return the height at which a level finger that descends at a point, m, first touches tops (n,), m."""
    outline = finger.outline(np.array([[x, y, 0.0, *LEVEL]]))
    under = compute_underside(*compute_forms(outline), grid.compute_basis(np.arange(grid.count)))
    return float(np.max(heights - under[0]))


def make_forming_scene(scene: Scene, system: System, gesture: str) -> Scene:
    """Return a scene whose finger waits until the shape is displayed, and then forms its highest part.

    `gesture`: a key of `GESTURES`. Raises ParameterError when the scene has no shape, or no finger.
    """
    display = find_display(system)
    if display is None:
        raise ParameterError("shape", "", "must be given to form it", "none")
    if system.cell.touch is None:
        raise ParameterError("fingertip", "", "must be given to form a shape", "absent")
    x, y = find_summit(system.grid, display.heights)
    touch = find_touch_height(system.grid, display.heights, system.cell.touch.fingertip, x, y)
    ready = compute_display_time(display)
    points = [(ready + time, touch + above) for time, above in GESTURES[gesture]]
    waypoints = [(0.0, points[0][1]), *points]
    path = tuple(Waypoint(time=time, position=(x, y, z)) for time, z in waypoints)
    simulation = replace(scene.simulation, duration=points[-1][0])
    return scene.with_sections(trajectory=Path("smooth", path), simulation=simulation)
