"""Checks of STL, PLY and OFF files against their headers, before reading."""

from __future__ import annotations

import re

from .mesh_limits import make_refusal, refuse_many_triangles

WHOLE = "must be whole: the file is cut off"
#: Bytes of a number of a PLY file.
SIZES = {
    "char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2,
    "int": 4, "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8,
}  # fmt: skip
#: A head is no longer than this.
LONGEST_HEAD = 1 << 16


def stl_is_text(data: bytes) -> bool:
    """Return whether an STL is text; the header of a binary one may begin with the same word."""
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return False
    head = data[:LONGEST_HEAD].lstrip().lower()
    return head.startswith(b"solid") and (b"facet" in head or b"endsolid" in head)


def check_stl(data: bytes, name: str) -> None:
    """Refuse an STL with fewer triangles than its header states, or with an incomplete one.

    `data`: the file; `name`: what the message calls it.
    """
    if stl_is_text(data):
        lower = data.lower()
        begun, ended = lower.count(b"facet normal"), lower.count(b"endfacet")
        if begun != ended or not lower[lower.rstrip().rfind(b"\n") + 1 :].strip().startswith(b"endsolid"):
            raise make_refusal(
                WHOLE, name, f"{begun:,} facets begin, {ended:,} end, and the last line no endsolid"
            )
        refuse_many_triangles(name, ended)
        return
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) < 84 + 50 * count:
        there = max(0, (len(data) - 84) // 50)
        raise make_refusal(WHOLE, name, f"{there:,} of its {count:,} triangles")
    refuse_many_triangles(name, count)


def check_ply(data: bytes, name: str) -> None:
    """Refuse a PLY whose elements need more bytes than there are.

    `data`: the file; `name`: what the message calls it.
    """
    end = re.search(rb"^end_header[ \t]*\r?$\n?", data[:LONGEST_HEAD], re.MULTILINE)
    if not data.startswith(b"ply") or end is None:
        raise make_refusal("must be a PLY file that can be read", name, "no head, or no end of it")
    lines = data[: end.start()].decode("ascii", errors="replace").splitlines()
    text = any(line.split()[:2] == ["format", "ascii"] for line in lines)
    elements: list[tuple[str, int, int]] = []
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ["element"]:
                elements.append((words[1], int(words[2]), 0))
            elif words[:1] == ["property"]:
                kind, count, size = elements[-1]
                # A list has at least its length; a number of a text and what separates it are two letters.
                own = 2 if text else SIZES[words[2] if words[1] == "list" else words[1]]
                elements[-1] = (kind, count, size + own)
        except (ValueError, IndexError, KeyError):
            raise make_refusal(
                "must be a PLY file that can be read", name, f"{line[:60]!r} in its head"
            ) from None
    needed, rest = 0, len(data) - end.end() + 1  # the last line of a text may have no end
    for kind, count, size in elements:
        if count < 0 or (count and not size):
            raise make_refusal(
                "must be a PLY file that can be read", name, f"{count} {kind} without properties"
            )
        needed += count * size
        if kind == "face":
            refuse_many_triangles(name, count)
    if needed > rest:
        raise make_refusal(WHOLE, name, f"{rest:,} bytes where its elements take at least {needed:,}")
    if text:
        wanted, there = sum(count for _, count, _ in elements), len(data[end.end() :].split(b"\n"))
        if there < wanted:
            raise make_refusal(WHOLE, name, f"{there:,} of its {wanted:,} lines")


def check_off(data: bytes, name: str) -> None:
    """Refuse an OFF that has fewer lines than vertices and faces.

    `data`: the file; `name`: what the message calls it.
    """
    lines = [line for line in (part.partition(b"#")[0].strip() for part in data.splitlines()) if line]
    head = b" ".join(lines[:2]).split()
    head = head[1:] if head and head[0].upper() in (b"OFF", b"COFF") else head
    try:
        vertices, faces = int(head[0]), int(head[1])
    except (IndexError, ValueError):
        raise make_refusal(
            "must be an OFF file that can be read", name, "no counts of vertices and faces"
        ) from None
    refuse_many_triangles(name, max(faces, vertices // 3))
    there = len(lines) - (2 if len(lines[0].split()) == 1 else 1)
    if there < vertices + faces:
        raise make_refusal(WHOLE, name, f"{there:,} of its {vertices + faces:,} lines")
