"""Files of numpy, whose heads are checked before they are unpacked, and small PNG pictures."""

import math
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array

#: Errors of a damaged zip.
BROKEN_ZIP = (zipfile.BadZipFile, zlib.error, struct.error, NotImplementedError, RuntimeError)
#: Errors of numpy's readers for a malformed head.
BROKEN = (
    *(ValueError, TypeError, KeyError, SyntaxError, tokenize.TokenError, Warning),
    *(RecursionError, MemoryError, OverflowError, EOFError),
)


def read_count(value: object) -> int:
    """Return a whole number from 0 on that floating-point numbers represent exactly, or raise ValueError."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 2**53:
        raise ValueError(f"{str(value)[:20]} is not a count")
    return value


class Head(NamedTuple):
    """Header of an array."""

    shape: tuple[int, ...]
    kind: np.dtype[Any]

    @property
    def size(self) -> int:
        """Bytes of the array."""
        return math.prod(self.shape) * self.kind.itemsize


def read_heads(archive: zipfile.ZipFile, names: Sequence[str]) -> dict[str, Head]:
    """Return the heads of arrays of a file .npz; KeyError if one is missing, ValueError if one is wrong."""
    heads = {}
    for name in names:
        entry = archive.getinfo(f"{name}.npy")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} must be stored or deflated")
        with archive.open(entry) as file:
            head = _head(file, name)
            actual = entry.file_size - file.tell()
        if head.size != actual:
            raise ValueError(
                f"{name} must have {head.size:,} bytes, as its header says (got {actual:,})"
            )
        heads[name] = head
    return heads


def _head(file: IO[bytes], name: str) -> Head:
    """Read the head of an array; refuse one that numpy would warn of."""
    try:
        version = np.lib.format.read_magic(file)  # type: ignore[no-untyped-call]
        readers: dict[Any, Any] = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        with warnings.catch_warnings(action="error"):
            shape, _, kind = readers[version](file)
        if kind.hasobject or not all(isinstance(side, int) and side >= 0 for side in shape):
            raise ValueError("no numbers")
        return Head(tuple(shape), kind)
    except BROKEN:
        raise ValueError(f"{name} has no header of an array of numbers") from None


def read_array(archive: zipfile.ZipFile, name: str) -> Array:
    """Read an array whose head has been checked."""
    with archive.open(f"{name}.npy") as file:
        read: Array = np.lib.format.read_array(file, allow_pickle=False)  # type: ignore[no-untyped-call]
        return read


def map_array(path: Path) -> Array:
    """Return the memory-mapped array of a file .npy; OSError, or ValueError if it has no numbers."""
    try:
        with warnings.catch_warnings(action="error"):
            read = np.load(path, allow_pickle=False, mmap_mode="r")
    except BROKEN:
        raise ValueError("no array of numbers") from None
    if not isinstance(read, np.ndarray):
        read.close()
        raise ValueError("no array of numbers")
    return read


def inflate(data: bytes, most: int) -> bytes:
    """Return what zlib has packed, cut off behind `most` bytes and one; ValueError if it is damaged."""
    packed = zlib.decompressobj()
    try:
        unpacked = packed.decompress(data, most + 1)
    except zlib.error as error:
        raise ValueError(str(error)) from None
    if not packed.eof and len(unpacked) <= most:
        raise ValueError("packed data that end too early")
    return unpacked


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the file of a picture (rows, columns, 3), sRGB, the upper row first."""
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
    """Return whether a PNG file has its end: Blender does not always report a full disk."""
    return data[-8:-4] == b"IEND"
