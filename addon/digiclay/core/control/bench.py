"""Data of the device that a controller may use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.layout import Grid
from ..model.physics import Cell
from .blister import Blister

__all__ = ["Bench"]


@dataclass(frozen=True, eq=False)
class Bench:
    """Data of the device for a controller.

    Attributes
    ----------
    grid : Grid
    cell : Cell
        The cells' physics.
    period : float
        Control period, s.
    blister : Blister or None
        For the methods that form one.
    heights : ndarray (n,) or None
        The shape from outside that is to be displayed, m.
    force_floor : float
        Force from which on the reading of a cell is no noise, N; see `sensors.Sensing`.
    height_floor : float
        How far the reading of a height may be off, m.
    """

    grid: Grid
    cell: Cell
    period: float
    blister: Blister | None = None
    heights: NDArray[np.float64] | None = None
    force_floor: float = 0.0
    height_floor: float = 0.0

    @property
    def lift(self) -> float:
        """Force the high reservoir can lift, ``P_high A_a``, N."""
        return self.cell.supply.high * self.cell.actuator.area
