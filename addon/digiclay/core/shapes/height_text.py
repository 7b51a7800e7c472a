"""Heights of a bed as text, for scene files and Blender properties."""

from __future__ import annotations

import base64
import binascii
import zlib

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..model.layout import Grid

HINT = "Take the shape in again."


def pack(heights: Floats) -> str:
    """Pack heights, shape (n,), m, as letters and digits; to 4 nm, as 32-bit numbers are."""
    return base64.b64encode(zlib.compress(heights.astype("<f4").tobytes(), 9)).decode("ascii")


def unpack(text: str, grid: Grid) -> Floats:
    """Return the heights of the cells of a bed, shape (n,), m.

    `text`: from `pack`. Raises ParameterError when the text is not what `pack` made, or was made for another
    bed.
    """
    wanted = 4 * grid.count
    try:
        opened = zlib.decompressobj()
        data = opened.decompress(base64.b64decode(text, validate=True), wanted + 1)
        whole = opened.eof or len(data) > wanted
    except (binascii.Error, ValueError, zlib.error):
        whole, data = False, b""
    if not whole or (len(data) % 4 and len(data) <= wanted):
        raise ParameterError("shape", "heights", "must be heights packed as text", _cut(text), HINT)
    if len(data) != wanted:
        plan = grid.layout
        rule = f"must hold the heights of the bed's {plan.rows} x {plan.columns} cells"
        got = f"{len(data) // 4} heights" if len(data) < wanted else f"more than {grid.count} heights"
        raise ParameterError("shape", "heights", rule, got, HINT)
    heights = np.frombuffer(data, "<f4").astype(np.float64)
    if not np.all(np.isfinite(heights)):
        cell = int(np.flatnonzero(~np.isfinite(heights))[0])
        raise ParameterError("shape", "heights", "must be finite numbers", f"{heights[cell]} at cell {cell}")
    return heights


def _cut(text: str) -> str:
    """Show the beginning of a long text."""
    return repr(text if len(text) <= 20 else f"{text[:17]}...")
