"""Pictures as height maps: dark is low, light is high.

Outside Blender, Pillow reads them. Blender reads them with what it has itself, which knows EXR as
well: its part of the program puts a reader into `READERS`.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ParameterError
from ..base.picture_size import read_size

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
    """Return the brightness of a picture's pixels, (rows, columns), the lowest row first.

    Raises ParameterError when it cannot be read, or is too large.
    """
    _refuse_by_head(path)
    if READERS:
        return READERS[-1](path)
    if path.suffix.lower() in BLENDER_ONLY:
        rule = "must be a PNG, TIFF or JPEG outside Blender"
        raise ParameterError("shape", "file", rule, str(path), "Blender itself reads EXR and HDR.")
    try:
        image: Any = importlib.import_module("PIL.Image")
    except ImportError:
        raise ParameterError(
            "shape", "file", "must be a mesh or an array where Pillow is not installed", str(path),
            "Run 'pip install digiclay[images]'.",
        ) from None  # fmt: skip
    image.init()  # formats that are named are not looked for
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", image.DecompressionBombWarning)
        try:
            with image.open(path, formats=FORMATS) as opened:
                refuse_too_many(path, *opened.size)
                gray = opened if opened.mode in GRAY else opened.convert("L")
                return np.flipud(np.asarray(gray))
        except image.DecompressionBombError:
            raise make_size_error(path, "too many pixels to open") from None
        except OSError as error:
            said = error.strerror or "not a picture, or cut off"
        except (ValueError, SyntaxError, EOFError) as error:
            said = " ".join(str(error).split())[:100]
    raise ParameterError("shape", "file", "must be a picture that can be read", f"{path}: {said}")


def _refuse_by_head(path: Path) -> None:
    """Refuse a picture whose header states too large a size, for all readers."""
    try:
        size = read_size(path)
    except OSError:
        return  # said by who reads it
    if size:
        refuse_too_many(path, *size)


def refuse_too_many(path: Path, width: int, height: int) -> None:
    """Refuse a picture too large to be read. `width`, `height`: pixels."""
    if width * height > MOST:
        raise make_size_error(path, f"{width} x {height}")


def make_size_error(path: Path, size: str) -> ParameterError:
    """Return the error of a picture too large to be read. `size`: what it has."""
    rule = f"must have at most {MOST // 1_000_000} million pixels"
    return ParameterError("shape", "file", rule, f"{path}: {size}", "Make it smaller first.")
