"""The volume under a skin, reckoned without the solid that it is compared with."""

import numpy as np
from digiclay.core.surface.formed import find_base_level, make_skin


def prism_volume(place, height, rows, columns):
    """Return the volume between the skin and the base, m³.

    Exact: the sum over the triangles of area in plan times mean height above the base of `solid`.
    """
    faces = make_skin(place, height, rows, columns)
    (ax, ay), (bx, by), (cx, cy) = (place[faces[:, corner]].T for corner in range(3))
    area = 0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    return float(np.sum(area * (height[faces].mean(axis=1) - find_base_level(height))))
