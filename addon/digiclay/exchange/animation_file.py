"""Animated file of a bed: pins as instances of one mesh, or the skin as a mesh, complete or not at all."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from ..core.base.arrays import Floats
from ..core.base.errors import OutputError
from ..core.files.run_folder import open_whole
from ..core.mesh_io.animation import Animation, write_glb, write_usd
from ..core.mesh_io.export_model import Model, make_skin_grid
from ..core.mesh_io.mesh_writer import UNITS
from ..core.surface.formed import Formed
from ..core.surface.skins import interpolate_skin
from ..device.primitives import rod

#: Extensions of the formats.
SUFFIXES = {"usd": ".usda", "abc": ".abc", "glb": ".glb"}
#: Formats that the ending of a name tells; USD is always written as text, .usda.
ENDINGS = {suffix: name for name, suffix in SUFFIXES.items()} | dict.fromkeys(
    (".usd", ".usdc"), "usd"
)
#: Kinds of `export_model.KINDS` that can be animated.
ANIMATED = ("pins", "surface")
#: Sides of a pin, and its length beyond the range of all heights, in its radii: none hangs in the
#: air.
SIDES, ROOTED = 12, 20.0


def animate(position: Floats, height: Floats, rate: float, model: Model) -> Animation:
    """Return the animation of pins with heights (t, n), m, or of their skin; OutputError for one frame."""
    if len(height) < 2:
        raise OutputError(
            "An animation must have at least 2 frames (got 1): the session is too short."
        )
    if model.kind == "pins":
        length = float(np.ptp(height)) + ROOTED * model.cap
        pin, polygons = rod(model.cap, length, SIDES)
        fans = [(first, *edge) for first, *others in polygons for edge in pairwise(others)]
        return Animation(rate, _join(position, height), np.array(fans, np.int32), pin)
    formed = Formed.of(position, height[0], 0.0, 0.0, 0)
    grid = make_skin_grid(formed, model)
    skin = model.skin, model.parts, model.cap
    heights = np.array([interpolate_skin(formed, pins, *skin) for pins in height])
    # All frames have the triangles of the first one.
    return Animation(rate, _join(grid.position, heights), grid.faces)


def _join(position: Floats, height: Floats) -> Floats:
    """Return points (t, m, 3) at fixed positions (m, 2) and moving heights (t, m)."""
    points = np.empty((*height.shape, 3))
    points[..., :2], points[..., 2] = position, height
    return points


def write_animation(path: Path, animation: Animation, kind: str, unit: str) -> None:
    """Write an animation in a format of `SUFFIXES`, in a unit of `UNITS`; OutputError on failure."""
    with open_whole(path) as file:
        if kind == "abc":
            from .alembic_file import write_alembic  # which needs Blender

            write_alembic(file, animation, UNITS[unit])
        else:
            {"usd": write_usd, "glb": write_glb}[kind](file, animation, UNITS[unit])
