"""Wavefront OBJ files: their axes, and a reader of vertices and faces; materials are not opened."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from .mesh_limits import make_refusal, refuse_many_triangles

AXES = ("x", "y", "z", "-x", "-y", "-z")
#: Upward axis of Blender's exporter and importer; the forward one to it is -z.
UP = "y"
#: Forward axes, the bed's y, where they are not y: x stays x if it can.
FORWARD = {"y": "-z", "-y": "z", "-z": "-y"}
COMMENT = re.compile(rb"^#[^\n]*?(?<![\w-])(-?[xyz]) up\b(?:, (-?[xyz]) forward)?", re.MULTILINE)
#: Comments are looked for in so many bytes.
HEAD = 4096


def find_forward(up: str) -> str:
    """Return the usual forward axis of an upward one."""
    return FORWARD.get(up, "y")


def make_axes(up: str, forward: str = "") -> Floats:
    """Return the bed's x, y and z in a file's axes, (3, 3): its vertices times it are those of the file."""
    forward = forward or find_forward(up)
    for name, value in (("up", up), ("forward", forward)):
        if value not in AXES:
            raise ParameterError("Export", name, f"must be one of {', '.join(AXES)}", repr(value))
    ahead, above = (
        np.eye(3)[AXES.index(one) % 3] * (-1.0 if one[0] == "-" else 1.0) for one in (forward, up)
    )
    if forward[-1] == up[-1]:
        raise ParameterError("Export", "forward", f"must be another axis than up, {up}", forward)
    return np.stack([np.cross(ahead, above), ahead, above])


def find_axes(data: bytes) -> tuple[str, str]:
    """Return the upward and the forward axis that a comment of an OBJ file tells, such as ``# z up``."""
    found = COMMENT.search(data[:HEAD])
    up, forward = (b"", b"") if found is None else (found[1], found[2] or b"")
    return up.decode() or UP, forward.decode()


Indices = NDArray[np.int64]

UNREADABLE = "must be an OBJ file that can be read"
CUT = "must end with a whole line: the file is cut off"
#: Bytes that are worked on at a time.
BLOCK = 1 << 22
#: A number in a line has no more letters than this.
LONGEST_WORD = 64
#: Numbers of textures and normals at a corner.
BESIDES = re.compile(rb"/[^\s]*")
VERTEX, FACE = (b"v ", b"v\t"), (b"f ", b"f\t")


def read(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of a file's bytes; polygons are cut into fans."""
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    vertices, corners = array("d"), array("q")
    line = 1
    for block in _blocks(data):
        lines = [one.strip() for one in block.split(b"\n")]
        if not _taken_at_once(lines, vertices, corners):
            _taken(lines, line, name, vertices, corners)
        refuse_many_triangles(name, max(len(vertices), len(corners)) // 3)
        line += len(lines) - 1
    places, faces = np.array(vertices).reshape(-1, 3), np.array(corners, np.int64).reshape(-1, 3)
    if faces.size and (faces.min() < 0 or faces.max() >= len(places)):
        rule = "must have faces whose corners are among its vertices"
        raise make_refusal(rule, name, f"vertex {faces.max() + 1} of {len(places)}", "Is the file cut off?")
    _refuse_cut(data, name, places, faces)
    return places, faces


def _blocks(data: bytes) -> Iterator[bytes]:
    """Give the text in pieces that end with a line."""
    at = 0
    while at < len(data):
        end = data.find(b"\n", at + BLOCK) + 1 or len(data)
        # A file of the old Macintosh has other ends of lines.
        yield data[at:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        at = end


def _taken_at_once(lines: list[bytes], vertices: array[float], corners: array[int]) -> bool:
    """Take in lines that are all vertices of three numbers and triangles counted from the first vertex."""
    places = b" ".join(one for one in lines if one.startswith(VERTEX)).split()
    faces = b" ".join(one for one in lines if one.startswith(FACE))
    triangles = BESIDES.sub(b"", faces).split()
    try:
        if b"-" in faces or set(places[::4]) - {b"v"} or set(triangles[::4]) - {b"f"}:
            return False
        if len(places) % 4 or len(triangles) % 4:
            return False
        if max(map(len, [*places, *triangles]), default=0) > LONGEST_WORD:
            return False
        numbers = np.array(places).reshape(-1, 4)[:, 1:].astype(np.float64)
        indices = np.array(triangles).reshape(-1, 4)[:, 1:].astype(np.int64)
    except (ValueError, OverflowError):
        return False
    if sum(one.startswith(VERTEX) for one in lines) != len(numbers):
        return False
    if sum(one.startswith(FACE) for one in lines) != len(indices) or (indices < 1).any():
        return False
    vertices.frombytes(numbers.tobytes())
    corners.frombytes((indices - 1).tobytes())
    return True


def _taken(lines: list[bytes], first: int, name: str, vertices: array[float], corners: array[int]) -> None:
    """Read lines one by one, with an error that names the line."""
    for number, line in enumerate(lines, first):
        words = line.partition(b"#")[0].split()
        try:
            if words and words[0] == b"v":
                x, y, z = map(float, words[1:4])
                vertices.extend((x, y, z))
            elif words and words[0] == b"f":
                _add_fan(words[1:], len(vertices) // 3, corners)
        except (ValueError, OverflowError) as error:
            said = f"line {number}: {' '.join(str(error).split())[:80]}"
            raise make_refusal(UNREADABLE, name, said) from None


def _add_fan(words: list[bytes], count: int, corners: array[int]) -> None:
    """Add a face, given by its words, as triangles; `count` vertices stand before it."""
    face = []
    for word in words:
        place = int(word.partition(b"/")[0])
        if place == 0 or place < -count:
            raise ValueError(f"there is no vertex {place}")
        face.append(place - 1 if place > 0 else count + place)
    for one, other in pairwise(face[1:]):
        corners.extend((face[0], one, other))


def _refuse_cut(data: bytes, name: str, places: Floats, faces: Indices) -> None:
    """Refuse a file whose last line is not whole, or that ends in a line before all vertices have faces."""
    if not data or data.endswith((b"\n", b"\r")):
        return
    last = data[max(data.rfind(b"\n"), data.rfind(b"\r")) + 1 :].partition(b"#")[0].split()
    # All corners of a face are given alike, with or without texture and normal.
    ways = {tuple(map(bool, word.split(b"/"))) for word in last[1:]} if last[:1] == [b"f"] else set()
    if last in ([b"v"], [b"f"]) or (last[:1] == [b"f"] and (len(last) < 4 or len(ways) > 1)):
        raise make_refusal(CUT, name, f"{b' '.join(last)[:40].decode(errors='replace')!r}")
    unused = len(places) - np.unique(faces).size
    if unused and len(faces):
        raise make_refusal(
            CUT, name, f"no end of line, and {unused:,} of {len(places):,} vertices without a face"
        )
