"""What strokes can stamp: samples, meshes, pictures and arrays, as values from 0 to 1. No Blender."""

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from ..core.base.arrays import Floats
from ..core.model.actuator import Actuator
from ..core.model.layout import Grid, Layout, make_grid
from ..core.shapes.fitting import find_shape, fit_shape
from ..core.shapes.heightmap import HeightMap, make_height_map
from ..core.shapes.mesh_relief import ShapeMesh
from ..core.shapes.request import Placement, Shape
from .stroke import lay_line

#: Pixels along each side of a stamp, and how many stamps are kept in memory.
PIXELS, KEPT = 256, 8
#: Pixels per pitch along each side of what is cut out.
FINE = 4


def load_stamp(name: str) -> HeightMap:
    """Return a stamp: all of a shape, given by a sample's name or its path; errors as `fit_shape`."""
    return _load(name, find_shape(name).stat().st_mtime)


@lru_cache(KEPT)
def _load(name: str, changed: float) -> HeightMap:
    """Return the stamp of a file as it was changed last, s."""
    actuator, shape = Actuator(), Shape(file=name)
    heights = fit_shape(shape, make_grid(Layout(PIXELS, PIXELS, 1e-3)), actuator).heights
    values = ((heights - actuator.rest_height) / shape.rise).clip(0.0, 1.0)
    return make_height_map(name, np.asarray(values).reshape(PIXELS, PIXELS))


def cut_stamp(shapes: Iterable[ShapeMesh], grid: Grid) -> tuple[HeightMap, Floats]:
    """Return a stamp that is 1 under the faces of shapes in a bed's space, m, and its path (2, 2), m."""
    plan = grid.layout
    side = max(plan.columns, math.ceil(plan.rows * plan.row_spacing / plan.pitch))
    half, cell = side * plan.pitch / 2.0, plan.pitch / FINE
    # Pixels do not reach over the rim of a pin.
    x, y = (grid.positions.min(axis=0) - [plan.pitch / 2.0, plan.row_spacing / 2.0] + half).tolist()
    flat = make_grid(Layout(FINE * side, FINE * side, cell))
    pixels = Grid(flat.layout, flat.x + x, flat.y + y)
    covered = np.zeros(pixels.count)
    for shape in shapes:
        for cells, _, over, _ in shape.hits(pixels, Placement(1.0, 1.0, 0.0, 0.0)):
            covered[cells[over]] = 1.0
    stamp = make_height_map("curves", covered.reshape(FINE * side, FINE * side))
    return stamp, lay_line((x, y), (x + half, y))
