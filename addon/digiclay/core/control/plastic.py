"""Plastic behavior: a pin above its yield force gives way and keeps its lowest height."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import ParameterError
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Measurement
from .device_info import DeviceInfo, check_floor
from .drive import CellwiseControl, TouchParameters, check_damping, make_drive, raise_felt_force


@dataclass(frozen=True)
class Plastic(TouchParameters):
    """Bingham body under every pin: rigid up to a yield force, viscous above."""

    yield_force: float = quantity(0.03, "force above which a cell yields", unit="N", symbol="F_y", above=0.0)
    damping: float = quantity(
        5.0, "force above yield over speed of a sinking pin", unit="N s/m", symbol="c", above=0.0
    )

    def check(self) -> None:
        """The yield force is at least the felt force."""
        if not self.yield_force >= self.felt_force:
            rule = f"must be at least felt_force, {self.felt_force:g} N"
            raise ParameterError("Plastic", "yield_force", rule, f"{self.yield_force:g} N")


@dataclass(frozen=True, eq=False)
class PlasticControl(CellwiseControl):
    """Controller of the plastic behavior for a bed.

    Above yield: ``c dH/dt = -(F - F_y)``, and the height reached is kept as the cell's target. Below:
    the pin stays; left alone, it goes to the deepest height it was pressed to.
    """

    parameters: Plastic

    name = "plastic"

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Let cells give way that are pressed beyond yield, hold the others; see `Controller`."""
        known = self.parameters
        pressed = seen.force >= known.felt_force
        yielding = seen.force > known.yield_force
        target = np.where(yielding, np.minimum(seen.target, seen.height), seen.target)
        # A pin under the finger is not pushed back up: what it sank after yielding is felt as no force.
        back = self.drive.approach(target - seen.height)
        speed = np.where(pressed, np.minimum(back, 0.0), back)
        np.putmask(speed, yielding, (known.yield_force - seen.force) / known.damping)
        formed = np.abs(target - self.actuator.rest_height) > known.dead_band
        mode = np.where(formed, np.int8(Mode.HOLD), np.int8(Mode.REST))
        np.putmask(mode, pressed, np.int8(Mode.SPRING))
        np.putmask(mode, yielding, np.int8(Mode.FORCE_FOLLOW))
        return memory, Commands(target, mode, self.drive.command(speed, seen.force))


def build(parameters: Plastic, device: DeviceInfo) -> PlasticControl:
    """Put the plastic behavior together for a device."""
    check_damping(parameters.damping, device.cell, device.period)
    check_floor(parameters.yield_force, "yield_force", parameters.yield_force, device.force_floor)
    parameters = raise_felt_force(device.force_floor, parameters)
    return PlasticControl(
        parameters, device.cell.actuator, make_drive(parameters, device.cell, device.period)
    )
