"""Data of the device that a controller may use, and the noise floor of its sensors.

The noise floor is five standard deviations of a cell's force sensor
(`sensors.Sensing.force_floor`): a larger reading is not noise. It is 0 without noise. Touch is
detected cell by cell: a sum of n readings would need five times √n, more than the force of a
fingertip at the rim of its contact. The controlled force is the sum of all readings, which has no
bias.
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
    """Description of the device for a controller."""

    grid: Grid
    cell: Cell
    """The cells' physics."""
    period: float
    """Control period, s."""
    blister: Blister | None = None
    heights: Floats | None = None
    """Blister of methods that form one; heights (n,) of an input shape to be displayed, m."""
    force_floor: float = 0.0
    height_floor: float = 0.0
    """Noise floor of a cell's force, N, and largest error of a height reading, m."""
    dead_time: float = 0.0
    """Dead time of valve commands, s."""
    commands_wait: bool = False
    """Whether a command may wait in a drive before it acts."""
    servos: bool = False
    """Whether servos of the drive follow commanded heights, whatever the valve commands are."""

    @cached_property
    def rim(self) -> Rim:
        """Outer cells of the bed for a fingertip that leads the blister."""
        assert self.blister is not None
        plan, (left, bottom), reach = (
            self.grid.layout,
            self.grid.corner,
            0.5 * self.blister.flat_radius,
        )
        x, y = TIE - left - 0.5 * (plan.pitch + plan.shift), TIE - bottom - 0.5 * plan.row_spacing
        return Rim(x if x > reach else math.inf, y if y > reach else math.inf, reach)

    @property
    def lift(self) -> float:
        """Largest force that the high reservoir lifts, ``P_high A_a``, N."""
        return self.cell.supply.high * self.cell.actuator.area

    @property
    def overload(self) -> float:
        """Force from which on a pin that is to rise is locked, N; infinite if no command locks it."""
        return self.lift if self.cell.supply.locks else math.inf


def suppress_noise(force: Floats, floor: Any) -> Floats:
    """Return forces (m[, b]), N, with 0 for those below the noise floor (b,), N."""
    return np.where(force >= floor, force, 0.0)


def check_floor(carried: float, field: str, asked: float, floor: float) -> None:
    """Refuse a noise floor above the force on a cell, N: contact would not be detected."""
    if floor >= carried:
        rule = (
            f"must keep five standard deviations below {carried:.3g} N, what a cell carries at most"
        )
        raise ParameterError(
            "sensors",
            "force_noise",
            f"{rule} with control.{field} = {asked:.3g} N",
            f"{floor:.3g} N",
        )
