"""Readers of STL, PLY and OFF files, text and binary: vertices and triangles; polygons are cut into fans."""

from __future__ import annotations

import re
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError
from .mesh_limits import MOST_TRIANGLES, make_refusal, refuse_many_triangles

WHOLE = "must be whole: the file is cut off"
#: A head is no longer than this.
LONGEST_HEAD = 1 << 16
#: Triangle of a binary STL.
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
#: Codes of the numbers of a PLY, for numpy and struct.
NUMBERS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
    "double": "d", "float64": "d",
}  # fmt: skip
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
    count = int.from_bytes(data[80:84], "little") or (len(data) - 84) // 50
    head = data[:LONGEST_HEAD].lstrip().lower()
    text = head.startswith(b"solid") and (b"facet" in head or b"endsolid" in head)
    if text and len(data) != 84 + 50 * count:
        lower = data.lower()
        begun, ended = lower.count(b"facet normal"), lower.count(b"endfacet")
        words = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", lower)
        if not begun == ended == len(words) / 3 or not re.search(rb"[\r\n]\s*endsolid[^\r\n]*\s*\Z", lower):
            content = f"{begun:,} facets begin, {ended:,} end, and the last line no endsolid"
            raise make_refusal(WHOLE, name, content)
        refuse_many_triangles(name, ended)
        places = np.array(words, np.float64).reshape(-1, 3) if words else np.empty((0, 3))
    else:
        there, rest = divmod(max(0, len(data) - 84), 50)
        if (there < count and (rest or count < 2**32 - 1)) or len(data) < 84:
            if count > MOST_TRIANGLES:
                raise ValueError(f"it begins with {data[:8]!r}")
            raise make_refusal(WHOLE, name, f"{there:,} of its {count:,} triangles")
        count = min(count, there)  # some programs leave the count at its largest
        refuse_many_triangles(name, count)
        places = np.frombuffer(data, TRIANGLE, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
    return places, np.arange(len(places)).reshape(-1, 3)


class _Property(NamedTuple):
    """Property of a PLY's element: name, code of its numbers, and that of its length if it is a list."""

    name: str
    code: str
    length: str = ""


def _read_ply(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Read a PLY; a text is turned into the bytes of a binary one."""
    end = re.search(rb"^end_header[ \t]*\r?$\n?", data[:LONGEST_HEAD], re.MULTILINE)
    if not data.startswith(b"ply") or end is None:
        raise ValueError("no head, or no end of it")
    text, order = False, "<"
    elements: list[tuple[str, int, list[_Property]]] = []
    for line in data[: end.start()].decode("ascii", errors="replace").splitlines():
        words = line.split()
        try:
            if words[:1] == ["format"]:
                text, order = words[1] == "ascii", ">" if words[1] == "binary_big_endian" else "<"
            elif words[:1] == ["element"]:
                elements.append((words[1], int(words[2]), []))
            elif words[:1] == ["property"]:
                kinds = words[2 if words[1] == "list" else 1 : -1]
                codes = ["d" if text else NUMBERS[word] for word in kinds]
                elements[-1][2].append(_Property(words[-1], codes[-1], codes[-2] if len(codes) > 1 else ""))
        except (ValueError, IndexError, KeyError):
            raise ValueError(f"{line[:60]!r} in its head") from None
    body = data[end.end() :]
    if text:
        body = np.array(body.split(), np.float64).tobytes()
    at, tables = 0, {}
    for kind, count, properties in elements:
        least = struct.calcsize(order + "".join(one.length or one.code for one in properties))
        if count < 0 or (count and not least):
            raise ValueError(f"{count} {kind} without properties")
        if kind == "face":
            refuse_many_triangles(name, count)
        if at + count * least > len(body):
            content = f"{len(body) - at:,} bytes where its {kind} elements take at least {count * least:,}"
            raise make_refusal(WHOLE, name, content)
        tables[kind], at = _read_element(body, at, count, properties, order)
    if "face" not in tables:
        raise make_refusal("must have faces", name, f"only {' and '.join(tables)} elements")
    vertices = tables["vertex"]
    places = np.column_stack([np.concatenate(vertices[axis]).astype(np.float64) for axis in "xyz"])
    return places, _cut(next(tables["face"][word] for word in CORNERS if word in tables["face"]), name)


def _read_element(
    body: bytes, at: int, count: int, properties: list[_Property], order: str
) -> tuple[dict[str, list[NDArray[Any]]], int]:
    """Return the values of an element by property, arrays (rows[, length of a list]), and where it ends."""
    measured = [
        (
            one.length and struct.Struct(order + one.length),
            struct.calcsize(one.length),
            struct.calcsize(one.code),
        )
        for one in properties
    ]

    def measure(place: int) -> tuple[tuple[int, ...], int]:
        """Return the lengths of a row's lists, 1 for a number, and where the row ends."""
        sizes = []
        for length, width, item in measured:
            sizes.append(int(length.unpack_from(body, place)[0]) if length else 1)
            place += width + item * sizes[-1]
        return tuple(sizes), place

    def make_row(sizes: tuple[int, ...]) -> np.dtype[Any]:
        fields: list[Any] = []
        for one, size in zip(properties, sizes, strict=True):
            fields += [(f"length of {one.name}", order + one.length)] if one.length else []
            fields.append((one.name, order + one.code, (size,) if one.length else ()))
        return np.dtype(fields)

    sizes, _ = measure(at) if count else ((0,) * len(properties), at)
    row = make_row(sizes)
    groups = []
    if at + count * row.itemsize <= len(body):
        groups = [np.frombuffer(body, row, count, at)]
    lists = [
        (f"length of {one.name}", size) for one, size in zip(properties, sizes, strict=True) if one.length
    ]
    if groups and all(np.all(groups[0][length] == size) for length, size in lists):
        at += count * row.itemsize
    else:
        starts: dict[tuple[int, ...], list[int]] = {}
        for _ in range(count):
            sizes, end = measure(at)
            starts.setdefault(sizes, []).append(at)
            at = end
        if at > len(body):
            raise ValueError("its lists end behind the file")
        octets = np.frombuffer(body, np.uint8)
        rows = ((make_row(sizes), np.array(places)) for sizes, places in starts.items())
        groups = [
            octets[np.add.outer(places, np.arange(row.itemsize))].view(row)[:, 0] for row, places in rows
        ]
    return {one.name: [group[one.name] for group in groups] for one in properties}, at


def _cut(polygons: list[NDArray[Any]], name: str) -> Indices:
    """Return the triangles (f, 3) of polygons, arrays (count, corners), as fans."""
    refuse_many_triangles(name, sum(each.shape[0] * max(0, each.shape[1] - 2) for each in polygons))
    fans = [np.empty((0, 3), np.int64)]
    for each in polygons:
        for corner in range(1, each.shape[1] - 1):
            fans.append(each[:, [0, corner, corner + 1]].astype(np.int64))
    return np.concatenate(fans)


def _read_off(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Read an OFF, also with colors and normals behind the places and faces."""
    lines = [line for line in (part.partition(b"#")[0].split() for part in data.splitlines()) if line]
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
    places = np.array([line[:3] for line in lines[:count]], np.float64).reshape(-1, 3)
    polygons = []
    for line in lines[count : count + faces]:
        polygons.append(np.array([line[1 : int(line[0]) + 1]], np.int64))
        if polygons[-1].shape[1] != int(line[0]):
            raise make_refusal(WHOLE, name, f"a face of {line[0].decode()} corners without them")
    return places, _cut(polygons, name)


READERS = {".stl": _read_stl, ".ply": _read_ply, ".off": _read_off}
