"""Falloffs of the Press tool: Blender's, from 1 to 0 over a width. No Blender."""

import math
from collections.abc import Callable
from enum import Enum

import numpy as np

from ..core.base.arrays import TIE, Floats
from ..core.base.errors import ParameterError


class Falloff(Enum):
    """Share of a brush's effect by the distance from the path."""

    DEVICE = "DEVICE"
    SMOOTH = "SMOOTH"
    SPHERE = "SPHERE"
    ROOT = "ROOT"
    SHARP = "SHARP"
    LINEAR = "LINEAR"
    CONSTANT = "CONSTANT"


#: Shares by what is left of the width, 1 to 0, as in Blender's ``BKE_brush_curve_strength``. DEVICE has none:
#: it is the profile of the blister, or that of the brush.
FORMULAS: dict[Falloff, Callable[[Floats], Floats]] = {
    Falloff.SMOOTH: lambda left: (3.0 - 2.0 * left) * left**2,
    Falloff.SPHERE: lambda left: np.sqrt((2.0 - left) * left),
    Falloff.ROOT: np.sqrt,
    Falloff.SHARP: np.square,
    Falloff.LINEAR: np.positive,
    Falloff.CONSTANT: np.sign,
}


def evaluate(falloff: Falloff, distance: Floats, width: float) -> Floats:
    """Return the share, (m,), at distances from where a falloff begins, m; ParameterError without a width."""
    if not 0.0 < width < math.inf:
        raise ParameterError("Falloff", "width", "must be a finite length above 0", f"{width:g} m")
    left = (1.0 - distance / width).clip(0.0, 1.0)
    # A pin on the rim is outside, whatever its distance is rounded to.
    return FORMULAS[falloff](np.where(distance > width - TIE, 0.0, left))
