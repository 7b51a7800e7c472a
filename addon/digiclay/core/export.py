"""The formed surface as a mesh file: STL, OBJ, PLY or GLB."""

from __future__ import annotations

import importlib
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import OutputError, ParameterError
from .surface import BASE_THICKNESS, solid

if TYPE_CHECKING:  # only named in annotations: trimesh is imported where it is used
    import trimesh

__all__ = ["FORMATS", "UNITS", "known_format", "mesh", "write", "write_whole"]

#: File formats, by extension, with what is said of them in the help.
FORMATS: dict[str, str] = {
    "stl": "STL, binary",
    "obj": "Wavefront OBJ",
    "ply": "Stanford PLY, binary",
    "glb": "binary glTF, in metres and y up as its standard says",
}

#: Lengths a file can be written in: how many of them make a metre.
UNITS: dict[str, float] = {"mm": 1e3, "m": 1.0}


def known_format(name: str) -> str:
    """Return the format called `name` (``"stl"``, ``".STL"``) as a key of `FORMATS`.

    Raises
    ------
    OutputError
        When there is no such format.
    """
    key = name.lower().removeprefix(".")
    if key not in FORMATS:
        raise OutputError(f"Unknown mesh format {key!r}: known are {', '.join(FORMATS)}.")
    return key


def mesh(
    position: ArrayLike,
    height: ArrayLike,
    rows: int,
    columns: int,
    *,
    base: float | None = None,
    base_thickness: float = BASE_THICKNESS,
) -> trimesh.Trimesh:
    """Return the formed surface as a watertight solid, in metres.

    The parameters are those of `surface.solid`; vertices and faces keep its order.

    Raises
    ------
    ParameterError
        As `surface.solid`.
    OutputError
        When trimesh is not installed.
    """
    vertices, faces = solid(position, height, rows, columns, base=base, base_thickness=base_thickness)
    made: trimesh.Trimesh = _trimesh().Trimesh(vertices=vertices, faces=faces, process=False)
    return made


def write(mesh: trimesh.Trimesh, path: str | Path, unit: str = "mm") -> Path:
    """Write `mesh` to `path`, whose extension names the format.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        In metres, z up, as `mesh` returns it; it is left as it is.
    path : str or Path
        The file; an older one is replaced once the new one is complete.
    unit : {"mm", "m"}
        Length unit of STL, OBJ and PLY, which do not name theirs. A GLB is always in metres
        and y up, because its standard says so.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        On an unknown format, or when the file cannot be written.
    ParameterError
        On an unknown unit.
    """
    target = Path(path)
    kind = known_format(target.suffix)
    if unit not in UNITS:
        raise ParameterError("Export", "unit", f"must be one of {', '.join(UNITS)}", repr(unit))
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if kind == "glb":
        vertices = np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], axis=1)
    else:
        vertices = vertices * UNITS[unit]
    content = _trimesh().Trimesh(vertices=vertices, faces=mesh.faces, process=False).export(file_type=kind)
    write_whole(target, content.encode("utf-8") if isinstance(content, str) else bytes(content))
    return target


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all: to a temporary name beside it, then renamed.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except BaseException as error:
        with suppress(OSError):  # what went wrong first is what the user has to hear
            unfinished.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
        raise


def _trimesh() -> Any:
    """Import trimesh, or say what to install."""
    try:
        return importlib.import_module("trimesh")
    except ImportError:
        raise OutputError("Exporting a mesh needs trimesh: run 'pip install trimesh'.") from None
