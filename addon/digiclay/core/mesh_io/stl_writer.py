"""STL files, binary and as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..surface.body import Body, split_pieces

#: One triangle of a binary file.
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
TEXT = "facet normal {:.6e} {:.6e} {:.6e}\nouter loop\n" + 3 * "vertex {:.9g} {:.9g} {:.9g}\n"
TEXT += "endloop\nendfacet\n"


def write_binary(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write all bodies as one list of triangles, lengths in 1 / `factor` m.

    `factor`: units of the file in a meter.
    """
    # The first word must not be "solid": by it readers know the text form.
    file.write(f"binary STL, {'mm' if factor > 1.0 else 'm'}, digiclay".encode().ljust(80))
    file.write(np.uint32(sum(len(body.faces) for body in bodies)).astype("<u4").tobytes())
    for body in bodies:
        for some in split_pieces(len(body.faces)):
            corners = _corners(body, some, factor)
            table = np.zeros(len(corners), TRIANGLE)
            table["corners"], table["normal"] = corners, _normals(corners)
            file.write(table.tobytes())


def write_ascii(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write one ``solid`` a body, with the nine digits a float32 needs to be read back as it was.

    `factor`: units of the file in a meter.
    """
    for body in bodies:
        file.write(f"solid {body.name}\n".encode())
        for some in split_pieces(len(body.faces)):
            corners = _corners(body, some, factor)
            table = np.concatenate([_normals(corners), corners.reshape(-1, 9)], axis=1)
            file.write("".join(TEXT.format(*row) for row in table.tolist()).encode())
        file.write(f"endsolid {body.name}\n".encode())


def _corners(body: Body, some: slice, factor: float) -> NDArray[np.float32]:
    """Return the corners of some triangles, shape (k, 3, 3)."""
    corners: NDArray[np.float32] = (body.vertices[body.faces[some]] * factor).astype(np.float32)
    return corners


def _normals(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return unit normals, shape (k, 3), of the triangles as they are written."""
    exact = corners.astype(np.float64)
    normal = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    unit: NDArray[np.float32] = (normal / np.where(length > 0.0, length, 1.0)).astype(np.float32)
    return unit
