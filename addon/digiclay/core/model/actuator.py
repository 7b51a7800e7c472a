"""Fluidic cylinder under each pin (equations 1 and 2), and the reservoirs that feed it."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity


@dataclass(frozen=True, eq=False, repr=False)
class Supply(Parameters):
    """Reservoirs at constant gauge pressure, selected by the sign of the opening."""

    high: float = quantity(
        0.5e5,
        "gauge pressure of the reservoir that raises pins",
        unit="Pa",
        symbol="P_high",
        source="P",
    )
    low: float = quantity(
        -0.5e5,
        "gauge pressure of the reservoir that lowers pins",
        unit="Pa",
        symbol="P_low",
        source="P",
    )

    #: Whether a shut valve locks its pin.
    locks: ClassVar[bool] = True

    def check(self) -> None:
        """Refuse a high pressure that is not above the low one."""
        if not self.high > self.low:
            value = f"{self.high:g} Pa, low {self.low:g} Pa"
            raise ParameterError("Supply", "high", "must be above Supply.low", value)

    @property
    def largest(self) -> float:
        """Larger absolute value of the two pressures, Pa."""
        return max(abs(self.high), abs(self.low))

    def pressure(self, opening: Floats) -> Floats:
        """Return the pressure of the reservoir behind the valve, Pa, for openings K, (n,)."""
        return np.where(opening > 0.0, self.high, self.low)

    def select(self, opening: float) -> float:
        """Return the pressure of the reservoir behind a valve of opening K, Pa."""
        return self.high if opening > 0.0 else self.low

    def balance(self, load: Floats) -> Any:
        """Return the commands that hold pins under loads, Pa."""
        return 0.0

    def steer(self, conductance: Floats, opening: Floats, out: Floats) -> None:
        """Compute conductances with the sign of the openings, into `out`."""
        np.copysign(conductance, opening, out)


@dataclass(frozen=True, eq=False, repr=False)
class Actuator(Parameters):
    """Single-acting cylinder with the pin as its rod."""

    bore: float = quantity(
        2e-3, "inner diameter of the cylinder", unit="m", symbol="D_a", source="P", above=0.0
    )
    stroke: float = quantity(
        100e-3, "height of the upper end stop", unit="m", symbol="H_max", source="P", above=0.0
    )
    rest_height: float = quantity(
        40e-3, "initial height of all pins", unit="m", symbol="H_0", at_least=0.0
    )

    def check(self) -> None:
        """Refuse a rest height above the upper end stop."""
        if self.rest_height > self.stroke:
            rule = f"must be at most the stroke, {self.stroke:g} m"
            raise ParameterError("Actuator", "rest_height", rule, f"{self.rest_height:g} m")

    @property
    def area(self) -> float:
        """Cross section A_a of the cylinder, m²."""
        return math.pi * self.bore**2 / 4.0

    def pressure(self, force: Floats) -> Floats:
        """Return the gauge pressure P_a = F_a / A_a, Pa (equation 2), for forces pressing down, N."""
        return force / self.area

    def rate(self, flow: Floats, height: Floats) -> Floats:
        """Return dH/dt = q / A_a, m/s (equation 1), of inflows q, m³/s; 0 into an end stop."""
        speed: Floats = flow / self.area
        if height.size and height.min() > 0.0 and height.max() < self.stroke:
            return speed
        inward = ((height >= self.stroke) & (flow > 0.0)) | ((height <= 0.0) & (flow < 0.0))
        return np.where(inward, 0.0, speed)
