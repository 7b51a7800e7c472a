"""Height control of the tracking methods, and the lock of overloaded cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import Constants, Floats, any_true
from ..base.quantity import quantity
from .methods import ControlParameters


def declare_dead_band(default: float = 10e-6) -> Any:
    """Declare the parameter that every height control has."""
    return quantity(default, "height error without a command", unit="m", symbol="δ", at_least=0.0)


@dataclass(frozen=True)
class Tracking(ControlParameters):
    """Common part of the tracking methods: height control of cells, direction of the fingertip."""

    position_gain: float = quantity(
        500.0, "proportional gain of height", unit="1/m", symbol="K_p", at_least=0.0
    )
    dead_band: float = declare_dead_band()
    travel: float = quantity(
        1.5e-3, "distance traveled that determines the direction", unit="m", symbol="d_t", above=0.0
    )
    behind: float = quantity(
        -0.3, "cosine below which a cell lies behind the fingertip", symbol="cos_f", at_least=-1.0, below=0.0
    )

    def command(self, target: Floats, height: Floats) -> Floats:
        """Return ``K_com = K_p (H_com - H)``, limited to [-1, 1], zero within the dead band.

        The flow goes with the square of the opening, so a cell comes in like 1/t and would
        never be at rest without the dead band.

        `target`, `height` (m,) or (m, b), commanded and measured, m.
        """
        gain, band, most, least, none = self._constants[target.shape]
        error = target - height
        command: Floats = error * gain
        np.minimum(command, most, out=command)
        np.maximum(command, least, out=command)
        np.abs(error, error)
        np.putmask(command, error <= band, none)
        return command

    @cached_property
    def _constants(self) -> Constants:
        """What `command` is made with: gain, 1/m; dead band, m; the command's bounds; no command."""
        return Constants((self.position_gain, self.dead_band, 1.0, -1.0, 0.0))


def lock_overloaded(command: Floats, force: Floats, limit: Any) -> Floats:
    """Lock cells that are pressed harder than the high reservoir can lift, in place; return the commands.

    Opening to it would lower them, and a proportional controller would open further.

    `command` (m,) or (m, b); `force` (m,) or (m, b), N; `limit` (b,), force the high reservoir can lift,
    ``P_high A_a``, N.
    """
    overload = force >= limit
    if any_true(overload):
        overload &= command > 0.0
        np.putmask(command, overload, 0.0)
    return command
