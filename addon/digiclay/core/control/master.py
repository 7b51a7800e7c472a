"""Virtual master of Method I: gains, thresholds and memory."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from ..base.quantity import quantity
from ..model.set_point import SetPoint
from .tracking import Tracking
from .travel import Heading

__all__ = ["Master", "Phase", "VirtualMaster"]


class Phase(IntEnum):
    """Phase of the master."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2


class Master(NamedTuple):
    """Memory of the controller.

    Attributes
    ----------
    phase : Phase
    x, y, height : float
        Where the master is, m.
    opening : float
        Of its own valve.
    reference : float
        Surface height at first touch, from which the virtual spring is pressed down, m.
    edge : float
        Height of the surface around the blister, m.
    heading : Heading
        Which way it travels.
    felt : float
        Its height when the finger was last felt, m.
    alone : int
        Control periods since the finger was last felt.
    losses : int
        How often the finger was lost while shaping.
    """

    phase: Phase = Phase.IDLE
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    opening: float = 0.0
    reference: float = 0.0
    edge: float = 0.0
    heading: Heading = Heading()
    felt: float = 0.0
    alone: int = 0
    losses: int = 0

    # What changes every period is written out: `_replace` takes nearly twice as long.

    def at(self, x: float, y: float, heading: Heading) -> Master:
        """Return the master where it has felt the finger."""
        kept = self.height, self.opening, self.reference, self.edge
        return Master(self.phase, x, y, *kept, heading, self.felt, 0, self.losses)

    def led(self, phase: Phase, height: float, opening: float) -> Master:
        """Return the master after a period, with its valve's opening."""
        felt = height if self.alone == 0 else self.felt
        place, kept = (self.x, self.y), (self.reference, self.edge)
        return Master(phase, *place, height, opening, *kept, self.heading, felt, self.alone, self.losses)

    def with_edge(self, edge: float) -> Master:
        """Return the master in a surface of this height."""
        kept = self.phase, self.x, self.y, self.height, self.opening, self.reference
        return Master(*kept, edge, self.heading, self.felt, self.alone, self.losses)


@dataclass(frozen=True)
class VirtualMaster(Tracking):
    """Gains and thresholds of Method I."""

    force_setpoint: float = quantity(
        0.4,
        "total force held while shaping, and at which shaping starts",
        unit="N",
        symbol="F_ref",
        above=0.0,
    )
    spring_stiffness: float = quantity(
        200.0, "stiffness of the virtual spring before shaping", unit="N/m", symbol="k_VS", above=0.0
    )
    force_gain: float = quantity(5.0, "proportional gain of force", unit="1/N", symbol="K_f", at_least=0.0)
    radius: float = quantity(
        8e-3,
        "radius of the search for the fingertip around the master",
        unit="m",
        symbol="r_VM",
        source="P",
        above=0.0,
    )
    release_force: float = quantity(
        0.02, "force that releases a frozen cell", unit="N", symbol="F_free", above=0.0
    )
    felt_force: float = quantity(
        1e-3, "total force below which there is no contact", unit="N", symbol="F_0", above=0.0
    )
    loss_time: float = quantity(
        50e-3, "time without force until a loss", unit="s", symbol="t_l", at_least=0.0
    )

    @property
    def set_point(self) -> SetPoint:
        """Set point of all cells together."""
        return SetPoint(self.force_setpoint)
