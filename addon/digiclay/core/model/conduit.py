"""Conduit between valve and cylinder: Hagen-Poiseuille, in series with the valve (equation 8)."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import TINY, Floats
from ..base.quantity import Parameters, quantity
from .interfaces import Flow
from .valve import Fluid, Orifice


@dataclass(frozen=True, eq=False, repr=False)
class Conduit(Parameters):
    """Straight round channel."""

    length: float = quantity(10e-3, "length", unit="m", symbol="L_c", at_least=0.0)
    diameter: float = quantity(0.8e-3, "inner diameter", unit="m", symbol="D_c", above=0.0)

    def resistance(self, fluid: Fluid) -> float:
        """Return ΔP/Q = 128 μ L_c / (π D_c⁴), Pa s/m³ (equation 8)."""
        return 128.0 * fluid.dynamic_viscosity * self.length / (math.pi * self.diameter**4)


@dataclass(frozen=True)
class OrificeAndConduit(Flow):
    """Valve and conduit in series: the drops add, the flow is the same.

    Each branch of the valve gives a linear or quadratic equation in Q, solved in closed form;
    the smaller flow holds, as without a conduit.
    """

    valve: Orifice
    resistance: float
    """Of the conduit, Pa s/m³."""

    @property
    def knee(self) -> float:
        """Smallest drop at which the flow becomes turbulent at some opening, Pa."""
        return self.valve.knee

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any:
        """Return g / (1 + R g), m³/(s Pa), of openings K, into `out` if given; see `Orifice`."""
        lift = self.valve.laminar_lift(opening, out)
        series = lift * self.resistance
        series += 1.0 / self.valve.laminar
        lift /= series
        return lift

    def conductance(self, opening: Floats, drop: Floats) -> Floats:
        """Return Q/ΔP of the series, m³/(s Pa), of openings K under drops over valve and conduit, Pa."""
        # 2 a / (R a + sqrt((R a)² + 4 |ΔP|)) with a of the open valve.
        turbulent: Floats = self.valve.turbulent * np.abs(opening)
        ra = self.resistance * turbulent
        root = 4.0 * np.abs(drop)
        root += ra * ra
        root = np.sqrt(root)
        root += ra
        root += TINY
        turbulent *= 2.0
        turbulent /= root
        laminar: Floats = self.laminar_conductance(opening)
        return np.minimum(laminar, turbulent)
