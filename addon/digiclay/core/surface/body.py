"""Triangle mesh for a file or for Blender."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats

Indices = NDArray[np.int32]

#: Code of the mode at a vertex that belongs to no pin, such as one of the base.
NO_PIN = -1
#: Triangles, or vertices, that are worked on at once: a few MB, however large the body.
PIECE = 1 << 16


@dataclass(frozen=True, eq=False)
class Body:
    """Vertices and triangles under one name.

    Attributes
    ----------
    name : str
        Letters, digits and underscores.
    vertices : ndarray (v, 3)
        m, z up, in the space of the bed.
    faces : ndarray of int (f, 3)
        Counter-clockwise seen from outside.
    values : mapping of str to ndarray (v,)
        What a vertex knows besides its place: nothing, or height, m, force, N, and code of the control mode.
    groups : tuple of str
        Names of groups of faces, such as features.
    group : ndarray of int (f,)
        To which group a face belongs: 1 is the first of `groups`, 0 none. Empty without groups.
    vertex_group : ndarray of int (v,)
        The same for vertices; empty without groups.
    closed : bool
        Whether it encloses a volume.
    """

    name: str
    vertices: Floats
    faces: Indices
    values: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    groups: tuple[str, ...] = ()
    group: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    vertex_group: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    closed: bool = True


def split_pieces(count: int) -> Iterator[slice]:
    """Give slices that together are ``range(count)``, none longer than `PIECE`."""
    for start in range(0, count, PIECE):
        yield slice(start, min(start + PIECE, count))


def compute_volume(body: Body) -> float:
    """Return the volume a closed body encloses, m³: the sum of tetrahedra to its first vertex."""
    total = 0.0
    for some in split_pieces(len(body.faces)):
        a, b, c = np.moveaxis((body.vertices - body.vertices[:1])[body.faces[some]], 1, 0)
        total += float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    return total
