"""PNG writer for small pictures, without Blender or matplotlib; whether a picture is whole."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the file of a picture.

    `pixels` (rows, columns, 3), red, green and blue in sRGB, the upper row first.
    """
    rows, columns, _ = pixels.shape
    plain = np.zeros((rows, 1 + 3 * columns), np.uint8)  # each row starts with its filter: none
    plain[:, 1:] = pixels.reshape(rows, 3 * columns)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(plain.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    """Return a part of the file: its length, kind, data and checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def is_whole_picture(data: bytes) -> bool:
    """Return whether a PNG file has its end; Blender does not always tell when a disk is full."""
    return data[-8:-4] == b"IEND"
