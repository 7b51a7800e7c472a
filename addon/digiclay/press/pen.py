"""Pressure and tilt of a pen: share of depth, height or strength, and lean of the fingertip. No Blender."""

from __future__ import annotations

import math

import numpy as np

from ..core.base.arrays import Floats

#: Lean of a pen at full tilt, rad: tablets report up to some 60°.
FULL_TILT = math.radians(60.0)
#: Exponent of each curve: a soft pen reaches the set value with a light hand, a firm one with a heavy hand.
EXPONENTS = {"SOFT": 0.5, "LINEAR": 1.0, "FIRM": 2.0}
#: The curves as items of a property in Blender.
CURVE_ITEMS = (
    ("SOFT", "Soft", "The square root of the pressure: a light hand goes deep"),
    ("LINEAR", "Linear", "The pressure itself"),
    ("FIRM", "Firm", "The square of the pressure: fine control of light touches"),
)


def find_share(pressure: float, curve: str) -> float:
    """Return the share that a pressure asks for, 0 to 1; all of it where the pressure is no number.

    `pressure`: from the window system, 0 to 1; `curve`: first word of an item of `CURVE_ITEMS`.
    """
    if math.isnan(pressure):
        return 1.0
    return float(min(max(pressure, 0.0), 1.0) ** EXPONENTS[curve])


def find_lean(tilt: tuple[float, float], seen: Floats) -> tuple[float, float]:
    """Return how far a pen leans towards x and y of the bed, rad; not at all where its tilt is no number.

    The pen leans over the bed as it does over the tablet, whose right is the right of the view and whose far
    side is what lies farther up in the view.

    `tilt` (float, float), from the window system, to the right and towards the user, each -1 to 1; `seen` (3,
    3), columns: right, up and towards the eye of the view, in the space of the bed.
    """
    right, up = float(tilt[0]), -float(tilt[1])
    size = math.hypot(right, up)
    if not math.isfinite(size) or size == 0.0:
        return 0.0, 0.0
    # In a level view the upward direction has no part in the plane of the bed; what is square to aside has.
    aside = seen[:2, 0] if math.hypot(*seen[:2, 0]) > 1e-6 else np.array([seen[1, 1], -seen[0, 1]])
    aside = aside / math.hypot(*aside)
    away = np.array([-aside[1], aside[0]])
    x, y = FULL_TILT * min(1.0, 1.0 / size) * (right * aside + up * away)
    return float(x), float(y)
