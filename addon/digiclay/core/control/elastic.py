"""Elastic behaviour: a pressed pin yields like a spring and returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.interfaces import Measurement, Orders
from .bench import Bench
from .drive import Drive, TouchParameters, check_damping, drive, feeling_above
from .servo import locked_under_overload

__all__ = ["Elastic", "ElasticControl", "assembled"]

Floats = NDArray[np.float64]

#: Share of the felt force down to which a touched cell stays touched: its spring may press no harder.
STILL = 0.2


@dataclass(frozen=True)
class Elastic(TouchParameters):
    """Spring and damper under every pin."""

    stiffness: float = quantity(20.0, "stiffness of a cell's spring", unit="N/m", symbol="k", above=0.0)
    damping: float = quantity(5.0, "force over speed of a pressed pin", unit="N s/m", symbol="c", above=0.0)


@dataclass(frozen=True, eq=False)
class ElasticControl:
    """Controller of the elastic behaviour for a bed.

    Pressed: ``c dH/dt = k (H_0 - H) - F``. Left alone: back to rest, ``dH/dt = (H_0 - H) / τ_s``.
    """

    parameters: Elastic
    actuator: Actuator
    drive: Drive

    name = "elastic"
    rows = 0

    def begin(self) -> None:
        """Nothing to remember."""

    def attend(self, memory: None, touched: Measurement) -> tuple[None, None]:
        """Ask for no more than the cells near the finger and those that move; see `interfaces.Controller`."""
        return memory, None

    def command(self, memory: None, seen: Measurement) -> tuple[None, Orders]:
        """Let pressed cells give way, and the others spring back; see `interfaces.Controller`."""
        known, rest = self.parameters, self.actuator.rest_height
        error = rest - seen.height
        pressed = seen.force >= known.felt_force * np.where(seen.mode == Mode.SPRING, STILL, 1.0)
        giving = (known.stiffness * error - seen.force) / known.damping
        command = self.drive.at_speed(np.where(pressed, giving, self.drive.approach(error)))
        command = locked_under_overload(command, seen.force, self.drive.lift)
        mode = np.where(pressed, np.int8(Mode.SPRING), np.int8(Mode.REST))
        return memory, Orders(np.full(seen.height.size, rest), mode, command)


def assembled(parameters: Elastic, bench: Bench) -> ElasticControl:
    """Put the elastic behaviour together for a device."""
    check_damping(parameters.damping, bench.cell, bench.period, parameters.stiffness)
    parameters = feeling_above(bench.force_floor, parameters)
    return ElasticControl(parameters, bench.cell.actuator, drive(parameters, bench.cell, bench.period))
