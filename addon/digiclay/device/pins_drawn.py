"""Comparison of the pins in a bed's mesh with its layout."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..core.model.layout import Layout, grid

__all__ = ["differs"]

#: How far a pin may stand from its place before the bed counts as another one, m: more than 32 bits lose on
#: a bed of metres, less than any change of pitch worth making.
AWAY = 1e-6


def differs(bed: Any, layout: Layout) -> str:
    """Return why a bed is not the one a layout describes, or an empty text.

    Parameters
    ----------
    bed : bpy.types.Object
    layout : Layout
    """
    pins, wanted = len(bed.data.vertices), layout.rows * layout.columns
    if pins != wanted:
        return f"The bed has {pins} pins, not {wanted}"
    for index, place in _told_apart(layout):
        if np.abs(np.array(bed.data.vertices[index].co[:2]) / bridge.SCALE - place).max() > AWAY:
            return "The pins differ from the parameters of Layout"
    return ""


@lru_cache(maxsize=32)
def _told_apart(layout: Layout) -> tuple[tuple[int, NDArray[np.float64]], ...]:
    """Return index and position of the pins that distinguish layouts of equal size, m."""
    places = grid(layout).positions
    last = layout.rows * layout.columns - 1
    return tuple((index, places[index]) for index in sorted({0, min(layout.columns, last), last}))
