"""Mesh input: all meshes of a file as one; oversized, truncated and external files are refused."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ..base.arrays import Floats, Indices
from . import gltf_reader, obj_reader, scan_reader, threemf_reader
from .mesh_limits import refuse_size
from .obj_reader import find_axes, make_axes, turn

#: Byte order mark that a UTF-8 text may begin with.
BOM = b"\xef\xbb\xbf"


class Read(NamedTuple):
    """Mesh as its file has it: vertices (v, 3), triangles (f, 3), unit in m or None, upward direction."""

    vertices: Floats
    faces: Indices
    length: float | None
    up: str


def _read_3mf(path: Path) -> Read:
    """Read a 3MF, which names its unit."""
    return Read(*threemf_reader.read(path), "z")


def _read_gltf(path: Path) -> Read:
    """Read a GLB or glTF: by their standard in meters, y upwards."""
    return Read(*gltf_reader.read(path, _read_bytes(path)), 1.0, "y")


def _read_obj(path: Path) -> Read:
    """Read an OBJ, turned about the upward axis, so that the forward axis is the usual one."""
    data = _read_bytes(path)
    vertices, faces = obj_reader.read(data, path.name)
    up, forward = find_axes(data)
    return Read(turn(vertices, make_axes(up, forward).T @ make_axes(up)), faces, None, up)


def _read_scan(path: Path) -> Read:
    """Read a mesh without unit, z upwards."""
    return Read(*scan_reader.read(_read_bytes(path), path.suffix.lower(), path.name), None, "z")


def _read_bytes(path: Path) -> bytes:
    """Return a file without its byte order mark."""
    return path.read_bytes().removeprefix(BOM)


#: Readers by extension, in the order in which messages name them.
READERS: dict[str, Callable[[Path], Read]] = {
    ".stl": _read_scan,
    ".obj": _read_obj,
    ".ply": _read_scan,
    ".glb": _read_gltf,
    ".gltf": _read_gltf,
    ".off": _read_scan,
    ".3mf": _read_3mf,
}


def read(path: Path) -> Read:
    """Read a mesh in the format of its extension, one of `READERS`; raises OSError or ParameterError."""
    refuse_size(path.name, path.stat().st_size)
    return READERS[path.suffix.lower()](path)
