"""Pressure of a pen: the share of depth, height or strength that it asks for. No Blender in here."""

from __future__ import annotations

import math

__all__ = ["CURVE_ITEMS", "find_share"]

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

    Parameters
    ----------
    pressure : float
        From the window system, 0 to 1.
    curve : str
        First word of an item of `CURVE_ITEMS`.
    """
    if math.isnan(pressure):
        return 1.0
    return float(min(max(pressure, 0.0), 1.0) ** EXPONENTS[curve])
