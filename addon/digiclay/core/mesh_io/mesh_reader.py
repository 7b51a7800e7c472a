"""Mesh input: all meshes of a file as one; oversized, truncated and external files are refused."""

from pathlib import Path
from typing import NamedTuple

from ..base.arrays import Floats, Indices
from . import gltf_reader, obj_reader, scan_reader, threemf_reader
from .mesh_limits import refuse_size
from .obj_reader import find_axes, make_axes

#: Meshes by extension.
MESHES = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off", ".3mf")
#: Formats in meters with y upwards, by their standard.
GLTF = (".glb", ".gltf")
#: Byte order mark that a UTF-8 text may begin with.
BOM = b"\xef\xbb\xbf"


class Read(NamedTuple):
    """Mesh as its file has it: vertices (v, 3), triangles (f, 3), unit in m or None, upward direction."""

    vertices: Floats
    faces: Indices
    length: float | None
    up: str


def read(path: Path) -> Read:
    """Read a mesh in the format of its extension, one of `MESHES`; raises OSError or ParameterError."""
    kind = path.suffix.lower()
    refuse_size(path.name, path.stat().st_size)
    if kind == ".3mf":
        vertices, faces, length = threemf_reader.read(path)
        return Read(vertices, faces, length, "z")
    data = path.read_bytes().removeprefix(BOM)
    if kind in GLTF:
        return Read(*gltf_reader.read(path, data), 1.0, "y")
    if kind == ".obj":
        vertices, faces = obj_reader.read(data, path.name)
        up, forward = find_axes(data)
        # Turned about the upward axis, so that the forward axis is the usual one.
        return Read(vertices @ make_axes(up, forward).T @ make_axes(up), faces, None, up)
    return Read(*scan_reader.read(data, kind, path.name), None, "z")
