"""Wavefront OBJ files: an object a body, a group a feature."""

from __future__ import annotations

from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from ..surface.body import Body, Indices, split_pieces
from .axes import UP, find_forward, make_axes


def write(file: BinaryIO, bodies: Sequence[Body], factor: float, up: str = UP, forward: str = "") -> None:
    """Write the bodies, lengths in 1 / `factor` m to the nearest nanometer; faces of no group come first."""
    axes, unit = make_axes(up, forward), "mm" if factor > 1.0 else "m"
    line = "v {0} {0} {0}\n".format("%.6f" if factor > 1.0 else "%.9f")
    file.write(f"# digiclay, lengths in {unit}, {up} up, {forward or find_forward(up)} forward\n".encode())
    first = 1
    for body in bodies:
        file.write(f"o {body.name}\n".encode())
        for some in split_pieces(len(body.vertices)):
            block = body.vertices[some] @ (axes * factor)
            file.write(((line * len(block)) % tuple(block.ravel().tolist())).encode())
        if body.groups:
            for number, name in enumerate(("rest", *body.groups)):
                file.write(f"g {name}\n".encode())
                _faces(file, body.faces[body.group == number], first)
        else:
            _faces(file, body.faces, first)
        first += len(body.vertices)


def _faces(file: BinaryIO, faces: Indices, first: int) -> None:
    """Write triangles whose vertex 0 is number `first` of the file."""
    for some in split_pieces(len(faces)):
        block = faces[some].astype(np.int64) + first
        file.write((("f %d %d %d\n" * len(block)) % tuple(block.ravel().tolist())).encode())
