"""Wavefront OBJ files: their axes, and a reader of vertices and faces; materials are not opened."""

from __future__ import annotations

import re
from array import array

import numpy as np

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError
from .mesh_limits import make_refusal, refuse_many_triangles
from .polygons import cut

AXES = ("x", "y", "z", "-x", "-y", "-z")
#: Upward axis of Blender's exporter and importer; its forward axis is -z.
UP = "y"
#: Forward axes, the bed's y, by upward axis, unless y; x stays x if possible.
FORWARD = {"y": "-z", "-y": "z", "-z": "-y"}
COMMENT = re.compile(rb"^#[^\n]*?(?<![\w-])(-?[xyz]) up\b(?:, (-?[xyz]) forward)?", re.MULTILINE)
#: Bytes that are searched for comments.
HEAD = 4096


def find_forward(up: str) -> str:
    """Return the usual forward axis of an upward one."""
    return FORWARD.get(up, "y")


def make_axes(up: str, forward: str = "") -> Floats:
    """Return the bed's x, y and z in a file's axes, (3, 3): vertices @ axes are those of the file."""
    forward = forward or find_forward(up)
    for name, value in (("up", up), ("forward", forward)):
        if value not in AXES:
            raise ParameterError("Export", name, f"must be one of {', '.join(AXES)}", repr(value))
    ahead, above = np.concatenate([np.eye(3), -np.eye(3)])[[AXES.index(forward), AXES.index(up)]]
    if forward[-1] == up[-1]:
        raise ParameterError("Export", "forward", f"must be another axis than up, {up}", forward)
    return np.stack([np.cross(ahead, above), ahead, above])


def turn(vertices: Floats, axes: Floats) -> Floats:
    """Return vertices (..., 3) @ axes (3, 3), which are turned by right angles: exact, infinite or not."""
    return vertices[..., np.abs(axes).argmax(axis=0)] * axes.sum(axis=0)


def turn_up(vertices: Floats, up: str) -> Floats:
    """Return the vertices (v, 3) of a file with z upwards, as they are seen with its usual forward axis."""
    return turn(vertices, make_axes(up).T)


def find_axes(data: bytes) -> tuple[str, str]:
    """Return the upward and the forward axis of an OBJ file by a comment such as ``# z up``."""
    comment = COMMENT.search(data[:HEAD])
    return (comment[1].decode(), (comment[2] or b"").decode()) if comment else (UP, "")


CUT = "must end with a whole line: the file is cut off"
#: Bytes that are processed at a time.
BLOCK = 1 << 22


def read(data: bytes, name: str) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of a file's bytes."""
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    vertices, corners, sizes = array("d"), array("q"), array("q")
    ended = not data or data.endswith((b"\n", b"\r"))
    if not ended:
        _refuse_cut_line(data, name)
    first, at = 1, 0
    while at < len(data):
        end = data.find(b"\n", at + BLOCK) + 1 or len(data)
        # Files of the old Macintosh end lines with a carriage return.
        block = data[at:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        lines = block.split(b"\n")
        _add_lines(lines, first, name, vertices, corners, sizes)
        refuse_many_triangles(name, max(len(vertices), len(corners)) // 3)
        first, at = first + len(lines) - 1, end
    points = np.array(vertices).reshape(-1, 3)
    faces = cut(points, np.array(corners, np.int64), np.array(sizes, np.int64), name)
    if not ended and len(faces) and (unused := len(points) - np.unique(faces).size):
        content = f"no end of line, and {unused:,} of {len(points):,} vertices without a face"
        raise make_refusal(CUT, name, content)
    return points, faces


def _add_lines(
    lines: list[bytes],
    first: int,
    name: str,
    vertices: array[float],
    corners: array[int],
    sizes: array[int],
) -> None:
    """Add lines one by one, with an error that names the line."""
    for number, line in enumerate(lines, first):
        kind, *words = line.partition(b"#")[0].split() or [b""]
        try:
            if kind == b"v":
                x, y, z = map(float, words[:3])
                vertices.extend((x, y, z))
            elif kind == b"f":
                count = len(vertices) // 3
                corners.extend([_find_vertex(word, count) for word in words])
                sizes.append(len(words))
        except (ValueError, OverflowError) as error:
            content = f"line {number}: {error}"
            raise make_refusal("must be an OBJ file that can be read", name, content) from None


def _find_vertex(word: bytes, count: int) -> int:
    """Return the vertex that a word of a face names, from 0 on; `count` vertices precede the face."""
    number = int(word.partition(b"/")[0])
    if number == 0 or number < -count:
        raise ValueError(f"there is no vertex {number}")
    return number - 1 if number > 0 else count + number


def _refuse_cut_line(data: bytes, name: str) -> None:
    """Refuse a file that ends within its last line, which has no end."""
    last = data[max(data.rfind(b"\n"), data.rfind(b"\r")) + 1 :].partition(b"#")[0].split()
    # All corners of a face have the same form, with or without texture and normal.
    forms = (
        {tuple(map(bool, word.split(b"/"))) for word in last[1:]} if last[:1] == [b"f"] else set()
    )
    if last == [b"v"] or (last[:1] == [b"f"] and (len(last) < 4 or len(forms) > 1)):
        raise make_refusal(CUT, name, repr(b" ".join(last).decode(errors="replace")))
