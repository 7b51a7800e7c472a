"""Electric motor in place of valve and cylinder: a speed that falls linearly with the load.

``v = v0 (K - F / F_stall)``, whether the command K sets voltage or current. Written as a flow
law, ``Q = g ΔP`` with ``g = A² v0 / F_stall`` and ``ΔP = P - F / A``: the conductance is constant,
and the pressure ``P = K F_stall / A`` is proportional to K. A motor that drives a share |K| of the
time and brakes otherwise has the average speed ``v = v0 (K - |K| F / F_stall)``: the conductance
is proportional to |K|, the pressure is that of a reservoir.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Floats
from ..base.quantity import Parameters, quantity
from .actuator import Supply
from .interfaces import Flow
from .valve import Fluid


@dataclass(frozen=True, eq=False, repr=False)
class Motor(Parameters):
    """Motor with a linear characteristic, between stall and free run."""

    stall_force: float = quantity(
        1.0,
        "force at which the motor at full command stalls",
        unit="N",
        symbol="F_stall",
        above=0.0,
    )
    free_speed: float = quantity(
        0.1, "speed without load at full command", unit="m/s", symbol="v_0", above=0.0
    )
    hold: str = quantity(
        "back_drivable",
        "at command 0: back-drivable, a load moves the pin; braked, no load does",
        choices=("back_drivable", "braked"),
    )

    def flow_law(self, fluid: Fluid, area: float) -> Flow:
        """Return the law of the motor as that of a flow into a cylinder of an area, m²."""
        kind = BackDrivable if self.hold == "back_drivable" else Braked
        return kind(area**2 * self.free_speed / self.stall_force, self.stall_force / area)


@dataclass(frozen=True)
class MotorFlow(Flow):
    """Flow law of a motor."""

    full: float
    """Conductance at full command, m³/(s Pa)."""
    stall: float
    """Pressure at the stall force, Pa."""

    @property
    def knee(self) -> float:
        """No flow is turbulent."""
        return math.inf

    def conductance(self, opening: Floats, drop: Floats) -> Floats:
        """Return Q/ΔP, m³/(s Pa), which does not depend on the drop."""
        conductance: Floats = self.laminar_conductance(opening)
        return conductance

    def source(self, supply: Supply) -> Supply:
        """Return the stall pressure both ways in place of the reservoirs."""
        return Supply(self.stall, -self.stall)


class Braked(MotorFlow):
    """Motor that brakes while it does not drive: at command 0 no load moves the pin."""

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any:
        """Return Q/ΔP, m³/(s Pa), of commands K, in the array `out` if given."""
        conductance = abs(opening) if out is None else np.abs(opening, out)
        conductance *= self.full
        return conductance


class BackDrivable(MotorFlow):
    """Motor that a load moves at any command."""

    def laminar_conductance(self, opening: Any, out: Floats | None = None) -> Any:
        """Return Q/ΔP, m³/(s Pa), the same at all commands K, in the array `out` if given."""
        if out is None:
            return self.full + 0.0 * opening
        out[:] = self.full
        return out

    def source(self, supply: Supply) -> Supply:
        """Return a pressure proportional to the command in place of the reservoirs."""
        return Torque(self.stall, -self.stall)


class Torque(Supply):
    """Pressure proportional to the command: what is `high` at K = 1, and no lock at K = 0."""

    locks = False

    def pressure(self, opening: Floats) -> Floats:
        """Return the pressure, Pa, at commands K, (n,)."""
        return self.high * opening

    def select(self, opening: float) -> float:
        """Return the pressure, Pa, at a command K."""
        return self.high * opening

    def balance(self, load: Floats) -> Any:
        """Return the commands that hold pins under loads, Pa; above the stall force none does."""
        return np.minimum(load / self.high, 1.0)

    def steer(self, conductance: Floats, opening: Floats, out: Floats) -> None:
        """Compute conductances times commands, into `out`."""
        np.multiply(conductance, opening, out)
