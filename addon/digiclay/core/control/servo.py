"""Proportional control of a cell's height."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import any_true, constants
from ..base.quantity import Parameters, quantity

__all__ = ["Servo", "locked_under_overload"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Servo(Parameters):
    """``K_com = K_p (H_com - H)``, limited to [-1, 1], zero within a dead band.

    The flow goes with the square of the opening, so a cell comes in like 1/t and would
    never be at rest without the dead band.
    """

    gain: float = quantity(500.0, "proportional gain", unit="1/m", symbol="K_p", at_least=0.0)
    dead_band: float = quantity(10e-6, "height error without a command", unit="m", symbol="δ", at_least=0.0)

    def command(self, target: Floats, height: Floats) -> Floats:
        """Return valve commands, shape (n,), for commanded and measured heights, m."""
        gain, band, most, least, none = constants((self.gain, self.dead_band, 1.0, -1.0, 0.0), target.shape)
        error = target - height
        command: Floats = error * gain
        np.minimum(command, most, out=command)
        np.maximum(command, least, out=command)
        np.abs(error, error)
        np.putmask(command, error <= band, none)
        return command


def locked_under_overload(command: Floats, force: Floats, limit: float) -> Floats:
    """Return commands with cells locked that are pressed harder than the high reservoir can lift.

    Opening to it would lower them, and a proportional controller would open further.

    Parameters
    ----------
    command : ndarray (n,)
    force : ndarray (n,)
        N.
    limit : float
        Force the high reservoir can lift, ``P_high A_a``, N.
    """
    overload = force >= constants((limit,), force.shape)[0]
    if not any_true(overload):
        return command
    return np.where(overload & (command > 0.0), 0.0, command)
