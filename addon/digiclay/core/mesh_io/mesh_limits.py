"""Size limits of input meshes, and meshes placed several times."""

from collections.abc import Iterable

import numpy as np

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError

#: Most triangles of a mesh: as many as a bed may have cells. They take some 5 GB while they are laid onto it.
MOST_TRIANGLES = 20_000_000
#: Most bytes of a mesh's file, or of what a compressed one unpacks to.
MOST_BYTES = 2_000_000_000
#: Largest number of a mesh or a map: products of some of them stay finite.
LARGEST = 1e60
SMALLER = "Make the mesh coarser first."
CORNERS = "must have faces whose corners are among its vertices"


def make_refusal(rule: str, name: str, content: str, hint: str = "") -> ParameterError:
    """Return the error of an unusable mesh: the rule from *must* on, name and content of the file, remedy."""
    return ParameterError("shape", "file", rule, f"{name}: {content}", hint)


def refuse_many_triangles(name: str, count: int) -> None:
    """Refuse a mesh of more triangles than can be worked on, before they are made."""
    if count > MOST_TRIANGLES:
        rule = f"must have at most {MOST_TRIANGLES // 1_000_000} million triangles"
        # Copies of copies can come to a number of any length.
        shown = f"{count:,}" if count < 10**15 else "more than 10^15"
        raise make_refusal(rule, name, shown, SMALLER)


def refuse_size(name: str, size: int, what: str = "") -> None:
    """Refuse a file, or its unpacked part `what`, of more bytes than can be read."""
    if size > MOST_BYTES:
        rule = f"must have at most {MOST_BYTES / 1e9:g} GB{' unpacked' if what else ''}"
        raise make_refusal(rule, name, f"{what} {size / 1e9:.3g} GB".strip(), SMALLER)


#: A placement (4, 3): (x, y, z, 1) times it gives the place. This one leaves all where it is.
IDENTITY: Floats = np.vstack([np.eye(3), np.zeros(3)])


def nest_placement(inner: Floats, outer: Floats) -> Floats:
    """Return the placement, (4, 3), of what is placed in something that is placed itself."""
    placement: Floats = inner @ outer[:3]
    placement[3] += outer[3]
    return placement


def join_meshes(meshes: Iterable[tuple[Floats, Indices, Floats]], name: str) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of meshes (vertices, triangles, placement) as one mesh."""
    places, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for vertices, faces, placement in meshes:
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise make_refusal(CORNERS, name, f"corner {faces.max()} of {len(vertices)}")
        mirrored = np.linalg.det(placement[:3]) < 0.0  # turned, so that outside stays outside
        places.append(vertices @ placement[:3] + placement[3])
        triangles.append((faces[:, ::-1] if mirrored else faces) + first)
        first += len(vertices)
    return np.concatenate(places), np.concatenate(triangles)
