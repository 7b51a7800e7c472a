"""Height map: a picture or grid of values as a shape, bilinear over its pixels."""

import importlib
import re
import struct
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..model.layout import RELATIVE_TOLERANCE, Grid
from .request import Placement, Tops

#: Bytes of a file in which its size is looked for; a JPEG's may stand behind a small picture of it.
HEAD = 1 << 20
#: Segments of a JPEG that tell its size.
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def read_size(path: Path) -> tuple[int, int] | None:
    """Return width and height of a picture in pixels by its header, None where it has none that is known."""
    with path.open("rb") as file:
        head = file.read(HEAD)
        try:
            if head[:4] in (b"II*\0", b"MM\0*"):
                order = "<" if head[:1] == b"I" else ">"
                file.seek(struct.unpack_from(f"{order}I", head, 4)[0])
                return _tiff(file.read(HEAD), order)
            return _size(head)
        except (struct.error, IndexError, KeyError, ValueError):
            return None


def _size(head: bytes) -> tuple[int, int] | None:
    """Return the size in the head of a PNG, BMP, JPEG, EXR or HDR."""
    if head[:8] == b"\x89PNG\r\n\x1a\n":
        return struct.unpack_from(">II", head, 16)
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
        line = re.search(rb"\n[+-]([XY]) (\d{1,18}) [+-][XY] (\d{1,18})\n", head)
        if line:
            first, second = int(line[2]), int(line[3])
            return (second, first) if line[1] == b"Y" else (first, second)
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
    return size[256], size[257]


Pixels = NDArray[np.generic]

#: Pictures by extension.
PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".exr", ".hdr")
#: Pillow's names of those it reads here: by others a file with such an ending could have programs started.
FORMATS = ("PNG", "TIFF", "JPEG", "BMP", "DIB")
#: Those that Pillow cannot read.
BLENDER_ONLY = (".exr", ".hdr")
#: Pillow's names for pictures of one channel; all others are turned into brightness.
GRAY = ("1", "L", "I", "I;16", "I;16B", "I;16L", "F")
#: Most pixels of a picture: 16 000 x 8 000. Some memory is needed for each, see docs/shapes.md.
MOST = 128_000_000
#: Readers of pictures in place of Pillow, the last one first; each has the signature of `read_pixels`.
READERS: list[Callable[[Path], Pixels]] = []


def read_pixels(path: Path) -> Pixels:
    """Return the brightness of a picture's pixels, (rows, columns), the lowest row first."""
    with suppress(OSError):  # which the reader itself reports
        if size := read_size(path):
            refuse_too_many(path, *size)
    if READERS:
        return READERS[-1](path)
    if path.suffix.lower() in BLENDER_ONLY:
        rule = "must be a PNG, TIFF or JPEG outside Blender"
        raise ParameterError("shape", "file", rule, str(path), "Blender itself reads EXR and HDR.")
    try:
        image: Any = importlib.import_module("PIL.Image")
    except ImportError:
        rule = "must be a mesh or an array where Pillow is not installed"
        hint = "Run 'pip install digiclay[images]'."
        raise ParameterError("shape", "file", rule, str(path), hint) from None
    image.init()  # formats that are named are not looked for
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", image.DecompressionBombWarning)
        try:
            with image.open(path, formats=FORMATS) as opened:
                refuse_too_many(path, *opened.size)
                gray = opened if opened.mode in GRAY else opened.convert("L")
                return np.flipud(np.asarray(gray))
        except image.DecompressionBombError:
            raise _make_size_error(path, "too many pixels to open") from None
        except OSError as error:
            reason = error.strerror or "not a picture, or cut off"
        except (ValueError, SyntaxError, EOFError) as error:
            reason = " ".join(str(error).split())[:100]
    raise ParameterError("shape", "file", "must be a picture that can be read", f"{path}: {reason}")


def refuse_too_many(path: Path, width: int, height: int) -> None:
    """Refuse a picture of too many pixels."""
    if width * height > MOST:
        raise _make_size_error(path, f"{width} x {height}")


def _make_size_error(path: Path, size: str) -> ParameterError:
    """Return the error of a picture too large to be read."""
    rule = f"must have at most {MOST // 1_000_000} million pixels"
    return ParameterError("shape", "file", rule, f"{path}: {size}", "Make it smaller first.")


#: Values a map keeps; more, and its pixels are averaged in squares when it is read.
KEPT = 4_000_000
#: Pixels averaged at a time, so that memory is bounded by the picture itself.
CHUNK = 4_000_000


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights over a rectangle of pixels; a pixel is one unit wide, with its value in the middle."""

    name: str
    values: Floats
    """(r, c): The first row lies at the lowest y. Each is the mean of up to `block` x `block` pixels."""
    pixels: tuple[int, int]
    """Rows and columns of pixels."""
    block: int = 1
    value_length: float | None = None
    """Meters in the unit of the values; None where they are no lengths."""

    length = None
    underside = None

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The rectangle of all pixels."""
        return 0.0, 0.0, float(self.pixels[1]), float(self.pixels[0])

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return the heights at the pins: bilinear, of the means over a pin's own square of pixels."""
        across, along = (grid.x - at.x) / at.factor_x, (grid.y - at.y) / at.factor_y
        covered = _within(across, self.pixels[1]) & _within(along, self.pixels[0])
        under_a_pin = min(grid.layout.pitch / at.factor_x, grid.layout.row_spacing / at.factor_y)
        block = max(1, int(min(under_a_pin / self.block, max(self.values.shape)) + RELATIVE_TOLERANCE))
        values = average_blocks(self.values, block)
        rows = _places(along, self.pixels[0], block * self.block, values.shape[0])
        columns = _places(across, self.pixels[1], block * self.block, values.shape[1])
        value = np.where(covered, _bilinear(values, rows, columns), 0.0)
        return Tops(value, covered, np.zeros(grid.count, np.bool_))


def make_height_map(name: str, values: NDArray[np.generic], value_length: float | None = None) -> HeightMap:
    """Make a map of numbers (r, c), the first row at the lowest y; `value_length`: meters in their unit."""
    shown = " x ".join(map(str, values.shape)) or "a single number"
    if values.ndim != 2 or min(values.shape) < 2:
        raise ParameterError("shape", "file", "must hold at least 2 x 2 heights", f"{name}: {shown}")
    if values.size > MOST:
        rule = f"must hold at most {MOST // 1_000_000} million heights"
        raise ParameterError("shape", "file", rule, f"{name}: {shown}")
    if values.dtype.kind not in "biuf":
        raise ParameterError("shape", "file", "must hold numbers", f"{name}: {values.dtype}")
    block = int(np.ceil(np.sqrt(values.size / KEPT)))
    with np.errstate(over="ignore", invalid="ignore"):
        kept = average_blocks(values, block)
    bad = np.argwhere(~np.isfinite(kept))
    if bad.size:
        row, column = (bad[0] * block).tolist()
        content = f"{name}: {kept[tuple(bad[0])]} at {row}, {column}"
        raise ParameterError("shape", "file", "must hold finite numbers only", content)
    return HeightMap(name, kept, (values.shape[0], values.shape[1]), block, value_length)


def average_blocks(values: NDArray[np.generic], block: int) -> Floats:
    """Return the means over squares of `block` x `block` values (r, c); those at the end may be smaller."""
    if block == 1:
        return np.asarray(values, np.float64)
    rows, columns = values.shape
    lines = max(1, CHUNK // (columns * block)) * block
    left = np.arange(0, columns, block)
    width = np.minimum(left + block, columns) - left
    parts = []
    for first in range(0, rows, lines):
        part = np.asarray(values[first : first + lines], np.float64)
        top = np.arange(0, len(part), block)
        tall = np.minimum(top + block, len(part)) - top
        sums = np.add.reduceat(np.add.reduceat(part, left, axis=1), top, axis=0)
        parts.append(sums / (tall[:, None] * width))
    return np.concatenate(parts)


def _within(places: Floats, pixels: int) -> NDArray[np.bool_]:
    """Return the positions that lie on the pixels, those on the edge included."""
    slack = RELATIVE_TOLERANCE * pixels
    return np.asarray((places >= -slack) & (places <= pixels + slack))


def _places(places: Floats, pixels: int, block: int, count: int) -> Floats:
    """Return places in pixels as places between `count` means, whose middles have the numbers 0, 1, ..."""
    starts = np.arange(count) * block
    middles = (starts + np.minimum(starts + block, pixels)) / 2
    return np.interp(places, middles, np.arange(count, dtype=np.float64))


def _bilinear(values: Floats, rows: Floats, columns: Floats) -> Floats:
    """Return values between the numbers of a table, shape (n,)."""
    row, column = rows.astype(np.intp), columns.astype(np.intp)
    below, right = np.minimum(row + 1, values.shape[0] - 1), np.minimum(column + 1, values.shape[1] - 1)
    up, over = rows - row, columns - column
    first = values[row, column] * (1.0 - over) + values[row, right] * over
    second = values[below, column] * (1.0 - over) + values[below, right] * over
    return np.asarray(first * (1.0 - up) + second * up)
