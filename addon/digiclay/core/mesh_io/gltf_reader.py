"""Reader of glTF files, GLB and JSON: the triangles of all nodes of the scene, in meters, y up.

Materials and pictures are not opened; a file of vertices must lie in the glTF's folder, or below
it.
"""

import base64
import binascii
import json
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..base.arrays import Array, Floats, Indices
from ..base.errors import ParameterError
from ..files.formats import read_count
from ..files.tables import Record
from ..model.fingertip import make_matrices
from .mesh_limits import (
    IDENTITY,
    join_meshes,
    make_refusal,
    nest_placement,
    refuse_many_triangles,
    refuse_size,
)

INSIDE = "must have its vertices in the file, or in a file in its own folder"
#: Types of numbers, and the count of numbers in an item.
NUMBERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
ITEMS = {"SCALAR": 1, "VEC3": 3}
TRIANGLES, STRIP, FAN = 4, 5, 6
#: Extensions that change no vertex, or that are read.
HARMLESS = re.compile(
    r"KHR_(materials|texture|lights|xmp|animation|mesh_quantization)\w*|EXT_texture\w*"
)
#: Extensions that add copies or hide nodes, which a reader may ignore unless they are required.
OPTIONAL = ("EXT_mesh_gpu_instancing", "KHR_node_visibility")


def read(path: Path, data: bytes) -> tuple[Floats, Indices]:
    """Return vertices (v, 3), m, and triangles (f, 3) of a file's bytes; `path`: the file."""
    try:
        tree, binary = _chunks(data, path.name) if data[:4] == b"glTF" else (json.loads(data), None)
        if not str(tree["asset"]["version"]).startswith("2."):
            raise ValueError(f"its version is {tree['asset']['version']}")
        needed = [
            name for name in tree.get("extensionsRequired", []) if not HARMLESS.fullmatch(name)
        ]
        needed += [name for name in OPTIONAL if name in tree.get("extensionsUsed", [])]
        if needed:
            raise make_refusal(
                "must not need an extension that changes its vertices", path.name, needed[0]
            )
        file = _File(path, tree, binary)
        parts = list(file.surfaces())
        refuse_many_triangles(path.name, sum(file.triangles(part) for part, _ in parts))
        # Unused vertices are copied as well.
        vertices = sum(file.size(part["attributes"]["POSITION"]) for part, _ in parts)
        refuse_many_triangles(path.name, vertices // 3)
        return join_meshes(((*file.mesh(part), placement) for part, placement in parts), path.name)
    except ParameterError:
        raise
    except RecursionError:
        content = "nested too deeply"
    except KeyError as error:
        content = f"{error} is missing"
    except (
        ValueError,
        TypeError,
        IndexError,
        AttributeError,
        OverflowError,
        struct.error,
    ) as error:
        content = str(error)
    raise make_refusal("must be a glTF 2.0 file that can be read", path.name, content)


def _chunks(data: bytes, name: str) -> tuple[Any, bytes | None]:
    """Return the JSON of a GLB, and its bytes."""
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise ValueError(f"its version is {version}")
    if length > len(data):
        raise make_refusal("must be whole", name, f"{len(data):,} of its {length:,} bytes")
    at, chunks = 12, []
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > length:
            raise make_refusal(
                "must be whole", name, f"a part of {size:,} bytes that are not there"
            )
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    if not chunks or chunks[0][0] != b"JSON":
        raise ValueError("its first part is not JSON")
    return json.loads(chunks[0][1]), next((part for kind, part in chunks if kind == b"BIN\0"), None)


class _File:
    """Tables of a glTF, and the buffers read so far."""

    def __init__(self, path: Path, tree: Record, binary: bytes | None) -> None:
        self._path, self._tree, self._binary = path, tree, binary
        self._buffers: dict[int, bytes] = {}
        self._bytes = 0

    def _entry(self, table: str, index: Any) -> Any:
        """Return an entry of a table, by its number."""
        entries = self._tree.get(table, [])
        if read_count(index) >= len(entries):
            raise ValueError(f"there is no entry {index} in {table}")
        return entries[index]

    def surfaces(self) -> Iterator[tuple[Any, Floats]]:
        """Yield the parts of the nodes' meshes that are triangles, and their placements."""
        nodes = self._tree.get("nodes", [])
        if self._tree.get("scenes"):
            roots = self._entry("scenes", self._tree.get("scene", 0)).get("nodes", [])
        else:
            inner = {child for node in nodes for child in node.get("children", [])}
            roots = [index for index in range(len(nodes)) if index not in inner]
        waiting, seen = [(index, IDENTITY) for index in reversed(roots)], set()
        while waiting:
            index, outer = waiting.pop()
            node = self._entry("nodes", index)
            if index in seen:
                raise ValueError(f"node {index} stands in two places")
            seen.add(index)
            mesh = self._entry("meshes", node["mesh"]) if "mesh" in node else {"primitives": []}
            weights = node.get("weights", mesh.get("weights", []))
            if mesh["primitives"] and ("skin" in node or any(weights)):
                rule = "must not be bent by a skin or by weights: apply them first"
                raise make_refusal(rule, self._path.name, f"node {index}")
            placement = nest_placement(_placement(node), outer)
            waiting += [(child, placement) for child in reversed(node.get("children", []))]
            for part in mesh["primitives"]:
                if part.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN):
                    yield part, placement

    def size(self, accessor: Any) -> int:
        """Return how many items an accessor has."""
        return read_count(self._entry("accessors", accessor)["count"])

    def triangles(self, primitive: Any) -> int:
        """Return how many triangles a part of a mesh has."""
        corners = self.size(primitive.get("indices", primitive["attributes"]["POSITION"]))
        return (
            corners // 3 if primitive.get("mode", TRIANGLES) == TRIANGLES else max(0, corners - 2)
        )

    def mesh(self, primitive: Any) -> tuple[Floats, Indices]:
        """Return vertices and triangles of a part of a mesh."""
        vertices = self._numbers(primitive["attributes"]["POSITION"], "VEC3").astype(np.float64)
        corners = np.arange(len(vertices))
        if "indices" in primitive:
            corners = self._numbers(primitive["indices"], "SCALAR")[:, 0].astype(np.int64)
        mode = primitive.get("mode", TRIANGLES)
        if mode == TRIANGLES:
            if corners.size % 3:
                raise ValueError(f"{corners.size} corners are no triangles")
            return vertices, corners.reshape(-1, 3)
        number = np.arange(self.triangles(primitive))
        # Every other triangle of a strip has the opposite orientation; those of a fan share the
        # first corner.
        first, odd = (0 * number, 0) if mode == FAN else (number, number % 2)
        return vertices, corners[np.column_stack([first, number + 1 + odd, number + 2 - odd])]

    def _numbers(self, accessor: Any, kind: str) -> Array:
        """Return the items of an accessor, (count, numbers per item)."""
        entry = self._entry("accessors", accessor)
        if "bufferView" not in entry or "sparse" in entry:
            rule = "must not hold compressed or sparse vertices"
            raise make_refusal(rule, self._path.name, f"accessor {accessor}")
        if entry["type"] != kind or entry["componentType"] not in NUMBERS:
            raise ValueError(f"accessor {accessor} is no {kind} of a known type")
        number = np.dtype(NUMBERS[entry["componentType"]])
        width, count = ITEMS[kind], self.size(accessor)
        view = self._entry("bufferViews", entry["bufferView"])
        item = number.itemsize * width
        offset = read_count(entry.get("byteOffset", 0))
        stride = read_count(view.get("byteStride", item))
        start = read_count(view.get("byteOffset", 0))
        length = read_count(view["byteLength"])
        buffer = self._buffer(view["buffer"])
        if stride < item or (count and offset + (count - 1) * stride + item > length):
            raise ValueError(f"accessor {accessor} reaches beyond its view")
        if start + length > len(buffer):
            content = f"{len(buffer):,} bytes of {start + length:,}"
            raise make_refusal("must be whole", self._path.name, content)
        strides = (stride, number.itemsize)
        items: Array = np.ndarray((count, width), number, buffer, start + offset, strides)
        if number.kind != "f" and entry.get("normalized", False):
            return np.maximum(items / float(np.iinfo(number).max), -1.0)
        return items

    def _buffer(self, index: Any) -> bytes:
        """Return the bytes of a buffer."""
        uri = self._entry("buffers", index).get("uri")
        if index not in self._buffers:
            if uri is None and index == 0 and self._binary is not None:
                return self._binary
            if not isinstance(uri, str):
                raise ValueError(f"buffer {index} has no bytes")
            self._buffers[index] = _inline(uri) if uri.startswith("data:") else self._beside(uri)
        return self._buffers[index]

    def _beside(self, uri: str) -> bytes:
        """Return the bytes of a file in the folder of this one."""
        # A drive, a scheme, an absolute path and a share are outside the folder.
        name, folder = unquote(uri), self._path.parent.resolve()
        outside = ":" in name or "\\" in name or "\0" in name or name.startswith("/")
        file = folder if outside else (folder / name).resolve()
        if outside or not file.is_relative_to(folder):
            raise make_refusal(INSIDE, self._path.name, f"{uri!r}")
        if not file.is_file():
            raise make_refusal("must have its files beside it", self._path.name, f"no {uri!r}")
        self._bytes += file.stat().st_size
        refuse_size(self._path.name, self._bytes)
        return file.read_bytes()


def _inline(uri: str) -> bytes:
    """Return the bytes in an address that begins with ``data:``."""
    head, _, text = uri.partition(",")
    if not head.endswith(";base64"):
        raise ValueError("bytes as text that is not base64")
    try:
        return base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise ValueError(f"bytes as text: {error}") from None


def _placement(node: Any) -> Floats:
    """Return the placement, (4, 3), of a node's content."""
    if "matrix" in node:  # column by column
        return np.array(node["matrix"], np.float64).reshape(4, 4)[:, :3]
    x, y, z, w = map(float, node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    quaternion = np.array([[w, x, y, z]])
    with np.errstate(all="ignore"):  # numbers that are not finite are refused with the vertices
        if not np.linalg.norm(quaternion):
            quaternion[0, 0] = 1.0
        (turn,) = make_matrices(quaternion)
    scale = np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64).reshape(3, 1)
    shift = np.array(node.get("translation", (0.0, 0.0, 0.0)), np.float64).reshape(1, 3)
    return np.concatenate([scale * turn.T, shift])
