"""Stanford PLY files, binary, with height, force and control mode of each vertex."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from ..surface.body import NO_PIN, Body, split_pieces

#: Modes are whole numbers of the common size, because some readers know no smaller one.
VERTEX = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("height", "<f4"), ("force", "<f4"), ("mode", "<i4")]
)
FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def write(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies one after the other, lengths in 1 / `factor` m, forces in N.

    `factor`: units of the file in a meter.
    """
    unit = "mm" if factor > 1.0 else "m"
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment digiclay, lengths and height in {unit}, z up",
    ]
    lines += [f"comment force in N, pressing down is positive; mode {NO_PIN}: no pin"]
    lines += [
        f"comment {body.name}: {len(body.vertices)} vertices, {len(body.faces)} faces" for body in bodies
    ]
    lines += [f"element vertex {sum(len(body.vertices) for body in bodies)}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "height", "force")]
    lines += ["property int mode", f"element face {sum(len(body.faces) for body in bodies)}"]
    lines += ["property list uchar int vertex_indices", "end_header", ""]
    file.write("\n".join(lines).encode())
    for body in bodies:
        for some in split_pieces(len(body.vertices)):
            file.write(_vertices(body, some, factor).tobytes())
    first = 0
    for body in bodies:
        for some in split_pieces(len(body.faces)):
            table = np.empty(len(body.faces[some]), FACE)
            table["count"], table["vertices"] = 3, body.faces[some] + first
            file.write(table.tobytes())
        first += len(body.vertices)


def _vertices(body: Body, some: slice, factor: float) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Return some vertices as the file holds them; one without values is of no pin and bears no force."""
    place = body.vertices[some] * factor
    table = np.zeros(len(place), VERTEX)
    table["x"], table["y"], table["z"] = place.T
    if body.values:
        table["height"] = body.values["height"][some] * factor
        table["force"], table["mode"] = body.values["force"][some], body.values["mode"][some]
    else:
        table["height"], table["mode"] = place[:, 2], NO_PIN
    return table
