"""Marks of the Press tool in the view: lines and text that are seen on everything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.base.modes import COLORS, Mode
from ..overlay.picture import Color, Line, Words

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: A light line on a dark one is seen on everything.
DARK, LIGHT = (0.05, 0.05, 0.05), (1.0, 1.0, 1.0)
#: That of a stroke that smooths has the color of the pins that the device drives.
SMOOTHING = COLORS[Mode.BLISTER]


def make_lines(paths: Sequence[Floats], width: float, color: Color = LIGHT) -> list[Line]:
    """Return light lines on dark ones.

    `paths` (k, 2), pixels; `width`: of a thin line, pixels; `color` (float, float, float), of the light ones.
    """
    return [Line(path, *look) for look in ((DARK, 4.0 * width), (color, 2.0 * width)) for path in paths]


def make_label(text: str, xy: tuple[float, float], scale: float) -> list[Words]:
    """Return text beside a place, light on a dark edge.

    `xy` (float, float), pixels; `scale`: of Blender's interface.
    """
    x, y, size = xy[0] + 22.0 * scale, xy[1] - 26.0 * scale, 12.0 * scale
    edge = [Words(x + i, y + j, size, DARK, text) for i in (-scale, scale) for j in (-scale, scale)]
    return [*edge, Words(x, y, size, LIGHT, text)]
