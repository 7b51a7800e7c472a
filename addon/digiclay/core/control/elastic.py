"""Elastic behavior: a pressed pin yields like a spring and returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Measurement
from .device_info import DeviceInfo
from .drive import CellwiseControl, TouchParameters, check_damping, make_drive, raise_felt_force

#: Share of the felt force down to which a touched cell stays touched: its spring may press no harder.
STILL = 0.2


@dataclass(frozen=True)
class Elastic(TouchParameters):
    """Spring and damper under every pin."""

    stiffness: float = quantity(20.0, "stiffness of a cell's spring", unit="N/m", symbol="k", above=0.0)
    damping: float = quantity(5.0, "force over speed of a pressed pin", unit="N s/m", symbol="c", above=0.0)


@dataclass(frozen=True, eq=False)
class ElasticControl(CellwiseControl):
    """Controller of the elastic behavior for a bed.

    Pressed: ``c dH/dt = k (H_0 - H) - F``. Left alone: back to rest, ``dH/dt = (H_0 - H) / τ_s``.
    """

    parameters: Elastic

    name = "elastic"

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Let pressed cells give way, and the others spring back; see `Controller`."""
        known, rest = self.parameters, self.actuator.rest_height
        error = rest - seen.height
        pressed = seen.force >= known.felt_force * np.where(seen.mode == Mode.SPRING, STILL, 1.0)
        giving = (known.stiffness * error - seen.force) / known.damping
        speed = np.where(pressed, giving, self.drive.approach(error))
        mode = np.where(pressed, np.int8(Mode.SPRING), np.int8(Mode.REST))
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.drive.command(speed, seen.force))


def build(parameters: Elastic, device: DeviceInfo) -> ElasticControl:
    """Put the elastic behavior together for a device."""
    check_damping(parameters.damping, device.cell, device.period, parameters.stiffness)
    parameters = raise_felt_force(device.force_floor, parameters)
    return ElasticControl(
        parameters, device.cell.actuator, make_drive(parameters, device.cell, device.period)
    )
