"""Size of a picture, read from its header without unpacking."""

from __future__ import annotations

import re
import struct
from pathlib import Path

#: Bytes of a file in which its size is looked for; a JPEG's may stand behind a small picture of it.
HEAD = 1 << 20
#: Segments of a JPEG that tell its size.
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def read_size(path: Path) -> tuple[int, int] | None:
    """Return width and height of a picture in pixels, None if they are not in its header.

    PNG, JPEG, BMP, TIFF, EXR and HDR are known, by what they begin with.

    Raises OSError when the file cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
        try:
            if head[:4] in (b"II*\0", b"MM\0*"):
                order = "<" if head[:1] == b"I" else ">"
                file.seek(struct.unpack_from(f"{order}I", head, 4)[0])
                return _tiff(file.read(HEAD), order)
            return _size(head)
        except (struct.error, IndexError, ValueError):
            return None


def _size(head: bytes) -> tuple[int, int] | None:
    """Return the size that stands in a head."""
    if head[:8] == b"\x89PNG\r\n\x1a\n":
        width, height = struct.unpack_from(">II", head, 16)
        return width, height
    if head[:2] == b"BM":
        width, height = struct.unpack_from("<ii", head, 18)
        return abs(width), abs(height)
    if head[:2] == b"\xff\xd8":
        return _jpeg(head)
    if head[:4] == b"\x76\x2f\x31\x01":
        at = head.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
        left, low, right, high = struct.unpack_from("<4i", head, at)
        return max(0, right - left + 1), max(0, high - low + 1)
    if head[:2] == b"#?":
        found = re.search(rb"\n[+-]([XY]) (\d{1,18}) [+-][XY] (\d{1,18})\n", head)
        if found:
            first, second = int(found[2]), int(found[3])
            return (second, first) if found[1] == b"Y" else (first, second)
    return None


def _jpeg(head: bytes) -> tuple[int, int]:
    """Return the size of a JPEG, from segment to segment."""
    at = 2
    while True:
        while head[at] == 0xFF:
            at += 1
        kind, (length,) = head[at], struct.unpack_from(">H", head, at + 1)
        if kind in FRAMES:
            height, width = struct.unpack_from(">HH", head, at + 4)
            return width, height
        at += 1 + length


def _tiff(entries: bytes, order: str) -> tuple[int, int]:
    """Return the size of a TIFF from its list of entries: 256 is the width, 257 the height."""
    (count,) = struct.unpack_from(f"{order}H", entries)
    size = {}
    for index in range(count):
        tag, kind = struct.unpack_from(f"{order}HH", entries, 2 + 12 * index)
        (size[tag],) = struct.unpack_from(order + ("H" if kind == 3 else "I"), entries, 10 + 12 * index)
    if 256 not in size or 257 not in size:
        raise ValueError("no size")
    return size[256], size[257]
