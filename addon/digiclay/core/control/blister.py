"""Blister: heights between the virtual master and the surrounding surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import Constants, Floats
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity


@dataclass(frozen=True)
class Blister(Parameters):
    """Radius and profile of the blister, and the ring around it that gives the edge height."""

    radius: float = quantity(
        15e-3, "radius of the blister", unit="m", symbol="r_blister", source="P", above=0.0
    )
    edge_radius: float = quantity(
        18.5e-3, "outer radius of the ring of edge cells", unit="m", symbol="r_edge", above=0.0
    )
    flat_radius: float = quantity(6e-3, "radius of the flat top", unit="m", symbol="r_flat", at_least=0.0)
    profile: str = quantity("cone", "radial profile of the blister", source="P", choices=("cone", "gaussian"))
    sigma: float = quantity(7e-3, "standard deviation of the Gaussian", unit="m", symbol="σ", above=0.0)

    def check(self) -> None:
        """The flat top lies inside the blister, the edge outside."""
        if not self.flat_radius < self.radius:
            rule = f"must be below the radius, {self.radius:g} m"
            raise ParameterError("Blister", "flat_radius", rule, f"{self.flat_radius:g} m")
        if not self.edge_radius > self.radius:
            rule = f"must be above the radius, {self.radius:g} m"
            raise ParameterError("Blister", "edge_radius", rule, f"{self.edge_radius:g} m")

    def evaluate_profile(self, distance: Floats) -> Floats:
        """Return the profile p(r), 1 at the center, for distances r inside the blister, m.

        *cone*: 1 on the flat top, then falling linearly to 0 at the radius.
        *gaussian*: ``exp(-r²/(2 σ²))``.
        """
        return self.interpolate(distance, 0.0, 1.0)

    def interpolate(self, distance: Floats, edge: Any, top: Any) -> Floats:
        """Return heights ``edge + p(r) (top - edge)``, m.

        `distance` (m,) or (m, b), from the middle, m; `edge`, `top` (m,) or (b,), heights of the surface
        around the blister and of its top, m.
        """
        if self.profile == "gaussian":
            height: Floats = np.exp(distance * distance * (-0.5 / self.sigma**2))
            slope, start = top - edge, edge
        else:
            (flat,) = self._flat[distance.shape]
            height = np.maximum(distance, flat)
            slope = (edge - top) / (self.radius - self.flat_radius)
            start = top - slope * self.flat_radius
        height *= slope
        height += start
        return height

    @cached_property
    def _flat(self) -> Constants:
        """The radius of the flat top, m."""
        return Constants((self.flat_radius,))
