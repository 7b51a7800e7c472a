"""Shapes from files: samples by name, meshes, pictures, and numpy arrays."""

from __future__ import annotations

import importlib
from contextlib import suppress
from pathlib import Path

from ..base.errors import ParameterError, SceneError
from ..files.formats import map_array
from ..files.run_folder import find_file, list_files
from ..mesh_io import mesh_reader
from ..mesh_io.mesh_limits import make_refusal
from ..mesh_io.mesh_reader import MESHES
from ..model.actuator import Actuator
from ..model.layout import Grid
from .fitting import Fitted, Relief, fit_given, fit_relief
from .heightmap import PICTURES, HeightMap, make_height_map, read_pixels
from .mesh_relief import ShapeMesh, make_shape_mesh
from .request import AUTO, LENGTHS, Shape

#: Where the sample shapes are.
SAMPLES = Path(__file__).parents[2] / "sample_shapes" / "shapes"
ARRAY = ".npy"
UNREADABLE = "must be a file that can be read"
#: What a file of this kind of shape may end with.
KINDS = (*MESHES, *PICTURES, ARRAY)


def list_shapes() -> list[str]:
    """Return the names of the sample shapes."""
    return list(list_files(SAMPLES, *KINDS))


def find_shape(word: str) -> Path:
    """Return the file of a shape, given by a sample's name or its path, or raise SceneError."""
    return find_file(word, list_files(SAMPLES, *KINDS), "sample shape")


def fit_shape(shape: Shape, grid: Grid, actuator: Actuator) -> Fitted:
    """Return the shape of a scene, placed on its bed; errors as `read` and `fitting.fit_relief`."""
    if shape.heights:
        return fit_given(shape, grid, actuator)
    return fit_relief(shape, read(shape), grid, actuator)


def read(shape: Shape) -> Relief:
    """Read the shape a scene names; SceneError without such a file, ParameterError when it holds no shape."""
    try:
        path = find_shape(shape.file)
    except SceneError as error:
        raise SceneError(f"shape.file: {error}") from None
    kind = path.suffix.lower()
    if kind == ARRAY:
        return _array(path)
    if kind in PICTURES:
        return make_height_map(path.name, read_pixels(path))
    return _mesh(path, shape)


def import_reader(path: Path) -> None:
    """Import the library that reads a file before it can be interrupted; a missing one is refused later."""
    kind = path.suffix.lower()
    reader = "PIL.Image" if kind in PICTURES else "trimesh" if kind in mesh_reader.CHECKS else ""
    if reader:
        with suppress(ImportError):
            importlib.import_module(reader)


def _array(path: Path) -> HeightMap:
    """Read an array of heights, m; its first row lies at the lowest y."""
    try:
        values = map_array(path)
    except OSError as error:
        raise make_refusal(UNREADABLE, str(path), error.strerror or "not an array") from None
    except ValueError:
        raise ParameterError("shape", "file", "must hold one array of numbers", str(path)) from None
    return make_height_map(path.name, values, value_length=1.0)


def _mesh(path: Path, shape: Shape) -> ShapeMesh:
    """Read a mesh."""
    if path.suffix.lower() not in MESHES:
        rule = f"must be a mesh, a picture or an array ({', '.join(KINDS)})"
        raise ParameterError("shape", "file", rule, str(path))
    try:
        mesh = mesh_reader.read(path)
    except (ParameterError, MemoryError):
        raise
    except OSError as error:
        raise make_refusal(UNREADABLE, str(path), error.strerror or str(error)) from None
    except Exception as error:  # trimesh raises all sorts of errors on a broken file
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise make_refusal("must be a mesh that can be read", str(path), reason) from None
    up = shape.up if shape.up != AUTO else mesh.up
    length = LENGTHS[shape.unit] if shape.unit != AUTO else mesh.length or LENGTHS["mm"]
    return make_shape_mesh(path.name, mesh.vertices, mesh.faces, up, length)
