"""Data of the device that a controller may use, and the noise floor of its sensors.

The noise floor is the force from which on one reading is no noise, five standard deviations of a cell's
sensor (`sensors.Sensing.force_floor`); 0 with sensors without noise. Touch is decided cell by cell: a sum of
n readings would need five times √n, more than a fingertip at the rim of its contact presses with. A force
that is controlled is the sum of the readings as they are, which has no bias.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import TIE, Floats
from ..base.errors import ParameterError
from ..model.layout import Grid
from ..model.physics import Cell
from .blister import Blister
from .travel import Rim


@dataclass(frozen=True, eq=False)
class DeviceInfo:
    """The device, as its maker would describe it to a controller."""

    grid: Grid
    cell: Cell
    """The cells' physics."""
    period: float
    """Control period, s."""
    blister: Blister | None = None
    heights: Floats | None = None
    """For the methods that form one; (n,): the shape from outside that is to be displayed, m."""
    force_floor: float = 0.0
    height_floor: float = 0.0
    """Force from which on the reading of a cell is no noise, N; how far that of a height may be off, m."""
    dead_time: float = 0.0
    """Of the valves' commands, s."""

    @cached_property
    def rim(self) -> Rim:
        """Where the bed ends for a fingertip that leads the blister."""
        assert self.blister is not None
        plan, (left, bottom), reach = self.grid.layout, self.grid.corner, 0.5 * self.blister.flat_radius
        x, y = TIE - left - 0.5 * (plan.pitch + plan.shift), TIE - bottom - 0.5 * plan.row_spacing
        return Rim(x if x > reach else math.inf, y if y > reach else math.inf, reach)

    @property
    def lift(self) -> float:
        """Force the high reservoir can lift, ``P_high A_a``, N."""
        return self.cell.supply.high * self.cell.actuator.area


def suppress_noise(force: Floats, floor: Any) -> Floats:
    """Return forces (m[, b]), N, but 0 where they are below the noise floor (b,), N."""
    return np.where(force >= floor, force, 0.0)


def check_floor(carried: float, field: str, asked: float, floor: float) -> None:
    """Refuse a noise floor above the force that a cell carries, N: contact would not be detected."""
    if floor >= carried:
        rule = f"must keep five standard deviations below {carried:.3g} N, what a cell carries at most"
        raise ParameterError(
            "sensors", "force_noise", f"{rule} with control.{field} = {asked:.3g} N", f"{floor:.3g} N"
        )
