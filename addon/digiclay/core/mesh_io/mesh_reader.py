"""Mesh input: all meshes of a file as one; oversized, truncated and external files are refused first.

OBJ, glTF and 3MF are read here; STL, PLY and OFF, which refer to nothing else, by trimesh.
"""

import importlib
import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError
from . import gltf_reader, obj_reader, threemf_reader
from .mesh_limits import check_off, check_ply, check_stl, refuse_size, stl_is_text
from .obj_reader import find_axes, make_axes

#: Meshes by extension.
MESHES = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off", ".3mf")
#: Formats whose standard says meters, and y upwards.
GLTF = (".glb", ".gltf")
CHECKS = {".stl": check_stl, ".ply": check_ply, ".off": check_off}
#: What a text in UTF-8 may begin with.
BOM = b"\xef\xbb\xbf"


class Read(NamedTuple):
    """Mesh in the form of its file: (v, 3), (f, 3), meters in its unit or None, direction that is up."""

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
        # Turned about the upward axis to the usual forward one.
        return Read(vertices @ make_axes(up, forward).T @ make_axes(up), faces, None, up)
    CHECKS[kind](data, path.name)
    return Read(*_by_trimesh(data, kind, path), None, "z")


def _by_trimesh(data: bytes, kind: str, path: Path) -> tuple[Floats, Indices]:
    """Read a mesh with trimesh, which gets the bytes alone and cannot open another file."""
    try:
        trimesh: Any = importlib.import_module("trimesh")
    except ImportError:
        raise ParameterError(
            "shape", "file", "must be an OBJ, a GLB, a 3MF, a picture or an array without trimesh", str(path),
            "Run 'pip install trimesh'.",
        ) from None  # fmt: skip
    file_type = "stl_ascii" if kind == ".stl" and stl_is_text(data) else kind[1:]
    options = {"skip_materials": True} if kind == ".ply" else {}
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type=file_type, resolver={}, process=False, **options)
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
