"""Working fluid."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.quantity import Parameters, quantity


@dataclass(frozen=True)
class Fluid(Parameters):
    """An incompressible Newtonian fluid; the default is a silicone oil (Syltherm XLT at 20 °C)."""

    density: float = quantity(855.0, "density", unit="kg/m3", symbol="ρ", source="Melinder 2010", above=0.0)
    viscosity: float = quantity(
        1.6e-6, "kinematic viscosity", unit="m2/s", symbol="ν", source="Melinder 2010", above=0.0
    )

    @property
    def dynamic_viscosity(self) -> float:
        """Dynamic viscosity μ = ρ ν, Pa s."""
        return self.density * self.viscosity
