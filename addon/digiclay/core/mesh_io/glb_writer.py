"""Binary glTF files, in meters and y up as their standard requires; a node a body."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import OutputError
from ..surface.body import Body, split_pieces

FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
#: A file's length is a 32-bit number.
LARGEST = 2**32 - 1


def write(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies; `factor` is not used, since the unit is given.

    Raises OutputError when the file would be too large for the format.
    """
    told = _description(bodies)
    size = told["buffers"][0]["byteLength"]
    text = json.dumps(told, separators=(",", ":")).encode()
    text = text.ljust(-(-len(text) // 4) * 4)
    whole = 12 + 8 + len(text) + 8 + size
    if whole > LARGEST:
        raise OutputError(f"A GLB holds at most 4 GiB (got {whole / 2**30:.3g} GiB): choose ply.")
    file.write(b"glTF" + np.array([2, whole], "<u4").tobytes())
    file.write(np.array([len(text)], "<u4").tobytes() + b"JSON" + text)
    file.write(np.array([size], "<u4").tobytes() + b"BIN\0")
    for body in bodies:
        for some in split_pieces(len(body.vertices)):
            file.write(_upright(body.vertices[some]).astype("<f4").tobytes())
        for some in split_pieces(len(body.faces)):
            file.write(body.faces[some].astype("<u4").tobytes())


def _description(bodies: Sequence[Body]) -> dict[str, Any]:
    """Return the JSON part: where in the binary part the vertices and faces of each body are."""
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []
    start = 0
    for body in bodies:
        for count, target in ((len(body.vertices), VERTICES), (len(body.faces), INDICES)):
            views.append({"buffer": 0, "byteOffset": start, "byteLength": 12 * count, "target": target})
            start += 12 * count
        # The bounds must be those of the numbers as they are stored.
        low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
        low, high = _upright(np.array([[low[0], high[1], low[2]], [high[0], low[1], high[2]]]))
        bounds = {"min": low.astype("<f4").tolist(), "max": high.astype("<f4").tolist()}
        known = {"bufferView": len(views) - 2, "componentType": FLOAT, "count": len(body.vertices)}
        accessors.append({**known, "type": "VEC3", **bounds})
        known = {"bufferView": len(views) - 1, "componentType": UNSIGNED, "count": 3 * len(body.faces)}
        accessors.append({**known, "type": "SCALAR"})
    order = range(len(bodies))
    return {
        "asset": {"version": "2.0", "generator": "digiclay"},
        "scene": 0,
        "scenes": [{"nodes": list(order)}],
        "nodes": [{"mesh": i, "name": bodies[i].name} for i in order],
        "meshes": [
            {
                "name": bodies[i].name,
                "primitives": [{"attributes": {"POSITION": 2 * i}, "indices": 2 * i + 1, "material": 0}],
            }
            for i in order
        ],
        "materials": [{"name": "clay", "pbrMetallicRoughness": {"metallicFactor": 0.0}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": start}],
    }


def _upright(place: Floats) -> NDArray[np.float64]:
    """Return places with y up: x stays, and the bed's y runs away from who looks along minus z."""
    return np.stack([place[:, 0], place[:, 2], -place[:, 1]], axis=1)
