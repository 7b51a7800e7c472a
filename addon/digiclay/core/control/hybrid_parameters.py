"""Parameters of Method III."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.quantity import quantity
from ..model.set_point import SetPoint
from .methods import ControlParameters
from .servo import declare_dead_band


@dataclass(frozen=True)
class Hybrid(ControlParameters):
    """Parameters of Method III."""

    force_setpoint: float = quantity(
        0.4, "total force held while shaping", unit="N", symbol="F_ref", above=0.0
    )
    felt_force: float = quantity(1e-3, "force of a touched cell", unit="N", symbol="F_0", above=0.0)
    trim_time: float = quantity(
        0.5, "time constant of the slow correction of the force", unit="s", symbol="t_trim", above=0.0
    )
    acceleration: float = quantity(
        1.0, "standard deviation of the fingertip's acceleration", unit="m/s2", symbol="σ_a", above=0.0
    )
    turn: float = quantity(
        0.5, "standard deviation of the fingertip's turn within a second (rad)", symbol="σ_turn", at_least=0.0
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
    travel: float = quantity(
        1.5e-3, "distance traveled that determines the direction", unit="m", symbol="d_t", above=0.0
    )
    behind: float = quantity(
        -0.05, "cosine below which a cell lies behind the fingertip", symbol="cos_f", at_least=-1.0, below=0.0
    )
    release_force: float = quantity(
        0.02, "force that releases a frozen cell", unit="N", symbol="F_free", above=0.0
    )
    loss_time: float = quantity(
        50e-3, "time without force until a loss", unit="s", symbol="t_l", at_least=0.0
    )
    # A pin on its way stands still within the band: at 10 µm a slow lift swings from period to period.
    dead_band: float = declare_dead_band(1e-6)

    @property
    def set_point(self) -> SetPoint:
        """Set point of all cells together."""
        return SetPoint(self.force_setpoint)
