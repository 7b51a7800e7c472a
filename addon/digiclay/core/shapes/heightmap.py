"""Height map: a picture or grid of values as a shape, bilinear over its pixels."""

import importlib
import io
import re
import struct
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import TIE, Array, Floats
from ..base.errors import ParameterError
from ..mesh_io.mesh_limits import LARGEST, make_refusal
from ..model.layout import RELATIVE_TOLERANCE, Grid
from .request import Placement, Tops

#: Bytes of a file that are searched for its size; in a JPEG it may follow a thumbnail.
HEAD = 1 << 20
#: Segments of a JPEG that contain its size.
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
#: Numbers of tags, of a TIFF file or of the EXIF data in another one.
WIDTH, HEIGHT, BITS, PHOTOMETRIC, ORIENTATION, CHANNELS, PLANES = 256, 257, 258, 262, 274, 277, 284
ALPHA, FORMAT, NO_DATA = 338, 339, 42113
#: Bytes of an item, by the kind of a tag: texts, and whole numbers of 16, 32 and 64 bits.
ITEMS = {2: 1, 3: 2, 4: 4, 16: 8}
#: Most tags of a picture that are read, those of a TIFF that is not a BigTIFF.
MOST_TAGS = 0xFFFF
#: First bytes of a TIFF, of which BigTIFF has 43; its order of bytes; its offsets, count of tags,
#: and tag.
TIFFS = {
    b"II\x2a\0": ("<", "I", "H", "HHI4s"),
    b"MM\0\x2a": (">", "I", "H", "HHI4s"),
    b"II\x2b\0": ("<", "Q", "Q", "HHQ8s"),
    b"MM\0\x2b": (">", "Q", "Q", "HHQ8s"),
}
#: Errors that a malformed head raises.
UNKNOWN = (struct.error, IndexError, KeyError, ValueError)


class Head(NamedTuple):
    """Size and tags of a picture's file."""

    size: tuple[int, int] | None
    """Width and height, pixels; None if unknown."""
    tags: dict[int, Any]
    """Texts and whole numbers by the numbers of their tags, of a list its first item; of EXIF data only the
    orientation."""


def read_head(path: Path) -> Head:
    """Return the size and the tags of a picture's file."""
    size, tags = None, {}
    with path.open("rb") as file:
        head = file.read(HEAD)
        with suppress(*UNKNOWN):
            start = _find_tags(file, head)
            tags = _read_tags(file, start)
            tags = {ORIENTATION: tags[ORIENTATION]} if start else tags
            size = tags[WIDTH], tags[HEIGHT]
    with suppress(*UNKNOWN):
        size = size or _size(head)
    return Head(size, tags)


def _find_tags(file: BinaryIO, head: bytes) -> int:
    """Return the byte at which the tags of a TIFF, or the EXIF data of a JPEG or a PNG, begin."""
    if head[:2] in (b"II", b"MM"):
        return 0
    if head[:2] == b"\xff\xd8":
        return head.index(b"Exif\0\0") + 6
    length, kind, at = 0, head[1:4], -4
    while kind != b"eXIf" and (at >= 0 or kind == b"PNG"):
        at += 12 + length
        file.seek(at)
        length, kind = struct.unpack(">I4s", file.read(8))
    return at + 8


def _read_tags(file: BinaryIO, start: int) -> dict[int, Any]:
    """Return the first list of tags in TIFF data that begin at a byte."""

    def read(kind: str, count: int = 1) -> bytes:
        return file.read(struct.calcsize(order + kind) * count)

    file.seek(start)
    order, offset, number, entry = TIFFS[file.read(4)]
    file.seek(start + struct.calcsize(offset))
    file.seek(start + struct.unpack(order + offset, read(offset))[0])
    (count,) = struct.unpack(order + number, read(number))
    tags: dict[int, Any] = {}
    entries = read(entry, min(count, MOST_TAGS))
    for tag, kind, items, content in struct.iter_unpack(order + entry, entries):
        if ITEMS.get(kind, 0) * items > len(content):
            file.seek(start + struct.unpack(order + offset, content)[0])
            content = file.read(min(items, 99))
        if kind == 2:
            tags[tag] = content[:items].rstrip(b"\0").decode("latin-1")
        elif kind in ITEMS:
            tags[tag] = int.from_bytes(content[: ITEMS[kind]], "little" if order == "<" else "big")
    return tags


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


Pixels = Array

#: Pictures by extension.
PICTURES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".exr", ".hdr")
#: The formats that Pillow may read here, by its names: others can start programs.
FORMATS = ("PNG", "TIFF", "JPEG", "BMP", "DIB", "PPM")
#: Those that Pillow cannot read.
BLENDER_ONLY = (".exr", ".hdr")
#: Pillow's modes of one channel, and those with colors or alpha that need no conversion.
GRAY, COLORED = ("1", "L", "I", "I;16", "I;16B", "I;16L", "F"), ("LA", "RGB", "RGBA")
#: Modes in which a single color can be clear; what a gray of a few bits, in which the file tells it, is
#: multiplied by.
KEYED, KEYED_BITS = ("1", "L", "I;16", "RGB"), {"L;2": 85, "L;4": 17}
#: Brightness of red, green and blue by the television standard BT.601.
BRIGHTNESS = np.array([0.299, 0.587, 0.114], np.float32)
#: Most pixels of a picture: 16 000 x 8 000. docs/shapes.md has the memory that each needs.
MOST = 128_000_000
#: Readers of pictures in place of Pillow; the last one is used. They return the channels of the
#: pixels as in the file, (rows, columns, channels), the lowest row first.
READERS: list[Callable[[Path], Pixels]] = []


def read_pixels(path: Path) -> Pixels:
    """Return the brightness of an upright picture's pixels, (rows, columns), the lowest row first.

    Those without data are masked; what is transparent is black.
    """
    head = Head(None, {})
    with suppress(OSError):  # which the reader itself reports
        head = read_head(path)
    if head.size:
        refuse_too_many(path, *head.size)
    if READERS:
        levels = READERS[-1](path)
        multiplied = head.tags.get(ALPHA) == 1 or path.suffix.lower() == ".exr"
        pixels = _find_brightness(levels[..., :3] if multiplied else levels)
    else:
        pixels = _find_brightness(_read_by_pillow(path, head.tags))[::-1]
    try:
        absent = float(head.tags[NO_DATA])
    except (KeyError, ValueError):
        pass  # all pixels have data
    else:
        if READERS:  # Blender gives whole numbers as shares of the largest one
            bits = head.tags.get(BITS, 1)
            largest = {1: 2.0**bits - 1, 2: 2.0 ** (bits - 1) - 1}  # unsigned and signed
            absent /= largest.get(head.tags.get(FORMAT, 1), 1.0)
            if pixels.shape[::-1] != head.size:
                rule = "must be small enough for Blender to read it unscaled, as it has pixels without data"
                raise make_refusal(rule, str(path), "{} x {}".format(*head.size or ()))
        pixels = _mask(pixels, absent)
    if WIDTH in head.tags and not READERS:
        return pixels  # Pillow itself turns a TIFF
    return _turn_upright(pixels[::-1], head.tags.get(ORIENTATION, 1))[::-1]


def _mask(values: Pixels, absent: float) -> Pixels:
    """Return values, those equal to the number for absent data masked."""
    # Writers round that number to the 24 bits of a float32, or to a few digits.
    bare = np.isclose(values, absent, rtol=1e-6, atol=0.0, equal_nan=True)
    masked: Pixels = np.ma.array(values, mask=bare)  # type: ignore[no-untyped-call]
    return masked


def _turn_upright(pixels: Pixels, orientation: int) -> Pixels:
    """Return pixels, the upper row first, turned by the EXIF orientation of their file."""
    pixels = pixels.T if orientation in (5, 6, 7, 8) else pixels
    pixels = pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels
    return pixels[::-1] if orientation in (3, 4, 7, 8) else pixels


def _read_by_pillow(path: Path, tags: Mapping[int, Any]) -> Pixels:
    """Return the channels of a picture, (rows, columns[, channels]), the upper row first."""
    if path.suffix.lower() in BLENDER_ONLY:
        rule = "must be a PNG, TIFF or JPEG outside Blender"
        raise ParameterError("shape", "file", rule, str(path), "Blender itself reads EXR and HDR.")
    try:
        image: Any = importlib.import_module("PIL.Image")
        tiff: Any = importlib.import_module("PIL.TiffImagePlugin")
    except ImportError:
        rule = "must be a mesh or an array where Pillow is not installed"
        hint = "Run 'pip install digiclay[images]'."
        raise ParameterError("shape", "file", rule, str(path), hint) from None
    image.init()  # else the named formats would not be registered
    for order, raw in (
        (b"II", "F;64F"),
        (b"MM", "F;64BF"),
    ):
        # Pillow can unpack them, but does not list them.
        tiff.OPEN_INFO[order, 1, (3,), 1, (64,), ()] = "F", raw
    several = tags.get(PLANES) == 2 and tags.get(CHANNELS, 1) > 1
    if tags.get(BITS, 8) > 8 and (several or tags.get(PHOTOMETRIC) == 0):
        rule = "must have interleaved channels, and 0 as black, if these have more than 8 bits"
        raise make_refusal(rule, str(path), "separate planes" if several else "0 is white")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            # From memory: Pillow unpacks turned pixels of a file that it maps wrongly.
            data = path.read_bytes()
            levels = _read_levels(lambda: image.open(io.BytesIO(data), formats=FORMATS), path)
            if tags.get(BITS) == 32 and tags.get(FORMAT, 1) == 1:
                return levels.view(np.uint32)  # Pillow reads them as signed
            return levels
        except image.DecompressionBombError:
            raise _make_size_error(path, "too many pixels to open") from None
        except image.UnidentifiedImageError:
            kind = (
                f"{tags[CHANNELS]} channels of {tags.get(BITS, 1)} bits" if CHANNELS in tags else ""
            )
            reason = f"a TIFF of {kind}, unknown to Pillow" if kind else "not a picture, or cut off"
        except OSError as error:
            reason = error.strerror or "not a picture, or cut off"
        except (ValueError, SyntaxError, EOFError) as error:
            reason = str(error)
    raise make_refusal("must be a picture that can be read", str(path), reason)


def _read_levels(open_picture: Callable[[], Any], path: Path) -> Pixels:
    """Return the numbers of a picture, (rows, columns[, channels]), with all their bits."""
    with open_picture() as opened:
        refuse_too_many(path, *opened.size)
        raw = _set_raw(opened, lambda raw: raw.replace("a;", "A;"))
        if raw == "LA;16B":  # four bytes per pixel
            _set_raw(opened, lambda raw: "RGBA")
            return np.asarray(opened).view(">u2")
        key = opened.info.get("transparency") if opened.mode in KEYED else None
        if opened.mode in ("P", "PA"):
            opened = opened.convert("RGBA")
        elif opened.mode not in (*GRAY, *COLORED):
            if ";16" in raw:
                raise ValueError(f"{opened.mode} of 16 bits")
            opened = opened.convert("LA" if opened.mode == "La" else "RGB")
        levels: Pixels = np.asarray(opened)
    if levels.ndim > 2 and ";16" in raw:
        # Pillow keeps the higher byte of a color; read in the other byte order, that is the lower one.
        with open_picture() as opened:
            _set_raw(
                opened, lambda raw: raw.replace("a;", "A;")[:-1] + ("L" if raw[-1] == "B" else "B")
            )
            levels = levels.astype(np.uint16) << 8 | np.asarray(opened)
        if "a;" in raw:  # colors multiplied by alpha, which is not needed then
            levels = levels[..., :3]
    if key is None:
        return levels
    other = levels != np.multiply(key, KEYED_BITS.get(raw, 1)).astype(levels.dtype)
    return levels * (other if levels.ndim == 2 else other.any(axis=2, keepdims=True))


def _set_raw(opened: Any, change: Callable[[str], str]) -> str:
    """Change how Pillow unpacks the bytes of a picture; return the name of the former format."""
    former: list[str] = [args if isinstance(args, str) else args[0] for *_, args in opened.tile]
    opened.tile = [
        tile._replace(
            args=change(raw) if isinstance(tile.args, str) else (change(raw), *tile.args[1:])
        )
        for tile, raw in zip(opened.tile, former, strict=True)
    ]
    return former[0]


def _find_brightness(levels: Pixels) -> Pixels:
    """Return the brightness of pixels, (rows, columns), from their channels, (rows, columns[, channels])."""
    if levels.ndim == 2:
        return levels
    bright = np.empty(levels.shape[:2], np.float32)
    full = np.float32(1.0 if levels.dtype.kind == "f" else np.iinfo(levels.dtype).max)
    for row, line in zip(levels, bright, strict=True):
        # All at once would take many times the memory.
        line[:] = row[:, :3] @ BRIGHTNESS if row.shape[1] > 2 else row[:, 0]
        if row.shape[1] in (2, 4):
            line *= row[:, -1] / full
    return bright


def refuse_too_many(path: Path, width: int, height: int) -> None:
    """Refuse a picture of too many pixels."""
    if width * height > MOST:
        raise _make_size_error(path, f"{width} x {height}")


def _make_size_error(path: Path, size: str) -> ParameterError:
    """Return the error of a picture too large to be read."""
    rule = f"must have at most {MOST // 1_000_000} million pixels"
    return ParameterError("shape", "file", rule, f"{path}: {size}", "Make it smaller first.")


#: Most values of a map; the pixels of a larger picture are averaged in squares.
MOST_VALUES = 4_000_000
#: Pixels averaged at a time, so that the picture itself bounds the memory.
CHUNK = 4_000_000


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights over a rectangle of pixels; a pixel is one unit wide, with its value in the middle."""

    name: str
    values: Floats
    """(r, c): The first row has the lowest y. Means of up to `block` x `block` pixels, where those without
    data count as 0."""
    pixels: tuple[int, int]
    """Rows and columns of pixels."""
    block: int = 1
    value_length: float | None = None
    """Meters per unit of the values; None if they are not lengths."""
    length: float | None = None
    """Width of a pixel, m; None if unknown."""
    share: Floats | None = None
    """(r, c): Share of the pixels that have data; None if all have."""

    underside = None

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The rectangle of all pixels."""
        return 0.0, 0.0, float(self.pixels[1]), float(self.pixels[0])

    def tops(self, grid: Grid, at: Placement) -> Tops:
        """Return the heights at the pins: bilinear between means over squares of pixels as large as a pin."""
        across, along = (grid.x - at.x) / at.factor_x, (grid.y - at.y) / at.factor_y
        covered = _within(across, self.pixels[1]) & _within(along, self.pixels[0])
        under_a_pin = min(grid.layout.pitch / at.factor_x, grid.layout.row_spacing / at.factor_y)
        values_under_a_pin = min(under_a_pin / self.block, max(self.values.shape))
        block = max(1, int(values_under_a_pin + RELATIVE_TOLERANCE))

        def interpolate(table: Floats) -> Floats:
            means = average_blocks(table, block)
            rows = _scale(along, self.pixels[0], block * self.block, means.shape[0])
            columns = _scale(across, self.pixels[1], block * self.block, means.shape[1])
            return _bilinear(means, rows, columns)

        share = np.ones(grid.count) if self.share is None else interpolate(self.share)
        covered &= share >= 0.5 - TIE
        value = interpolate(self.values) / np.where(covered, share, 1.0)
        return Tops(np.where(covered, value, 0.0), covered, np.zeros(grid.count, np.bool_))


def make_height_map(
    name: str, values: Pixels, value_length: float | None = None, length: float | None = None
) -> HeightMap:
    """Make a map of numbers (r, c), the first row at the lowest y; lengths: meters per unit, per pixel.

    Masked numbers have no data.
    """
    shown = " x ".join(map(str, values.shape)) or "a single number"
    if values.ndim != 2 or min(values.shape) < 2:
        raise make_refusal("must hold at least 2 x 2 heights", name, shown)
    if values.size > MOST:
        raise make_refusal(f"must hold at most {MOST // 1_000_000} million heights", name, shown)
    if values.dtype.kind not in "biuf":
        raise make_refusal("must hold numbers", name, str(values.dtype))
    block = int(np.ceil(np.sqrt(values.size / MOST_VALUES)))
    bare = np.ma.getmask(values)  # type: ignore[no-untyped-call]
    share = None if bare is np.ma.nomask else average_blocks(~bare, block)
    with np.errstate(over="ignore", invalid="ignore"):
        means = average_blocks(np.ma.filled(values, 0), block)  # type: ignore[no-untyped-call]
    bad = np.argwhere(~(np.abs(means) <= LARGEST))
    if bad.size:
        row, column = (bad[0] * block).tolist()
        rule = f"must hold finite numbers only, of at most {LARGEST:g}"
        raise make_refusal(rule, name, f"{means[tuple(bad[0])]} at {row}, {column}")
    rows, columns = values.shape
    return HeightMap(name, means, (rows, columns), block, value_length, length, share)


#: Grids of numbers as texts, by extension.
GRIDS = (".asc", ".txt", ".csv")
#: Line of the head of an Esri ASCII grid.
ESRI = re.compile(r"\s*([A-Za-z]\w*)[ \t]+([^\s,;]+)[ \t]*\n")


def read_grid(path: Path) -> HeightMap:
    """Read a text of heights, m: rows of numbers, the first at the lowest y, or an Esri ASCII grid."""
    head: dict[str, float] = {}
    at = 0
    try:
        text = path.read_text("utf-8-sig")
        while path.suffix.lower() == ".asc" and (line := ESRI.match(text, at)):
            head[line[1].lower()], at = float(line[2]), line.end()
        text = re.sub("#.*", "", text[at:])
        separator = next((sign for sign in ";\t," if sign in text), None)
        if separator != ",":
            text = text.replace(",", ".")
        with warnings.catch_warnings(action="error"):
            values: Pixels = np.loadtxt(text.splitlines(), delimiter=separator, ndmin=2)
        if path.suffix.lower() == ".asc":
            rows, columns = int(head["nrows"]), int(head["ncols"])
            if head.get("dx") != head.get("dy"):
                raise ValueError(f"its cells are {head['dx']:g} x {head['dy']:g}, not square")
            values = _mask(values.reshape(rows, columns)[::-1], head.get("nodata_value", -9999.0))
    except KeyError as error:
        reason = f"no {error} in its head, as an Esri ASCII grid has it"
    except (ValueError, OverflowError, Warning) as error:
        reason = str(error).partition(";")[0]
    else:
        if not head and values.shape[1] == 3 and len(values) > 99:
            rule = "must be a grid of heights, not a list of points"
            raise make_refusal(rule, path.name, f"{len(values)} rows of 3 numbers")
        return make_height_map(path.name, values, 1.0, head.get("cellsize", head.get("dx")))
    raise make_refusal("must be a grid of numbers that can be read", path.name, reason)


def average_blocks(values: NDArray[np.generic], block: int) -> Floats:
    """Return the means over squares of `block` x `block` values (r, c); the last squares may be smaller."""
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


def _within(position: Floats, pixels: int) -> NDArray[np.bool_]:
    """Return which positions lie on the pixels, the edge included."""
    slack = RELATIVE_TOLERANCE * pixels
    return (position >= -slack) & (position <= pixels + slack)


def _scale(position: Floats, pixels: int, block: int, count: int) -> Floats:
    """Return positions in pixels as positions among `count` means, whose middles are at 0, 1, ..."""
    starts = np.arange(count) * block
    middles = (starts + np.minimum(starts + block, pixels)) / 2
    return np.interp(position, middles, np.arange(count, dtype=np.float64))


def _bilinear(values: Floats, rows: Floats, columns: Floats) -> Floats:
    """Return values between the numbers of a table, shape (n,)."""
    row, column = rows.astype(np.intp), columns.astype(np.intp)
    last_row, last_column = values.shape[0] - 1, values.shape[1] - 1
    below, right = np.minimum(row + 1, last_row), np.minimum(column + 1, last_column)
    up, over = rows - row, columns - column
    first = values[row, column] * (1.0 - over) + values[row, right] * over
    second = values[below, column] * (1.0 - over) + values[below, right] * over
    return first * (1.0 - up) + second * up
