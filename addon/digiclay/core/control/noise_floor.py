"""Noise floor of the sensors: thresholds above it, refusal of set points below it.

The floor is the force from which on one reading is no noise, five standard deviations of a cell's sensor
(`sensors.Sensing.force_floor`); 0 with sensors without noise. Touch is told cell by cell: a sum of n readings
would need five times √n, more than a finger at the rim of its contact presses with. A force that is
controlled is the sum of the readings as they are, which has no bias.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ParameterError

__all__ = ["above", "check_told"]

Floats = NDArray[np.float64]


def above(force: Floats, floor: float) -> Floats:
    """Return forces, N, shape (m,), but 0 where they may be noise; all as they are for a floor of 0."""
    return np.where(force >= floor, force, 0.0) if floor else force


def check_told(carried: float, field: str, asked: float, floor: float) -> None:
    """Refuse noise above the set point, since contact would not be detected.

    Parameters
    ----------
    carried : float
        Force on a cell when all is as asked, N.
    field : str
        Of the control, for the message.
    asked : float
        Its value, N.
    floor : float
        N.

    Raises
    ------
    ParameterError
    """
    if floor >= carried:
        rule = f"must keep five standard deviations below {carried:.3g} N, what a cell carries at most"
        raise ParameterError(
            "sensors", "force_noise", f"{rule} with control.{field} = {asked:.3g} N", f"{floor:.3g} N"
        )
