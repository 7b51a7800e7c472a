"""Force display: a commanded field of forces under the fingertip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Measurement
from .device_info import DeviceInfo, check_floor
from .drive import CellwiseControl, TouchParameters, check_damping, make_drive, raise_felt_force
from .named_shapes import FILE, check_shape, evaluate_shape, read_values
from .servo import take_cells


@dataclass(frozen=True)
class ForceDisplay(TouchParameters):
    """Field of forces, and the motion of the cells."""

    field: str = quantity("wave", "shape of the field: its name, or a file .npy of forces, N")
    force: float = quantity(0.05, "mean force of a cell", unit="N", symbol="F_m", above=0.0)
    contrast: float = quantity(
        0.5, "variation of a named field, as a share of the mean", symbol="κ", at_least=0.0, at_most=1.0
    )
    damping: float = quantity(
        5.0, "force deviation over speed of its correction", unit="N s/m", symbol="c", above=0.0
    )
    rise: float = quantity(
        5e-3, "largest height above rest of a following pin", unit="m", symbol="h_rise", at_least=0.0
    )
    release_time: float = quantity(
        50e-3, "time without force until a cell is released", unit="s", symbol="t_r", at_least=0.0
    )

    def check(self) -> None:
        """The field has a name, or is a file."""
        check_shape("ForceDisplay", "field", self.field)


@dataclass(frozen=True, eq=False)
class ForceDisplayControl(CellwiseControl):
    """Controller of the force display for a bed.

    A cell that feels the fingertip: ``c dH/dt = F_com - F``, up to `rise` above rest. Let go: back to rest.
    A cell remembers for how many periods it has felt nothing. `field`: F_com of all cells, (n[, b]), N.
    """

    parameters: ForceDisplay
    period: float
    field: Floats

    name = "force_display"
    rows = 1

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Control the force of touched cells and the height of the others; see `Controller`."""
        gains, rest = self.parameters, self.actuator.rest_height
        asked = take_cells(self.field, seen.cells)
        pressed = seen.force >= gains.felt_force
        alone = np.where(pressed, 0.0, seen.own[0] + 1.0)
        kept = (seen.mode == Mode.FORCE_FOLLOW) & (alone * self.period <= gains.release_time)
        felt = pressed | kept
        seen.own[0] = np.where(felt, alone, 0.0)
        limit = np.minimum(rest + gains.rise, self.actuator.stroke)
        pressing = np.minimum(
            (asked - seen.force) / gains.damping, (limit - seen.height) / self.drive.settling_time
        )
        speed = np.where(felt, pressing, self.drive.approach(rest - seen.height))
        mode = np.where(felt, np.int8(Mode.FORCE_FOLLOW), np.int8(Mode.REST))
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.drive.command(speed, seen.force))


def build(parameters: ForceDisplay, device: DeviceInfo) -> ForceDisplayControl:
    """Put force display together; ParameterError when pins cannot press or feel the field."""
    check_damping(parameters.damping, device.cell, device.period)
    check_floor(parameters.force, "force", parameters.force, device.force_floor)
    parameters = raise_felt_force(device.force_floor, parameters)
    if parameters.field.endswith(FILE):
        field = read_values("field", parameters.field, device.grid, parameters.felt_force, device.lift, "N")
    else:
        field = parameters.force * (1.0 + parameters.contrast * evaluate_shape(parameters.field, device.grid))
        if field.max() >= device.lift:
            rule = f"must keep the field below what a pin can press, {device.lift:.3g} N"
            raise ParameterError("control", "force", rule, f"{field.max():.3g} N at its largest")
        if field.min() < parameters.felt_force:
            rule = f"must keep the field at or above control.felt_force, {parameters.felt_force:g} N"
            raise ParameterError("control", "contrast", rule, f"{field.min():.3g} N at its smallest")
    drive = make_drive(parameters, device.cell, device.period)
    return ForceDisplayControl(parameters, device.cell.actuator, drive, device.period, field)
