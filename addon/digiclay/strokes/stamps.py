"""What strokes can stamp: samples, meshes, pictures and arrays, as values from 0 to 1. No Blender."""

from functools import lru_cache

import numpy as np

from ..core.model.actuator import Actuator
from ..core.model.layout import Layout, make_grid
from ..core.shapes.fitting import find_shape, fit_shape
from ..core.shapes.heightmap import HeightMap, make_height_map
from ..core.shapes.request import Shape

#: Pixels along each side of a stamp, and how many stamps are kept in memory.
PIXELS, KEPT = 256, 8


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
