"""Valve of a cell and its fluid: an orifice law of two branches (equations 3 to 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import TINY, Floats
from ..base.quantity import Parameters, quantity, refuse_overrides
from .interfaces import Flow


@dataclass(frozen=True, eq=False, repr=False)
class Fluid(Parameters):
    """An incompressible Newtonian fluid; the default is a silicone oil (Syltherm XLT at 20 °C)."""

    density: float = quantity(
        855.0, "density", unit="kg/m3", symbol="ρ", source="Melinder 2010", above=0.0
    )
    viscosity: float = quantity(
        1.6e-6, "kinematic viscosity", unit="m2/s", symbol="ν", source="Melinder 2010", above=0.0
    )

    @property
    def dynamic_viscosity(self) -> float:
        """Dynamic viscosity μ = ρ ν, Pa s."""
        return self.density * self.viscosity


@dataclass(frozen=True, eq=False, repr=False)
class Valve(Parameters):
    """Proportional seat valve, after Carretero and Breuer's 10:1 model.

    The discharge coefficient is ``C_q = s h*`` in the turbulent branch and
    ``C_q = s h* Re*/Re_k`` below ``Re* = Re_k`` (equation 5), with
    ``Re* = sqrt(Q / (ν h_v))`` (equation 4).
    """

    orifice_diameter: float = quantity(
        0.5e-3, "diameter of the orifice", unit="m", symbol="d_o", above=0.0
    )
    stroke: float = quantity(
        30e-6,
        "lift of the fully open valve",
        unit="m",
        symbol="h_v",
        source="Roberts 2003",
        above=0.0,
    )
    discharge_slope: float = quantity(
        0.18, "discharge coefficient over relative opening", symbol="s", source="P", above=0.0
    )
    knee_reynolds: float = quantity(
        200.0,
        "Reynolds number Re* at which the branches meet",
        symbol="Re_k",
        source="P",
        above=0.0,
    )
    gap: str = quantity(
        "stroke",
        "length in Re*: the full stroke (eq. 4), or the actual opening",
        source="P",
        choices=("stroke", "opening"),
    )

    def flow_law(self, fluid: Fluid, area: float) -> Orifice:
        """Return the valve's flow law in a fluid; `area`: of the cylinder, m², has no effect."""
        return make_orifice(self, fluid)


@dataclass(frozen=True)
class Orifice(Flow):
    """Flow law of a valve in a fluid (equations 3 to 7).

    Laminar branch ``Q = g ΔP`` with ``g = laminar |K|^power``; turbulent branch
    ``Q = a sqrt(ΔP)`` with ``a = turbulent |K|``. The smaller of the two holds: they
    cross once, at ΔP_crit, so Q is continuous and grows with ΔP.
    """

    laminar: float
    """Conductance of the fully open valve, m³/(s Pa) (equation 7, laminar)."""
    turbulent: float
    """Coefficient of the fully open valve, m³/(s sqrt(Pa)) (equation 7, turbulent)."""
    power: int
    """Exponent of the opening in the laminar branch: 2, or 1 with ``gap = "opening"``."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        rule = "steppers and conduits compute the flow from laminar_lift"
        refuse_overrides(cls, Orifice, ("knee", "laminar_conductance", "conductance", "flow"), rule)

    @property
    def knee(self) -> float:
        """Smallest drop at which the flow becomes turbulent at some opening, Pa (equation 6 at h* = 1)."""
        return (self.turbulent / self.laminar) ** 2

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any:
        """Return Q/ΔP in the laminar branch, m³/(s Pa), of openings K, in the array `out` if given."""
        conductance = self.laminar_lift(opening, out)
        conductance *= self.laminar
        return conductance

    def laminar_lift(self, opening: Any, out: Floats | None) -> Any:
        """Return openings to the power of the laminar branch, in the array `out` if given."""
        if out is None:
            return opening * opening if self.power == 2 else abs(opening)
        return np.multiply(opening, opening, out) if self.power == 2 else np.abs(opening, out)

    def conductance(self, opening: Floats, drop: Floats) -> Floats:
        """Return the secant conductance Q/ΔP, m³/(s Pa), of openings K, either sign, under drops, Pa."""
        root = np.sqrt(np.abs(drop)) + TINY
        laminar: Floats = self.laminar_conductance(opening)
        return np.minimum(laminar, self.turbulent * np.abs(opening) / root)


def make_orifice(valve: Valve, fluid: Fluid) -> Orifice:
    """Return the flow law from the slope and the knee of equation 5, not from rounded constants."""
    area_term = math.pi * valve.discharge_slope * valve.orifice_diameter**2
    laminar = area_term**2 / (
        8.0 * valve.knee_reynolds**2 * fluid.density * fluid.viscosity * valve.stroke
    )
    turbulent = area_term / 4.0 * math.sqrt(2.0 / fluid.density)
    return Orifice(laminar, turbulent, 2 if valve.gap == "stroke" else 1)
