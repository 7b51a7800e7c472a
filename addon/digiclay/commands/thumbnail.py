"""Thumbnail of a run on an index page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core.base.errors import OutputError
from ..core.base.png import encode_png
from ..core.base.whole_files import write_whole
from ..device.heat import COLORS

#: Files that can be one; and its width, pixels.
NAMES = ("thumbnail.jpg", "thumbnail.png")
WIDTH = 320


def of_picture(still: Path, folder: Path) -> Path:
    """Make one of a picture that Blender has drawn. `folder`: of the thumbnail."""
    from ..compat import bpy, scratch

    out = folder / NAMES[0]
    with scratch():
        image = bpy.data.images.load(str(still))
        wide, high = image.size
        image.scale(WIDTH, max(1, round(WIDTH * high / wide)))
        image.file_format = "JPEG"
        try:
            image.save(filepath=str(out), quality=85)
        except RuntimeError as error:
            raise OutputError(f"{out} cannot be written: {' '.join(str(error).split())}") from None
    return out


def of_heights(height: NDArray[np.float64], rows: int, columns: int, folder: Path) -> Path:
    """Make one of heights (n,), seen from above.

    `height` (n,), m; `rows`, `columns`: of the bed; `folder`: of the thumbnail.
    """
    out = folder / NAMES[1]
    write_whole(out, encode_png(height_map(height.reshape(rows, columns))))
    return out


def height_map(height: NDArray[np.float64], wide: int = WIDTH) -> NDArray[np.uint8]:
    """Return a bed seen from above as pixels (rows, columns, 3): dark is low, bright is high.

    `height` (rows, columns), pin tops, the nearest row first; `wide`: about how many pixels the longer side
    has; large beds leave pins out.
    """
    every = max(1, -(-max(height.shape) // wide))
    shown = height[::every, ::every][::-1]
    times = max(1, wide // max(shown.shape))
    level = (shown - shown.min()) / max(float(np.ptp(shown)), 1e-9) * (len(COLORS) - 1)
    known = np.arange(len(COLORS))
    colors = np.stack([np.interp(level, known, channel) for channel in np.array(COLORS).T], axis=-1)
    return (colors * 255.0 + 0.5).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)
