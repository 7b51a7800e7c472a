"""Size limits of input meshes, checks of file heads, and meshes placed several times."""

import re
from collections.abc import Iterable

import numpy as np

from ..base.arrays import Floats, Indices
from ..base.errors import ParameterError

#: Most triangles of a mesh: as many as a bed may have cells. They take some 5 GB while they are laid onto it.
MOST_TRIANGLES = 20_000_000
#: Most bytes of a mesh's file, or of what a compressed one unpacks to.
MOST_BYTES = 2_000_000_000
#: Largest number of a mesh or a map: products of some of them stay finite.
LARGEST = 1e60
SMALLER = "Make the mesh coarser first."
CORNERS = "must have faces whose corners are among its vertices"


def make_refusal(rule: str, name: str, content: str, hint: str = "") -> ParameterError:
    """Return the error of an unusable mesh: the rule from *must* on, name and content of the file, remedy."""
    return ParameterError("shape", "file", rule, f"{name}: {content}", hint)


def refuse_many_triangles(name: str, count: int) -> None:
    """Refuse a mesh of more triangles than can be worked on, before they are made."""
    if count > MOST_TRIANGLES:
        rule = f"must have at most {MOST_TRIANGLES // 1_000_000} million triangles"
        # Copies of copies can come to a number of any length.
        shown = f"{count:,}" if count < 10**15 else "more than 10^15"
        raise make_refusal(rule, name, shown, SMALLER)


def refuse_size(name: str, size: int, what: str = "") -> None:
    """Refuse a file, or its unpacked part `what`, of more bytes than can be read."""
    if size > MOST_BYTES:
        rule = f"must have at most {MOST_BYTES / 1e9:g} GB{' unpacked' if what else ''}"
        raise make_refusal(rule, name, f"{what} {size / 1e9:.3g} GB".strip(), SMALLER)


WHOLE = "must be whole: the file is cut off"
PLY = "must be a PLY file that can be read"
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
    """Refuse an STL with fewer triangles than its header states, or with an incomplete one."""
    if stl_is_text(data):
        lower = data.lower()
        begun, ended = lower.count(b"facet normal"), lower.count(b"endfacet")
        if begun != ended or not lower[lower.rstrip().rfind(b"\n") + 1 :].strip().startswith(b"endsolid"):
            content = f"{begun:,} facets begin, {ended:,} end, and the last line no endsolid"
            raise make_refusal(WHOLE, name, content)
        refuse_many_triangles(name, ended)
        return
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) < 84 + 50 * count:
        there = max(0, (len(data) - 84) // 50)
        raise make_refusal(WHOLE, name, f"{there:,} of its {count:,} triangles")
    refuse_many_triangles(name, count)


def check_ply(data: bytes, name: str) -> None:
    """Refuse a PLY whose elements need more bytes than there are."""
    end = re.search(rb"^end_header[ \t]*\r?$\n?", data[:LONGEST_HEAD], re.MULTILINE)
    if not data.startswith(b"ply") or end is None:
        raise make_refusal(PLY, name, "no head, or no end of it")
    lines = data[: end.start()].decode("ascii", errors="replace").splitlines()
    text = any(line.split()[:2] == ["format", "ascii"] for line in lines)
    elements: list[tuple[str, int, int]] = []  # kind, count, bytes of one
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ["element"]:
                elements.append((words[1], int(words[2]), 0))
            elif words[:1] == ["property"]:
                kind, count, size = elements[-1]
                # A list has at least its length; a number of a text and what separates it are two letters.
                size += 2 if text else SIZES[words[2] if words[1] == "list" else words[1]]
                elements[-1] = (kind, count, size)
        except (ValueError, IndexError, KeyError):
            raise make_refusal(PLY, name, f"{line[:60]!r} in its head") from None
    needed, rest = 0, len(data) - end.end() + 1  # the last line of a text may have no end
    for kind, count, size in elements:
        if count < 0 or (count and not size):
            raise make_refusal(PLY, name, f"{count} {kind} without properties")
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
    """Refuse an OFF that has fewer lines than vertices and faces."""
    lines = [line for line in (part.partition(b"#")[0].strip() for part in data.splitlines()) if line]
    head = b" ".join(lines[:2]).split()
    head = head[1:] if head and head[0].upper() in (b"OFF", b"COFF") else head
    try:
        vertices, faces = int(head[0]), int(head[1])
    except (IndexError, ValueError):
        rule = "must be an OFF file that can be read"
        raise make_refusal(rule, name, "no counts of vertices and faces") from None
    refuse_many_triangles(name, max(faces, vertices // 3))
    there = len(lines) - (2 if len(lines[0].split()) == 1 else 1)
    if there < vertices + faces:
        raise make_refusal(WHOLE, name, f"{there:,} of its {vertices + faces:,} lines")


#: A placement (4, 3): (x, y, z, 1) times it gives the place. This one leaves all where it is.
IDENTITY: Floats = np.vstack([np.eye(3), np.zeros(3)])


def nest_placement(inner: Floats, outer: Floats) -> Floats:
    """Return the placement, (4, 3), of what is placed in something that is placed itself."""
    placement: Floats = inner @ outer[:3]
    placement[3] += outer[3]
    return placement


def join_meshes(meshes: Iterable[tuple[Floats, Indices, Floats]], name: str) -> tuple[Floats, Indices]:
    """Return vertices (v, 3) and triangles (f, 3) of meshes (vertices, triangles, placement) as one mesh."""
    places, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for vertices, faces, placement in meshes:
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise make_refusal(CORNERS, name, f"corner {faces.max()} of {len(vertices)}")
        mirrored = np.linalg.det(placement[:3]) < 0.0  # turned, so that outside stays outside
        places.append(vertices @ placement[:3] + placement[3])
        triangles.append((faces[:, ::-1] if mirrored else faces) + first)
        first += len(vertices)
    return np.concatenate(places), np.concatenate(triangles)
