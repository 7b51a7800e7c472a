"""Force display: a commanded field of forces under the fingertip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ParameterError
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.interfaces import Measurement, Orders
from ..model.layout import Grid
from .bench import Bench
from .drive import Drive, TouchParameters, check_damping, drive, feeling_above
from .named_shapes import FILE, check_shape, from_file, named
from .neighbours import cells_at
from .noise_floor import check_told
from .servo import locked_under_overload

__all__ = ["ForceDisplay", "ForceDisplayControl", "assembled"]

Floats = NDArray[np.float64]


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
class ForceDisplayControl:
    """Controller of the force display for a bed.

    A cell that feels the finger: ``c dH/dt = F_com - F``, up to `rise` above rest. Let go: back to rest.
    A cell remembers for how many periods it has felt nothing.

    Attributes
    ----------
    field : ndarray (n,)
        F_com of every cell of the bed, N.
    """

    parameters: ForceDisplay
    grid: Grid
    actuator: Actuator
    drive: Drive
    period: float
    field: Floats

    name = "force_display"
    rows = 1

    def begin(self) -> None:
        """Nothing to remember but the cells' own rows."""

    def attend(self, memory: None, touched: Measurement) -> tuple[None, None]:
        """Ask for no more than the cells near the finger and those that move; see `interfaces.Controller`."""
        return memory, None

    def command(self, memory: None, seen: Measurement) -> tuple[None, Orders]:
        """Control the force of touched cells and the height of the others; see `interfaces.Controller`."""
        known, rest = self.parameters, self.actuator.rest_height
        asked = self.field.take(cells_at(self.grid, seen.place))
        pressed = seen.force >= known.felt_force
        alone = np.where(pressed, 0.0, seen.own[0] + 1.0)
        kept = (seen.mode == Mode.FORCE_FOLLOW) & (alone * self.period <= known.release_time)
        felt = pressed | kept
        seen.own[0] = np.where(felt, alone, 0.0)
        limit = min(rest + known.rise, self.actuator.stroke)
        pressing = np.minimum(
            (asked - seen.force) / known.damping, (limit - seen.height) / self.drive.settling_time
        )
        speed = np.where(felt, pressing, self.drive.approach(rest - seen.height))
        command = locked_under_overload(self.drive.at_speed(speed), seen.force, self.drive.lift)
        mode = np.where(felt, np.int8(Mode.FORCE_FOLLOW), np.int8(Mode.REST))
        return memory, Orders(np.full(seen.height.size, rest), mode, command)


def assembled(parameters: ForceDisplay, bench: Bench) -> ForceDisplayControl:
    """Put force display together for a device.

    Raises
    ------
    ParameterError
        When the field asks for more than a pin can press or less than it feels, or its file cannot be used.
    """
    check_damping(parameters.damping, bench.cell, bench.period)
    check_told(parameters.force, "force", parameters.force, bench.force_floor)
    parameters = feeling_above(bench.force_floor, parameters)
    if parameters.field.endswith(FILE):
        field = from_file("field", parameters.field, bench.grid, parameters.felt_force, bench.lift, "N")
    else:
        field = parameters.force * (1.0 + parameters.contrast * named(parameters.field, bench.grid))
        if field.max() >= bench.lift:
            rule = f"must keep the field below what a pin can press, {bench.lift:.3g} N"
            raise ParameterError("control", "force", rule, f"{field.max():.3g} N at its largest")
        if field.min() < parameters.felt_force:
            rule = f"must keep the field at or above control.felt_force, {parameters.felt_force:g} N"
            raise ParameterError("control", "contrast", rule, f"{field.min():.3g} N at its smallest")
    return ForceDisplayControl(
        parameters,
        bench.grid,
        bench.cell.actuator,
        drive(parameters, bench.cell, bench.period),
        bench.period,
        field,
    )
