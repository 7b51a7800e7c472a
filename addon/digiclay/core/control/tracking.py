"""Common part of the tracking methods: height control of cells, direction of the fingertip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ..base.quantity import quantity
from .methods import ControlParameters
from .servo import Servo

__all__ = ["Tracking"]


@dataclass(frozen=True)
class Tracking(ControlParameters):
    """Height control of the cells, and direction of the fingertip."""

    position_gain: float = quantity(
        500.0, "proportional gain of height", unit="1/m", symbol="K_p", at_least=0.0
    )
    dead_band: float = quantity(10e-6, "height error without a command", unit="m", symbol="δ", at_least=0.0)
    travel: float = quantity(
        1.5e-3, "distance travelled that determines the direction", unit="m", symbol="d_t", above=0.0
    )
    behind: float = quantity(
        -0.3, "cosine below which a cell lies behind the fingertip", symbol="cos_f", at_least=-1.0, below=0.0
    )

    @cached_property
    def servo(self) -> Servo:
        """The cells' height control."""
        return Servo(self.position_gain, self.dead_band)
