"""Readers of STL, PLY and OFF files, text and binary: vertices and triangles."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Array, Floats, Indices
from ..base.errors import ParameterError
from .mesh_limits import MOST_TRIANGLES, make_refusal, refuse_many_triangles
from .polygons import cut

WHOLE = "must be whole: the file is cut off"
#: A head is no longer than this.
LONGEST_HEAD = 1 << 16
#: Bytes before the triangles of a binary STL, and a triangle of it.
HEAD = 84
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
#: Codes of the numbers of a PLY, for numpy and struct.
NUMBERS = {
    "char": "b",
    "int8": "b",
    "uchar": "B",
    "uint8": "B",
    "short": "h",
    "int16": "h",
    "ushort": "H",
    "uint16": "H",
    "int": "i",
    "int32": "i",
    "uint": "I",
    "uint32": "I",
    "float": "f",
    "float32": "f",
    "double": "d",
    "float64": "d",
}
#: Lists of a PLY's faces.
CORNERS = ("vertex_indices", "vertex_index")


def read(data: bytes, kind: str, name: str) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of a file's bytes; `kind`: a key of `READERS`."""
    try:
        return READERS[kind](data, name)
    except ParameterError:
        raise
    except struct.error:
        raise make_refusal(WHOLE, name, f"{len(data):,} bytes") from None
    except (ValueError, IndexError, KeyError, OverflowError) as error:
        content = " ".join(str(error).split())[:100]
    article = "a" if kind == ".ply" else "an"
    raise make_refusal(f"must be {article} {kind[1:].upper()} file that can be read", name, content)


def _read_stl(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Read an STL, three vertices a triangle; bytes behind its last triangle are not looked at."""
    count = int.from_bytes(data[80:84], "little") or (len(data) - HEAD) // TRIANGLE.itemsize
    head = data[:LONGEST_HEAD].lstrip().lower()
    text = head.startswith(b"solid") and (b"facet" in head or b"endsolid" in head)
    if text and len(data) != HEAD + TRIANGLE.itemsize * count:
        corners = _read_text_stl(data.lower(), name)
    else:
        corners = _read_binary_stl(data, count, name)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _read_text_stl(text: bytes, name: str) -> Floats:
    """Return the corners (3 f, 3) of an STL in small letters."""
    begun, ended = text.count(b"facet normal"), text.count(b"endfacet")
    corners = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", text)
    closed = re.search(rb"[\r\n]\s*endsolid[^\r\n]*\s*\Z", text)
    if not closed or not begun == ended == len(corners) / 3:
        content = f"{begun:,} facets begin, {ended:,} end, and the last line no endsolid"
        raise make_refusal(WHOLE, name, content)
    refuse_many_triangles(name, ended)
    return np.array(corners, np.float64).reshape(-1, 3)


def _read_binary_stl(data: bytes, count: int, name: str) -> Floats:
    """Return the corners (3 f, 3) of a binary STL whose head names so many triangles."""
    if len(data) < HEAD:
        raise make_refusal(WHOLE, name, f"{len(data)} of at least {HEAD} bytes")
    whole, rest = divmod(len(data) - HEAD, TRIANGLE.itemsize)
    # Some programs leave the count at its largest.
    counted = rest or count < 2**32 - 1
    if whole < count and counted:
        if count > MOST_TRIANGLES:
            raise ValueError(f"it begins with {data[:8]!r}")
        raise make_refusal(WHOLE, name, f"{whole:,} of its {count:,} triangles")
    count = min(count, whole)
    refuse_many_triangles(name, count)
    triangles = np.frombuffer(data, TRIANGLE, count, HEAD)
    return triangles["corners"].reshape(-1, 3).astype(np.float64)


class _Property(NamedTuple):
    """Property of a PLY's element: name, code of its numbers, and that of its length if it is a list."""

    name: str
    code: str
    length: str = ""


@dataclass(frozen=True)
class _Element:
    """Element of a PLY: vertices, faces, or others."""

    kind: str
    count: int
    properties: list[_Property]
    #: Of the bytes: ``<`` or ``>``.
    order: str

    @property
    def least(self) -> int:
        """Least number of bytes of a row, whose lists are empty."""
        return struct.calcsize(
            self.order + "".join(part.length or part.code for part in self.properties)
        )

    def make_row(self, sizes: tuple[int, ...]) -> np.dtype[Any]:
        """Return the type of a row whose lists have these lengths; a number has any."""
        fields: list[Any] = []
        for part, size in zip(self.properties, sizes, strict=True):
            if part.length:
                fields.append((_name_length(part), self.order + part.length))
            fields.append((part.name, self.order + part.code, (size,) if part.length else ()))
        return np.dtype(fields)

    def measure(self, body: bytes, at: int) -> tuple[tuple[int, ...], int]:
        """Return the lengths of a row's lists, 1 for a number, and where the row ends."""
        sizes = []
        for part in self.properties:
            size = 1
            if part.length:
                size = int(struct.unpack_from(self.order + part.length, body, at)[0])
                at += struct.calcsize(part.length)
            sizes.append(size)
            at += struct.calcsize(part.code) * size
        return tuple(sizes), at

    def read(self, body: bytes, start: int) -> tuple[dict[str, list[Array]], int]:
        """Return the values by property, arrays (rows[, length of a list]), and where they end."""
        sizes = self.measure(body, start)[0] if self.count else (0,) * len(self.properties)
        row = self.make_row(sizes)
        end = start + self.count * row.itemsize
        groups = [np.frombuffer(body, row, self.count, start)] if end <= len(body) else []
        lists = [
            (part, size) for part, size in zip(self.properties, sizes, strict=True) if part.length
        ]
        if not groups or not all(
            np.all(groups[0][_name_length(part)] == size) for part, size in lists
        ):
            groups, end = self._read_unlike(body, start)
        return {part.name: [group[part.name] for group in groups] for part in self.properties}, end

    def _read_unlike(self, body: bytes, start: int) -> tuple[list[Array], int]:
        """Return rows whose lists differ in length, an array for each length, and where they end."""
        starts: dict[tuple[int, ...], list[int]] = {}
        for _ in range(self.count):
            sizes, end = self.measure(body, start)
            starts.setdefault(sizes, []).append(start)
            start = end
        if start > len(body):
            raise ValueError("its lists end behind the file")
        octets, groups = np.frombuffer(body, np.uint8), []
        for sizes, rows in starts.items():
            row = self.make_row(sizes)
            groups.append(octets[np.add.outer(rows, np.arange(row.itemsize))].view(row)[:, 0])
        return groups, start


def _name_length(part: _Property) -> str:
    return f"length of {part.name}"


def _read_ply(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Read a PLY; a text is turned into the bytes of a binary one."""
    end = re.search(rb"^end_header[ \t]*\r?$\n?", data[:LONGEST_HEAD], re.MULTILINE)
    if not data.startswith(b"ply") or end is None:
        raise ValueError("no head, or no end of it")
    text, elements = _read_head(data[: end.start()].decode("ascii", errors="replace"))
    body = data[end.end() :]
    if text:
        body = np.array(body.split(), np.float64).tobytes()
    start, tables = 0, {}
    for element in elements:
        least = element.count * element.least
        if element.count < 0 or (element.count and not least):
            raise ValueError(f"{element.count} {element.kind} without properties")
        if element.kind == "face":
            refuse_many_triangles(name, element.count)
        if start + least > len(body):
            content = f"{len(body) - start:,} bytes where its {element.kind} elements take at least {least:,}"
            raise make_refusal(WHOLE, name, content)
        tables[element.kind], start = element.read(body, start)
    if "face" not in tables:
        raise make_refusal("must have faces", name, f"only {' and '.join(tables)} elements")
    vertices, faces = tables["vertex"], tables["face"]
    points = np.column_stack([np.concatenate(vertices[axis]).astype(np.float64) for axis in "xyz"])
    return points, _cut(points, next(faces[word] for word in CORNERS if word in faces), name)


def _read_head(head: str) -> tuple[bool, list[_Element]]:
    """Return whether a PLY is a text, and the elements that its head declares."""
    text, order = False, "<"
    elements: list[tuple[str, int, list[_Property]]] = []
    for line in head.splitlines():
        keyword, *words = line.split() or [""]
        try:
            if keyword == "format":
                text, order = words[0] == "ascii", ">" if words[0] == "binary_big_endian" else "<"
            elif keyword == "element":
                elements.append((words[0], int(words[1]), []))
            elif keyword == "property":
                kinds = words[1 if words[0] == "list" else 0 : -1]
                codes = ["d" if text else NUMBERS[word] for word in kinds]
                elements[-1][2].append(
                    _Property(words[-1], codes[-1], codes[-2] if len(codes) > 1 else "")
                )
        except (ValueError, IndexError, KeyError):
            raise ValueError(f"{line[:60]!r} in its head") from None
    return text, [_Element(*element, order) for element in elements]


def _cut(points: Floats, polygons: list[Array], name: str) -> Indices:
    """Return the triangles (f, 3) of polygons, arrays (count, corners)."""
    none = np.empty(0, np.int64)
    corners = [group.ravel().astype(np.int64) for group in polygons]
    sizes = [np.full(len(group), group.shape[1]) for group in polygons]
    return cut(points, np.concatenate([none, *corners]), np.concatenate([none, *sizes]), name)


def _read_off(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Read an OFF, also with colors and normals behind the places and faces."""
    lines = [
        line for line in (part.partition(b"#")[0].split() for part in data.splitlines()) if line
    ]
    head = lines.pop(0)
    if re.fullmatch(rb"(?i:(ST)?C?N?OFF)", head[0]):
        head = head[1:] or lines.pop(0)
    try:
        count, faces = int(head[0]), int(head[1])
    except (IndexError, ValueError):
        raise ValueError("no counts of vertices and faces") from None
    refuse_many_triangles(name, max(faces, count // 3))
    if len(lines) < count + faces:
        raise make_refusal(WHOLE, name, f"{len(lines):,} of its {count + faces:,} lines")
    points = np.array([line[:3] for line in lines[:count]], np.float64).reshape(-1, 3)
    polygons = []
    for line in lines[count : count + faces]:
        corners = int(line[0])
        polygon = np.array([line[1 : corners + 1]], np.int64)
        if polygon.shape[1] != corners:
            raise make_refusal(WHOLE, name, f"a face of {corners} corners without them")
        polygons.append(polygon)
    return points, _cut(points, polygons, name)


READERS = {".stl": _read_stl, ".ply": _read_ply, ".off": _read_off}
