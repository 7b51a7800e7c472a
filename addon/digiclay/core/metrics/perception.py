"""Deviations in units of touch: just noticeable differences of force, spatial resolution of a fingertip.

Weber fractions of force: 7 to 10 % of forces above 0.5 N, 15 to 27 % of smaller ones (Gueorguiev, Lambert,
Thonnard and Kuchenbecker 2022, doi 10.1038/s41598-022-12010-0, from earlier experiments). Pang, Tan and
Durlach (1991) measured 7 % from 2.5 to 10 N. Spatial resolution: the finest grating whose direction a finger
tells has grooves of 0.94 mm (Van Boven and Johnson 1994); Johnson and Phillips (1981) measured 0.87 mm for a
gap. docs/perception.md states what follows from them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..base.errors import ParameterError

#: Force from which on the smaller Weber fractions hold, N.
BORDER = 0.5
#: Smallest and largest Weber fraction of forces from `BORDER` on, and of smaller ones.
ABOVE, BELOW = (0.07, 0.10), (0.15, 0.27)
#: Groove of the finest grating whose direction a fingertip tells, m.
SPATIAL_RESOLUTION = 0.94e-3

#: Metrics of `perceive`: unit and meaning.
PERCEPTION: dict[str, tuple[str, str]] = {
    "rfd_jnd_least": ("1", "RFD over the largest just noticeable difference of the set point"),
    "rfd_jnd_most": ("1", "RFD over the smallest just noticeable difference of the set point"),
    "ridge_unevenness_touch": ("1", "ridge_unevenness over the spatial resolution of a fingertip"),
}


@dataclass(frozen=True)
class Perceived:
    """Deviations in units of touch; None where there is nothing to compute from.

    Attributes
    ----------
    least, most : float or None
        Just noticeable differences of force, with the largest and with the smallest Weber fraction.
    resolutions : float or None
        Spatial resolutions of a fingertip.
    """

    least: float | None
    most: float | None
    resolutions: float | None

    def figures(self) -> dict[str, float | None]:
        """Return the values by the keys of `PERCEPTION`."""
        return dict(zip(PERCEPTION, (self.least, self.most, self.resolutions), strict=True))


def find_weber_fractions(force: float) -> tuple[float, float]:
    """Return the smallest and the largest Weber fraction of a force.

    `force`: reference force, N, above 0. Raises ParameterError when the force is not above 0 or not finite.
    """
    if not (math.isfinite(force) and force > 0.0):
        raise ParameterError("Perception", "force", "must be above 0 N and finite", f"{force:g} N")
    return ABOVE if force >= BORDER else BELOW


def perceive(deviation: float | None, force: float | None, unevenness: float | None) -> Perceived:
    """Return deviations in units of touch.

    `deviation`: of the force from its reference, N, at least 0; `force`: reference force, N, above 0;
    `unevenness`: of a surface, m, at least 0. Raises ParameterError when a deviation is negative or not
    finite, or the force is no reference.
    """
    for name, value, unit in (("deviation", deviation, "N"), ("unevenness", unevenness, "m")):
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise ParameterError("Perception", name, f"must be at least 0 {unit} and finite", f"{value:g}")
    least = most = None
    if deviation is not None and force is not None:
        fine, coarse = find_weber_fractions(force)
        least, most = deviation / (coarse * force), deviation / (fine * force)
    return Perceived(least, most, None if unevenness is None else unevenness / SPATIAL_RESOLUTION)
