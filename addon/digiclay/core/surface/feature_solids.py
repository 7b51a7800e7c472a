"""Features as closed bodies, for addition to or subtraction from another model."""

from __future__ import annotations

import numpy as np

from .body import Body
from .features import Feature

__all__ = ["make_feature_solid"]


def make_feature_solid(feature: Feature) -> Body:
    """Return the body between the surface as it is and as it was before, closed.

    A boss stands on the former surface; a crease is the body that fills it up to there. Where the
    feature ends, and at the edge of the bed, an upright wall closes it: as high as the threshold, because
    an edge that thins out to nothing makes booleans of other programs fail.
    """
    region = feature.region
    count = len(region.position)
    now = region.former + (region.off if feature.kind == "boss" else -region.off)
    over, under = np.maximum(now, region.former), np.minimum(now, region.former)
    vertices = np.concatenate([np.column_stack([region.position, one]) for one in (over, under)])
    start, end = region.outline().T
    walls = [[start, start + count, end + count], [start, end + count, end]]
    sides = [np.stack(corners, axis=1) for corners in walls]
    faces = np.concatenate([region.faces, region.faces[:, ::-1] + count, *sides]).astype(np.int32)
    return Body(feature.name, vertices, faces)
