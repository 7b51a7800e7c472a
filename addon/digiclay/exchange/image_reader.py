"""Reading of pictures by Blender, EXR and HDR included."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..compat import bpy
from ..core.base.errors import ParameterError
from ..core.shapes.heightmap import READERS, refuse_too_many

#: Most pixels that are handed over: Blender gives four 32-bit numbers for each. More are scaled
#: down by it.
MOST = 4_000_000


def pixels(path: Path) -> NDArray[np.float32]:
    """Return the channels of a picture's pixels, (rows, columns, channels), the lowest row first."""
    try:
        image = bpy.data.images.load(str(path.resolve()), check_existing=False)
    except RuntimeError:
        raise _unreadable(path) from None
    try:
        # Numbers as they are in the file: no curve, no multiplying by the alpha.
        image.colorspace_settings.is_data = True
        image.alpha_mode = "CHANNEL_PACKED"
        width, height = image.size
        if not width or not height:
            raise _unreadable(path)
        refuse_too_many(path, width, height)
        if width * height > MOST:
            share = math.sqrt(MOST / (width * height))
            image.scale(max(2, int(width * share)), max(2, int(height * share)))
        width, height = image.size
        table = np.empty((height, width, image.channels), np.float32)
        if len(image.pixels) != table.size:
            raise _unreadable(path)
        image.pixels.foreach_get(table.ravel())
        return table
    finally:
        bpy.data.images.remove(image)


def _unreadable(path: Path) -> ParameterError:
    """Return the error of a file that Blender cannot read."""
    return ParameterError("shape", "file", "must be a picture Blender can read", str(path))


def register() -> None:
    """Let Blender read the pictures."""
    READERS.append(pixels)


def unregister() -> None:
    """Undo `register`."""
    READERS.remove(pixels)
