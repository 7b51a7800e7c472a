"""Transformation of meshes by a file's items or nodes, and their union."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .mesh_limits import make_refusal

Indices = NDArray[np.int64]

#: A placement (4, 3): (x, y, z, 1) times it gives the place. This one leaves all where it is.
IDENTITY: Floats = np.vstack([np.eye(3), np.zeros(3)])


def nest_placement(inner: Floats, outer: Floats) -> Floats:
    """Return the placement, (4, 3), of what is placed in something that is placed itself.

    `inner`, `outer` (4, 3), three rows of the linear part, and one of the offset.
    """
    placement: Floats = inner @ outer[:3]
    placement[3] += outer[3]
    return placement


def join_meshes(meshes: Iterable[tuple[Floats, Indices, Floats]], name: str) -> tuple[Floats, Indices]:
    """Return all vertices (v, 3) and triangles (f, 3) of meshes, each given with its placement.

    Triangles of a mesh that is mirrored are turned, so that outside stays outside.

    `meshes` int (v, 3) or (f, 3) or (4, 3), vertices, triangles, placement of each; `name`: what the message
    calls the file. Raises ParameterError when a triangle has a corner that is not among its own mesh's
    vertices.
    """
    places, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for vertices, faces, placement in meshes:
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            rule = "must have faces whose corners are among its vertices"
            raise make_refusal(rule, name, f"corner {faces.max()} of {len(vertices)}")
        mirrored = np.linalg.det(placement[:3]) < 0.0
        places.append(vertices @ placement[:3] + placement[3])
        triangles.append((faces[:, ::-1] if mirrored else faces) + first)
        first += len(vertices)
    return np.concatenate(places), np.concatenate(triangles)
