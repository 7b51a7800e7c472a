"""Parameters of Method III, and how fast a fingertip may lead it."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.quantity import quantity
from ..model.control_interface import SetPoint
from .methods import ControlParameters, Pace
from .servo import declare_again
from .virtual_master import VirtualMaster


@dataclass(frozen=True, eq=False, repr=False)
class Hybrid(ControlParameters):
    """Parameters of Method III."""

    force_setpoint: float = quantity(
        0.4, "total force held while shaping", unit="N", symbol="F_ref", above=0.0
    )
    felt_force: float = quantity(1e-3, "force of a touched cell", unit="N", symbol="F_0", above=0.0)
    trim_time: float = quantity(
        0.5,
        "time constant of the slow correction of the force",
        unit="s",
        symbol="t_trim",
        above=0.0,
    )
    acceleration: float = quantity(
        1.0,
        "standard deviation of the fingertip's acceleration",
        unit="m/s2",
        symbol="σ_a",
        above=0.0,
    )
    turn: float = quantity(
        0.5,
        "standard deviation of the fingertip's turn within a second (rad)",
        symbol="σ_turn",
        at_least=0.0,
    )
    size_drift: float = quantity(
        0.05,
        "standard deviation of the fingertip's relative size within a second",
        symbol="σ_size",
        at_least=0.0,
    )
    underside_error: float = quantity(
        30e-6, "standard deviation of an observed underside", unit="m", symbol="σ_u", above=0.0
    )
    level_margin: float = quantity(
        1.5e-3, "width of the level ring around the flat top", unit="m", symbol="d_l", at_least=0.0
    )
    speed_share: float = quantity(
        0.85,
        "share of the free speed in the heights ahead of the fingertip",
        symbol="s_v",
        above=0.0,
        at_most=1.0,
    )
    skirt_speed: float = quantity(
        45e-3,
        "drag speed from rest for which the skirt suffices (0: no skirt)",
        unit="m/s",
        symbol="v_s",
        at_least=0.0,
    )
    travel: float = declare_again(VirtualMaster, "travel")
    behind: float = declare_again(VirtualMaster, "behind", -0.05)
    release_force: float = declare_again(VirtualMaster, "release_force")
    loss_time: float = declare_again(VirtualMaster, "loss_time")
    # A pin on its way stands still within the band: at 10 µm a slow lift swings from period to
    # period.
    dead_band: float = declare_again(VirtualMaster, "dead_band", 1e-6)

    @property
    def set_point(self) -> SetPoint:
        """Set point of all cells together."""
        return SetPoint(self.force_setpoint)

    @property
    def pace(self) -> Pace:
        """How fast a fingertip may lead it: in proportion to the skirt, which exists before a drag begins."""
        if not self.skirt_speed:
            return Pace()
        return Pace(RADII, RADII, SKIRT * self.skirt_speed, ready=True, press=0.06, gain=0.1)


#: Fastest drag, in radii of the blister a second, and as a share of the skirt's speed.
RADII, SKIRT = 14.0, 0.6
