"""Size limits of input meshes, and meshes placed several times."""

from collections.abc import Iterable

import numpy as np

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError

#: Most triangles of a mesh: as many as a bed may have cells. Fitting them to a bed takes about 5
#: GB.
MOST_TRIANGLES = 20_000_000
#: Most bytes of a mesh's file, unpacked if it is compressed.
MOST_BYTES = 2_000_000_000
#: Largest number of a mesh or a map: products of some of them stay finite.
LARGEST = 1e60
SMALLER = "Make the mesh coarser first."
CORNERS = "must have faces whose corners are among its vertices"


def make_refusal(rule: str, name: str, content: str, hint: str = "") -> ParameterError:
    """Return the error of an unusable file: the rule from *must* on, name and content, and the remedy."""
    return ParameterError("shape", "file", rule, f"{name}: {content}", hint)


def refuse_many_triangles(name: str, count: int) -> None:
    """Refuse a mesh of too many triangles, before they are made."""
    if count > MOST_TRIANGLES:
        rule = f"must have at most {MOST_TRIANGLES // 1_000_000} million triangles"
        # Copies of copies can give a number of any length.
        shown = f"{count:,}" if count < 10**15 else "more than 10^15"
        raise make_refusal(rule, name, shown, SMALLER)


def refuse_size(name: str, size: int, what: str = "") -> None:
    """Refuse a file, or its unpacked part `what`, of too many bytes."""
    if size > MOST_BYTES:
        rule = f"must have at most {MOST_BYTES / 1e9:g} GB{' unpacked' if what else ''}"
        raise make_refusal(rule, name, f"{what} {size / 1e9:.3g} GB".strip(), SMALLER)


#: A placement (4, 3) maps a point: (x, y, z, 1) @ placement. This one changes nothing.
IDENTITY: Floats = np.vstack([np.eye(3), np.zeros(3)])


def nest_placement(inner: Floats, outer: Floats) -> Floats:
    """Return the placement (4, 3) that applies `inner`, then `outer`."""
    placement: Floats = inner @ outer[:3]
    placement[3] += outer[3]
    return placement


def join_meshes(
    meshes: Iterable[tuple[Floats, Indices, Floats]], name: str
) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of meshes (vertices, triangles, placement) as one mesh."""
    points, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for vertices, faces, placement in meshes:
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise make_refusal(CORNERS, name, f"corner {faces.max()} of {len(vertices)}")
        mirrored = np.linalg.det(placement[:3]) < 0.0  # turned, so that outside stays outside
        points.append(vertices @ placement[:3] + placement[3])
        triangles.append((faces[:, ::-1] if mirrored else faces) + first)
        first += len(vertices)
    return np.concatenate(points), np.concatenate(triangles)
