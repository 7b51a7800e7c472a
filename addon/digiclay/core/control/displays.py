"""Displays: a commanded field of forces under the fingertip, or heights of all cells, with three refreshes.

After a display of heights a control method takes over (`Handover`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Floats
from ..base.errors import ParameterError
from ..base.modes import BLISTER, FORCE_FOLLOW, REST
from ..base.quantity import quantity
from ..files.formats import map_array
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Controller, Measurement, Memory, count_losses
from ..model.layout import Disc, Grid
from ..shapes.request import Shape
from .device_info import DeviceInfo, check_floor
from .pin_motion import (
    CellwiseControl,
    MotionParameters,
    PinMotion,
    TouchParameters,
    check_damping,
    make_pin_motion,
    raise_felt_force,
)
from .servo import declare_again, take_cells

#: How the name of a file of values ends.
FILE = ".npy"


#: Values from -1 to 1 over the square bed -1 to 1, in x and y.
SHAPES: dict[str, Callable[[Floats, Floats], Floats]] = {
    "dome": lambda x, y: np.maximum(1.0 - x * x - y * y, 0.0),
    "saddle": lambda x, y: x * x - y * y,
    "wave": lambda x, y: np.sin(2.0 * math.pi * x),
    "ripple": lambda x, y: np.cos(3.0 * math.pi * np.hypot(x, y)),
    # A ring wall, 1 high at radius 0.6, around a hollow of depth 0.6.
    "crater": lambda x, y: (
        np.exp(-(((np.hypot(x, y) - 0.6) / 0.18) ** 2))
        - 0.6 * np.exp(-((np.hypot(x, y) / 0.3) ** 2))
    ),
    "pyramid": lambda x, y: 1.0 - np.maximum(np.abs(x), np.abs(y)),
    "ramp": lambda x, y: x,
    "flat": lambda x, y: 0.0 * x,
}


def check_shape(owner: str, field: str, shape: str) -> None:
    """Refuse other than a shape's name or a file; `owner`, `field`: of the message."""
    if shape not in SHAPES and not shape.endswith(FILE):
        rule = f"must be one of {', '.join(SHAPES)}, or a file {FILE}"
        raise ParameterError(owner, field, rule, repr(shape))


def evaluate_shape(shape: str, grid: Grid) -> Floats:
    """Return the values of a named shape for all cells of a bed, (n,), whose extent is the shape's square."""
    # A bed of a single row or column has no extent.
    middle_x, middle_y = (
        values / (float(np.abs(values).max()) or 1.0) for values in (grid.x, grid.y)
    )
    return SHAPES[shape](middle_x, middle_y)


def read_values(field: str, path: str, grid: Grid, low: float, high: float, unit: str) -> Floats:
    """Return values for all cells, (n,), from `low` to `high`, of a file (rows, columns), or refuse it."""
    # The first row lies at the lowest y; the path is relative to where the command runs.
    plan = grid.layout
    try:
        read = map_array(Path(path))
        shape = read.shape
        # Only what fits the bed is read.
        values = np.asarray(read if shape == (plan.rows, plan.columns) else 0.0, dtype=np.float64)
    except OSError as error:
        rule, why = "must be a file that can be read", error.strerror or "not an array"
        raise ParameterError("control", field, rule, f"{path}: {why}") from None
    except (ValueError, TypeError):
        rule = "must be a file that holds one array of numbers"
        raise ParameterError("control", field, rule, path) from None
    if values.shape != (plan.rows, plan.columns):
        rule = f"must hold an array of the bed's {plan.rows} x {plan.columns} cells"
        shown = " x ".join(map(str, shape)) or "a single number"
        raise ParameterError("control", field, rule, f"{path}: {shown}")
    wrong = values[~((values >= low) & (values <= high))]
    if wrong.size:
        rule = f"must hold values from {low:g} to {high:g} {unit}"
        raise ParameterError("control", field, rule, f"{path}: {wrong[0]:g} {unit}")
    return values.ravel()


@dataclass(frozen=True, eq=False, repr=False)
class ForceDisplay(TouchParameters):
    """Field of forces, and the motion of the cells."""

    field: str = quantity("wave", "shape of the field: its name, or a file .npy of forces, N")
    force: float = quantity(0.05, "mean force of a cell", unit="N", symbol="F_m", above=0.0)
    contrast: float = quantity(
        0.5,
        "variation of a named field, as a share of the mean",
        symbol="κ",
        at_least=0.0,
        at_most=1.0,
    )
    damping: float = quantity(
        5.0, "force deviation per speed of its correction", unit="N s/m", symbol="c", above=0.0
    )
    rise: float = quantity(
        5e-3,
        "largest height above rest of a following pin",
        unit="m",
        symbol="h_rise",
        at_least=0.0,
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

    A cell that feels the fingertip: ``c dH/dt = F_com - F``, up to `rise` above rest; a released
    one returns to rest. Row of a cell: periods without force. `field`: F_com of all cells, (n[,
    b]), N.
    """

    parameters: ForceDisplay
    period: float
    field: Floats

    rows = 1

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Control the force of touched cells and the height of the others; see `Controller`."""
        gains, rest = self.parameters, self.actuator.rest_height
        asked = take_cells(self.field, seen.cells)
        pressed = seen.force >= gains.felt_force
        alone = np.where(pressed, 0.0, seen.own[0] + 1.0)
        lasting = (seen.mode == FORCE_FOLLOW) & (alone * self.period <= gains.release_time + TIE)
        felt = pressed | lasting
        seen.own[0] = np.where(felt, alone, 0.0)
        limit = np.minimum(rest + gains.rise, self.actuator.stroke)
        pressing = np.minimum(
            (asked - seen.force) / gains.damping, (limit - seen.height) / self.motion.settling_time
        )
        speed = np.where(felt, pressing, self.motion.approach(rest - seen.height))
        mode = np.where(felt, FORCE_FOLLOW, REST)
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.motion.command(speed, seen.force))


def make_force_display(parameters: ForceDisplay, device: DeviceInfo) -> ForceDisplayControl:
    """Put force display together; ParameterError when pins cannot press or feel the field."""
    check_damping(parameters.damping, device.cell, device.period)
    check_floor(parameters.force, "force", parameters.force, device.force_floor)
    parameters = raise_felt_force(device.force_floor, parameters)
    if parameters.field.endswith(FILE):
        field = read_values(
            "field", parameters.field, device.grid, parameters.felt_force, device.lift, "N"
        )
    else:
        field = parameters.force * (
            1.0 + parameters.contrast * evaluate_shape(parameters.field, device.grid)
        )
        if field.max() >= device.lift:
            rule = f"must keep the field below what a pin can press, {device.lift:.3g} N"
            raise ParameterError("control", "force", rule, f"{field.max():.3g} N at its largest")
        if field.min() < parameters.felt_force:
            rule = (
                f"must keep the field at or above control.felt_force, {parameters.felt_force:g} N"
            )
            raise ParameterError(
                "control", "contrast", rule, f"{field.min():.3g} N at its smallest"
            )
    motion = make_pin_motion(parameters, device.cell, device.period)
    return ForceDisplayControl(parameters, device.cell.actuator, motion, device.period, field)


class Move(NamedTuple):
    """Move of a refresh: rows `first` to `last` go a share of the distance from rest to the shape."""

    first: int
    last: int
    share: float


class Progress(NamedTuple):
    """Memory of the controller: current move and its number of periods."""

    move: int = 0
    periods: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class ShapeDisplay(MotionParameters):
    """Displayed shape and its refresh."""

    shape: str = quantity("dome", "displayed shape: its name, or a file .npy of heights, m")
    amplitude: float = quantity(
        10e-3,
        "height of a named shape over the bed at rest",
        unit="m",
        symbol="h_s",
        at_least=-100.0,
        at_most=100.0,
    )
    refresh: str = quantity(
        "one_time",
        "method of refresh",
        source="Zhu 2005",
        choices=("one_time", "gradual", "approximate_gradual"),
    )
    surfaces: int = declare_again(Shape, "surfaces")
    patience: float = declare_again(Shape, "patience")

    def check(self) -> None:
        """The shape has a name, or is a file."""
        check_shape("ShapeDisplay", "shape", self.shape)

    def moves(self, rows: int) -> tuple[Move, ...]:
        """Return the moves of a refresh of a bed with so many rows.

        *one_time*: row by row, each in one move. *gradual*: row by row to the first intermediate
        surface, row by row to the next... *approximate_gradual*: all rows at once, from surface to
        surface.
        """
        if self.refresh == "one_time":
            return tuple(Move(row, row, 1.0) for row in range(rows))
        shares = [(i + 1) / self.surfaces for i in range(self.surfaces)]
        if self.refresh == "gradual":
            return tuple(Move(row, row, share) for share in shares for row in range(rows))
        return tuple(Move(0, rows - 1, share) for share in shares)


@dataclass(frozen=True, eq=False)
class ShapeDisplayControl:
    """Controller of the shape display for a bed.

    A move ends when its cells are within the dead band of their heights, or after the patience. All
    cells are active during the moves; afterwards only those that have not arrived.
    """

    parameters: ShapeDisplay
    grid: Grid
    actuator: Actuator
    motion: PinMotion
    heights: Floats
    """(n,): Of the shape, m."""
    moves: tuple[Move, ...]
    patience: int
    """Control periods."""
    whole: Disc
    """Disc around the bed, m."""

    rows = 0

    def begin(self) -> Progress:
        """Return the memory before a session."""
        return Progress()

    def locate(self, memory: Progress, touched: Measurement) -> tuple[Progress, Disc | None]:
        """Request all cells during the moves; see `Controller`."""
        return memory, self.whole if memory.move < len(self.moves) else None

    def command(self, memory: Progress, seen: Measurement) -> tuple[Progress, Commands]:
        """Set the heights of the current move, and command every cell; see `Controller`."""
        target = seen.target
        if memory.move < len(self.moves):
            memory, target = self._make_moves(memory, seen)
        error = target - seen.height
        command = self.motion.command(self.motion.approach(error), seen.force)
        mode = self.motion.mark_formed(target, self.actuator.rest_height)
        np.putmask(mode, np.abs(error) > self.parameters.dead_band, BLISTER)
        return memory, Commands(target, mode, command)

    def _make_moves(self, memory: Progress, seen: Measurement) -> tuple[Progress, Floats]:
        """Return the progress and the targets of the current move, or of the next one if it has ended."""
        cells, rest = seen.cells, self.actuator.rest_height
        row, target = cells // self.grid.layout.columns, seen.target.copy()
        goal = self.heights.take(cells)
        while memory.move < len(self.moves):
            first, last, share = self.moves[memory.move]
            mine = (row >= first) & (row <= last)
            np.putmask(target, mine, rest + share * (goal - rest))
            error = np.abs(target - seen.height)[mine].max(initial=0.0)
            if error > self.parameters.dead_band and memory.periods < self.patience:
                return memory._replace(periods=memory.periods + 1), target
            memory = Progress(memory.move + 1)
        return memory, target


def make_shape_display(parameters: ShapeDisplay, device: DeviceInfo) -> ShapeDisplayControl:
    """Return the shape display, of a scene's shape if it has one; ParameterError beyond the stroke."""
    actuator, grid = device.cell.actuator, device.grid
    if device.heights is not None:
        heights = device.heights
    elif parameters.shape.endswith(FILE):
        heights = read_values("shape", parameters.shape, grid, 0.0, actuator.stroke, "m")
    else:
        heights = actuator.rest_height + parameters.amplitude * evaluate_shape(
            parameters.shape, grid
        )
        low, high = float(heights.min()), float(heights.max())
        if low < 0.0 or high > actuator.stroke:
            rule = f"must keep the shape between 0 and the stroke, {actuator.stroke:g} m"
            raise ParameterError(
                "control", "amplitude", rule, f"heights from {low:.6g} m to {high:.6g} m"
            )
    motion = make_pin_motion(parameters, device.cell, device.period)
    moves = parameters.moves(grid.layout.rows)
    patience = math.ceil(parameters.patience / device.period)
    whole = 0.0, 0.0, float(np.hypot(grid.x, grid.y).max())
    return ShapeDisplayControl(parameters, grid, actuator, motion, heights, moves, patience, whole)


def build(
    parameters: ForceDisplay | ShapeDisplay, device: DeviceInfo
) -> ForceDisplayControl | ShapeDisplayControl:
    """Put the display with these parameters together for a device."""
    if isinstance(parameters, ForceDisplay):
        return make_force_display(parameters, device)
    return make_shape_display(parameters, device)


class Handed(NamedTuple):
    """Memory of both: progress of the display, and memory of the control method."""

    display: Progress
    method: Any

    @property
    def losses(self) -> int | None:
        """Number of losses of the method, where it counts them."""
        return count_losses(self.method)


@dataclass(frozen=True, eq=False)
class Handover:
    """Display, then control method; without a method the shape stays."""

    display: ShapeDisplayControl
    method: Controller | None
    raised: Floats | None
    """(n,): Heights of the shape above the bed at rest, m, for a method whose cells return to rest: it sees
    the bed without the shape, so that its cells return to the shape."""

    @property
    def rows(self) -> int:
        """State rows per cell."""
        return self.method.rows if self.method else 0

    def begin(self) -> Handed:
        """Return the memory before a session."""
        return Handed(self.display.begin(), self.method.begin() if self.method else None)

    def is_displayed(self, memory: Handed) -> bool:
        """Return whether the display has ended, and the method has taken over."""
        return memory.display.move >= len(self.display.moves)

    def locate(self, memory: Handed, touched: Measurement) -> tuple[Handed, Disc | None]:
        """Delegate to the display or the method; see `Controller`."""
        if not self.is_displayed(memory):
            progress, disc = self.display.locate(memory.display, touched)
            return memory._replace(display=progress), disc
        if self.method is None:
            return memory, None
        remembered, disc = self.method.locate(memory.method, self._subtract_shape(touched))
        return memory._replace(method=remembered), disc

    def command(self, memory: Handed, seen: Measurement) -> tuple[Handed, Commands]:
        """Delegate to the display or the method; see `Controller`."""
        if self.method is None or not self.is_displayed(memory):
            progress, orders = self.display.command(memory.display, seen)
            return memory._replace(display=progress), orders
        remembered, orders = self.method.command(memory.method, self._subtract_shape(seen))
        if self.raised is not None:
            target = orders.target + self.raised.take(seen.cells)
            orders = orders._replace(target=target)
        return memory._replace(method=remembered), orders

    def _subtract_shape(self, seen: Measurement) -> Measurement:
        """Return the bed without the shape, for a method whose cells return to rest."""
        if self.raised is None:
            return seen
        raised = self.raised.take(seen.cells)
        return seen._replace(height=seen.height - raised, target=seen.target - raised)


def make_handover(
    shape: Shape, device: DeviceInfo, method: Controller | None, *, recovers: bool
) -> Handover:
    """Return a shape's display followed by a method; `recovers`: whether its cells return to rest."""
    assert device.heights is not None
    # As fast as a display alone, within the limit of the control period.
    settling = max(MotionParameters().settling_time, 2.0 * device.period)
    parameters = ShapeDisplay(
        refresh=shape.refresh,
        surfaces=shape.surfaces,
        patience=shape.patience,
        settling_time=settling,
    )
    raised = device.heights - device.cell.actuator.rest_height if recovers else None
    return Handover(make_shape_display(parameters, device), method, raised)
