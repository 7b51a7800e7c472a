"""Mesh files of bodies: STL, OBJ, PLY, GLB and 3MF, each complete or not at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

from ..base.errors import OutputError, ParameterError
from ..base.whole_files import open_whole
from ..surface.body import Body
from . import glb_writer, obj_writer, ply_writer, stl_writer, threemf_writer
from .axes import UP, make_axes

#: File formats, by name, with what is said of them in the help.
FORMATS: dict[str, str] = {
    "stl": "STL, binary",
    "stl_ascii": "STL as text",
    "obj": "Wavefront OBJ, with a group for each feature; y up as in Blender's, other axes by option",
    "ply": "Stanford PLY, binary, with height, force and mode of each vertex",
    "glb": "binary glTF, in meters and y up as its standard says",
    "3mf": "3MF, which names its unit",
}
WRITERS: dict[str, Callable[[BinaryIO, Sequence[Body], float], None]] = {
    "stl": stl_writer.write_binary,
    "stl_ascii": stl_writer.write_ascii,
    "obj": obj_writer.write,
    "ply": ply_writer.write,
    "glb": glb_writer.write,
    "3mf": threemf_writer.write,
}

#: Lengths a file can be written in: how many of them make a meter.
UNITS: dict[str, float] = {"mm": 1e3, "m": 1.0}


def find_format(name: str) -> str:
    """Return the format called `name` (``"stl"``, ``".STL"``) as a key of `FORMATS`.

    Raises OutputError when there is no such format.
    """
    key = name.lower().removeprefix(".")
    if key not in FORMATS:
        raise OutputError(f"Unknown mesh format {key!r}: known are {', '.join(FORMATS)}.")
    return key


def find_suffix(kind: str) -> str:
    """Return how the name of a file of a format ends; text and binary STL do not share a name."""
    return ".ascii.stl" if kind == "stl_ascii" else f".{kind}"


def write(
    bodies: Sequence[Body],
    path: str | Path,
    unit: str = "mm",
    kind: str | None = None,
    up: str = UP,
    forward: str = "",
) -> Path:
    """Write bodies into one file, a few MB at a time.

    `bodies`: one at least; they are left as they are; `path`: the file; an older one is replaced once the new
    one is complete; `unit`: length unit of all formats but GLB, which is always in meters and y up, because
    its standard says so; `kind`: a key of `FORMATS`; by default the extension of `path`; `up`, `forward`:
    axes of an OBJ, of `axes.AXES`; by default those of Blender. Returns the file written. Raises OutputError:
    on an unknown format, nothing to write, or when the file cannot be written. Raises ParameterError: on an
    unknown unit or axis.
    """
    target = Path(path)
    named = find_format(target.suffix if kind is None else kind)
    writer = partial(obj_writer.write, up=up, forward=forward) if named == "obj" else WRITERS[named]
    make_axes(up, forward)  # an error before the file is opened
    if unit not in UNITS:
        raise ParameterError("Export", "unit", f"must be one of {', '.join(UNITS)}", repr(unit))
    if not any(len(body.faces) for body in bodies):
        raise OutputError(f"There is nothing to write to {target}.")
    with open_whole(target) as file:
        writer(file, bodies, UNITS[unit])
    return target
