"""Mesh files of bodies: STL, OBJ, PLY, GLB and 3MF, each complete or not at all."""

import json
import struct
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import IO, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Floats
from ..base.errors import OutputError, ParameterError
from ..files.run_folder import open_whole
from ..files.tables import Record
from ..surface.formed import NO_PIN, Body, split_pieces
from .obj_reader import UP, find_forward, make_axes, turn
from .scan_reader import TRIANGLE

TEXT = (
    "facet normal %.6e %.6e %.6e\nouter loop\n"
    + 3 * "vertex %.9g %.9g %.9g\n"
    + "endloop\nendfacet\n"
)


def write_binary(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write all bodies as one list of triangles, lengths in 1 / `factor` m."""
    # The first word must not be "solid", by which readers recognize the text form.
    file.write(f"binary STL, {'mm' if factor > 1.0 else 'm'}, digiclay".encode().ljust(80))
    file.write(np.uint32(sum(len(body.faces) for body in bodies)).astype("<u4").tobytes())
    for body in bodies:
        for corners, normals in _triangles(body, factor):
            table = np.zeros(len(corners), TRIANGLE)
            table["corners"], table["normal"] = corners, normals
            file.write(table.tobytes())


def write_ascii(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write one ``solid`` per body, with nine digits, which reproduce each float32 exactly."""
    for body in bodies:
        file.write(f"solid {body.name}\n".encode())
        triangles = _triangles(body, factor)
        _write_rows(file, TEXT, (np.column_stack([n, c.reshape(-1, 9)]) for c, n in triangles))
        file.write(f"endsolid {body.name}\n".encode())


def _triangles(
    body: Body, factor: float
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Yield corners (k, 3, 3), as they are written, and unit normals (k, 3), piece by piece."""
    for faces in split_pieces(body.faces):
        corners = (body.vertices[faces] * factor).astype(np.float32)
        exact = corners.astype(np.float64)
        normal = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        yield corners, (normal / np.where(length > 0.0, length, 1.0)).astype(np.float32)


#: Numbers of a vertex in a PLY. Modes have 32 bits, because some readers accept no smaller type.
NUMBERS = {"x": "<f4", "y": "<f4", "z": "<f4", "height": "<f4", "force": "<f4", "mode": "<i4"}
VERTEX = np.dtype(list(NUMBERS.items()))
FACE = np.dtype([("count", "u1"), ("vertices", "<i4", 3)])


def write_ply(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies in sequence, lengths in 1 / `factor` m, forces in N."""
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment digiclay, lengths and height in {'mm' if factor > 1.0 else 'm'}, z up",
        f"comment force in N, pressing down is positive; mode {NO_PIN}: no pin",
        *(
            f"comment {body.name}: {len(body.vertices)} vertices, {len(body.faces)} faces"
            for body in bodies
        ),
        f"element vertex {sum(len(body.vertices) for body in bodies)}",
        *(
            f"property {'int' if kind == '<i4' else 'float'} {name}"
            for name, kind in NUMBERS.items()
        ),
        f"element face {sum(len(body.faces) for body in bodies)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    file.write("\n".join(lines).encode())
    for body in bodies:
        # Vertices without values belong to no pin and bear no force.
        force, mode = (np.broadcast_to(value, len(body.vertices)) for value in (0.0, NO_PIN))
        values = body.values or {"height": body.vertices[:, 2], "force": force, "mode": mode}
        columns = body.vertices, values["height"], values["force"], values["mode"]
        for vertices, height, force, mode in zip(*map(split_pieces, columns), strict=True):
            columns_in_file = [*(vertices * factor).T, height * factor, force, mode]
            file.write(np.rec.fromarrays(columns_in_file, VERTEX).tobytes())
    first = 0
    for body in bodies:
        for faces in split_pieces(body.faces):
            table = np.empty(len(faces), FACE)
            table["count"], table["vertices"] = 3, faces + first
            file.write(table.tobytes())
        first += len(body.vertices)


def write_obj(
    file: BinaryIO, bodies: Sequence[Body], factor: float, up: str = UP, forward: str = ""
) -> None:
    """Write the bodies, lengths in 1 / `factor` m to the nearest nanometer; faces of no group come first."""
    axes, unit = make_axes(up, forward), "mm" if factor > 1.0 else "m"
    line = "v {0} {0} {0}\n".format("%.6f" if factor > 1.0 else "%.9f")
    file.write(
        f"# digiclay, lengths in {unit}, {up} up, {forward or find_forward(up)} forward\n".encode()
    )
    first = 1
    for body in bodies:
        file.write(f"o {body.name}\n".encode())
        _write_rows(file, line, (piece @ (axes * factor) for piece in split_pieces(body.vertices)))
        groups = [("", body.faces)]
        if body.groups:
            names = enumerate(("rest", *body.groups))
            groups = [(f"g {name}\n", body.faces[body.group == number]) for number, name in names]
        for head, faces in groups:
            file.write(head.encode())
            pieces = (piece.astype(np.int64) + first for piece in split_pieces(faces))
            _write_rows(file, "f %d %d %d\n", pieces)
        first += len(body.vertices)


def _write_rows(file: BinaryIO | IO[bytes], line: str, pieces: Iterable[Array]) -> None:
    """Write each row of the pieces of a table as a line of text."""
    for rows in pieces:
        file.write(((line * len(rows)) % tuple(rows.ravel().tolist())).encode())


FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
#: A file's length is a 32-bit number.
LARGEST = 2**32 - 1
#: The material.
CLAY = {"name": "clay", "pbrMetallicRoughness": {"metallicFactor": 0.0}}


class GlbArrays:
    """Arrays of a GLB, each with a view of the buffer and an accessor."""

    def __init__(self) -> None:
        self._arrays: list[Array] = []
        self._views: list[Record] = []
        self._accessors: list[Record] = []
        self._size = 0

    def add(self, array: Array, kind: str = "SCALAR", **target: int) -> int:
        """Add an array as floats or unsigned numbers; return the number of its accessor."""
        component, stored_as = (FLOAT, "<f4") if array.dtype.kind == "f" else (UNSIGNED, "<u4")
        stored = np.ascontiguousarray(array, stored_as)
        self._views.append(
            {"buffer": 0, "byteOffset": self._size, "byteLength": stored.nbytes, **target}
        )
        accessor = {"bufferView": len(self._arrays), "componentType": component, "type": kind}
        # The bounds must be those of the stored numbers.
        low, high = (np.atleast_1d(bound).tolist() for bound in (stored.min(0), stored.max(0)))
        self._accessors.append({**accessor, "count": len(stored), "min": low, "max": high})
        self._arrays.append(stored)
        self._size += stored.nbytes
        return len(self._arrays) - 1

    def write(self, file: BinaryIO, tree: Record) -> None:
        """Write the arrays after a tree that names them; OutputError if they are too large."""
        described = {
            "asset": {"version": "2.0", "generator": "digiclay"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(tree["nodes"])))}],
            **tree,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self._size}],
        }
        text = json.dumps(described, separators=(",", ":")).encode()
        text = text.ljust(-(-len(text) // 4) * 4)
        whole = 12 + 8 + len(text) + 8 + self._size
        if whole > LARGEST:
            size = f"{whole / 2**30:.3g} GiB"
            raise OutputError(f"A GLB holds at most 4 GiB (got {size}): choose another format.")
        file.write(struct.pack("<4sIII4s", b"glTF", 2, whole, len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", self._size, b"BIN\0"))
        for array in self._arrays:
            file.write(array.tobytes())


def write_glb(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies in meters, whatever the factor."""
    arrays = GlbArrays()
    meshes = [
        {"name": body.name, "primitives": [add_triangles(arrays, body.vertices, body.faces)]}
        for body in bodies
    ]
    nodes = [{"mesh": number, "name": body.name} for number, body in enumerate(bodies)]
    arrays.write(file, {"nodes": nodes, "meshes": meshes, "materials": [CLAY]})


def add_triangles(arrays: GlbArrays, vertices: Floats, faces: Array) -> Record:
    """Add triangles with the material number 0; return them as a part of a mesh."""
    corners = arrays.add(turn(vertices, make_axes(UP)), "VEC3", target=VERTICES)
    indices = arrays.add(faces.ravel(), target=INDICES)
    return {"attributes": {"POSITION": corners}, "indices": indices, "material": 0}


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
TYPES = (
    f'{HEAD}<Types xmlns="{PACKAGE}/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
    "</Types>\n"
)
RELATIONS = (
    f'{HEAD}<Relationships xmlns="{PACKAGE}/relationships">'
    '<Relationship Id="model" Target="/3D/3dmodel.model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)
#: Time of all entries, so that the same mesh gives the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)


def write_3mf(file: BinaryIO, bodies: Sequence[Body], factor: float) -> None:
    """Write the bodies as objects, lengths in 1 / `factor` m, to the nearest nanometer."""
    unit, form = ("millimeter", "%.6f") if factor > 1.0 else ("meter", "%.9f")
    vertex = f'<vertex x="{form}" y="{form}" z="{form}"/>\n'
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, text in (("[Content_Types].xml", TYPES), ("_rels/.rels", RELATIONS)):
            archive.writestr(zipfile.ZipInfo(name, MOMENT), text)
        model = zipfile.ZipInfo("3D/3dmodel.model", MOMENT)
        model.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(model, "w", force_zip64=True) as part:
            part.write(
                f'{HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{CORE}">\n<resources>\n'.encode()
            )
            for number, body in enumerate(bodies, 1):
                # Only a closed body may be a "model".
                kind = "model" if body.closed else "surface"
                part.write(
                    f'<object id="{number}" type="{kind}" name="{body.name}"><mesh>\n'.encode()
                )
                part.write(b"<vertices>\n")
                _write_rows(part, vertex, (piece * factor for piece in split_pieces(body.vertices)))
                part.write(b"</vertices>\n<triangles>\n")
                _write_rows(part, '<triangle v1="%d" v2="%d" v3="%d"/>\n', split_pieces(body.faces))
                part.write(b"</triangles>\n</mesh></object>\n")
            items = "".join(
                f'<item objectid="{number}"/>\n' for number in range(1, len(bodies) + 1)
            )
            part.write(f"</resources>\n<build>\n{items}</build>\n</model>\n".encode())


class Format(NamedTuple):
    """Format of a mesh file."""

    meaning: str
    """Line in the help."""
    write: Callable[[BinaryIO, Sequence[Body], float], None]


#: File formats, by name; help, dialogs and their filters of file names are made of this table.
FORMATS: dict[str, Format] = {
    "stl": Format("STL, binary", write_binary),
    "stl_ascii": Format("STL as text", write_ascii),
    "obj": Format(
        "Wavefront OBJ, with a group for each feature; y up as in Blender's, other axes by option",
        write_obj,
    ),
    "ply": Format("Stanford PLY, binary, with height, force and mode of each vertex", write_ply),
    "glb": Format("binary glTF, in meters and y up as its standard says", write_glb),
    "3mf": Format("3MF, which names its unit", write_3mf),
}

#: Units of length of a file, per meter.
UNITS: dict[str, float] = {"mm": 1e3, "m": 1.0}


def find_format(name: str) -> str:
    """Return the format called `name` (``"stl"``, ``".STL"``) as a key of `FORMATS`, or raise OutputError."""
    key = name.lower().removeprefix(".")
    if key not in FORMATS:
        raise OutputError(f"Unknown mesh format {key!r}: known are {', '.join(FORMATS)}.")
    return key


def find_suffix(kind: str) -> str:
    """Return the extension of a format; text and binary STL have different ones."""
    return ".ascii.stl" if kind == "stl_ascii" else f".{kind}"


def write(
    bodies: Sequence[Body],
    path: str | Path,
    unit: str = "mm",
    kind: str | None = None,
    up: str = UP,
    forward: str = "",
) -> Path:
    """Write bodies to a file in a unit of `UNITS`, and return it; it replaces an older one when complete."""
    target = Path(path)
    format_name = find_format(target.suffix if kind is None else kind)
    writer = (
        partial(write_obj, up=up, forward=forward)
        if format_name == "obj"
        else FORMATS[format_name].write
    )
    make_axes(up, forward)  # refuses axes before the file is opened
    if unit not in UNITS:
        raise ParameterError("Export", "unit", f"must be one of {', '.join(UNITS)}", repr(unit))
    if not any(len(body.faces) for body in bodies):
        raise OutputError(f"There is nothing to write to {target}.")
    with open_whole(target) as file:
        writer(file, bodies, UNITS[unit])
    return target
