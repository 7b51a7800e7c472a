"""Shape display: given heights for all cells, three methods of refresh, handover to a control method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Controller, Measurement
from ..model.layout import Disc, Grid
from ..shapes.request import Shape
from .device_info import DeviceInfo
from .drive import Drive, DriveParameters, make_drive
from .named_shapes import FILE, check_shape, evaluate_shape, read_values


class Move(NamedTuple):
    """Move of a refresh: rows `first` to `last` go a share of the distance from rest to the shape."""

    first: int
    last: int
    share: float


class Progress(NamedTuple):
    """Memory of the controller: current move and its number of periods."""

    move: int = 0
    periods: int = 0


@dataclass(frozen=True)
class ShapeDisplay(DriveParameters):
    """Displayed shape and its refresh."""

    shape: str = quantity("dome", "displayed shape: its name, or a file .npy of heights, m")
    amplitude: float = quantity(
        10e-3, "height of a named shape over the bed at rest", unit="m", symbol="h_s",
        at_least=-100.0, at_most=100.0,
    )  # fmt: skip
    refresh: str = quantity(
        "one_time",
        "method of refresh",
        source="Zhu 2005",
        choices=("one_time", "gradual", "approximate_gradual"),
    )
    surfaces: int = quantity(
        5, "number of intermediate surfaces of a gradual refresh, including the last", symbol="n_s",
        at_least=1, at_most=1000,
    )  # fmt: skip
    patience: float = quantity(2.0, "time limit of a move", unit="s", symbol="t_p", above=0.0)

    def check(self) -> None:
        """The shape has a name, or is a file."""
        check_shape("ShapeDisplay", "shape", self.shape)

    def moves(self, rows: int) -> tuple[Move, ...]:
        """Return the moves of a refresh of a bed with so many rows.

        *one_time*: row by row, each in one move. *gradual*: row by row to the first intermediate
        surface, row by row to the next... *approximate_gradual*: all rows at once, from surface to surface.
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

    A move is over when its cells are within the dead band of their heights, or the patience is over.
    While there are moves all cells take part; afterwards those that stand at their heights are let go.

    Attributes
    ----------
    heights : ndarray (n,)
        Of the shape, m.
    patience : int
        Control periods.
    whole : Disc
        That holds the bed, m.
    """

    parameters: ShapeDisplay
    grid: Grid
    actuator: Actuator
    drive: Drive
    heights: Floats
    moves: tuple[Move, ...]
    patience: int
    whole: Disc

    name = "shape_display"
    rows = 0

    def begin(self) -> Progress:
        """Return the memory before a session."""
        return Progress()

    def locate(self, memory: Progress, touched: Measurement) -> tuple[Progress, Disc | None]:
        """Request all cells during the moves; see `Controller`."""
        return memory, self.whole if memory.move < len(self.moves) else None

    def command(self, memory: Progress, seen: Measurement) -> tuple[Progress, Commands]:
        """Set the heights of the move under way, and command every cell; see `Controller`."""
        target = seen.target
        if memory.move < len(self.moves):
            memory, target = self._make_moves(memory, seen)
        error = target - seen.height
        command = self.drive.command(self.drive.approach(error), seen.force)
        mode = self.drive.mark_formed(target, self.actuator.rest_height)
        np.putmask(mode, np.abs(error) > self.parameters.dead_band, np.int8(Mode.BLISTER))
        return memory, Commands(target, mode, command)

    def _make_moves(self, memory: Progress, seen: Measurement) -> tuple[Progress, Floats]:
        """Return the progress and the targets of the move under way; on to the next if it is over."""
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


def build(parameters: ShapeDisplay, device: DeviceInfo) -> ShapeDisplayControl:
    """Put shape display together, of a scene's shape first; ParameterError when it leaves the stroke."""
    actuator, grid = device.cell.actuator, device.grid
    if device.heights is not None:
        heights = device.heights
    elif parameters.shape.endswith(FILE):
        heights = read_values("shape", parameters.shape, grid, 0.0, actuator.stroke, "m")
    else:
        heights = actuator.rest_height + parameters.amplitude * evaluate_shape(parameters.shape, grid)
        low, high = float(heights.min()), float(heights.max())
        if low < 0.0 or high > actuator.stroke:
            rule = f"must keep the shape between 0 and the stroke, {actuator.stroke:g} m"
            raise ParameterError("control", "amplitude", rule, f"heights from {low:.6g} m to {high:.6g} m")
    return ShapeDisplayControl(
        parameters,
        grid,
        actuator,
        make_drive(parameters, device.cell, device.period),
        heights,
        parameters.moves(grid.layout.rows),
        math.ceil(parameters.patience / device.period),
        (0.0, 0.0, float(np.hypot(grid.x, grid.y).max())),
    )


class Handed(NamedTuple):
    """Memory of both: progress of the display, and memory of the control method."""

    display: Progress
    method: Any

    @property
    def losses(self) -> int | None:
        """Number of losses of the method, where it counts them."""
        return getattr(self.method, "losses", None)


@dataclass(frozen=True, eq=False)
class Handover:
    """Display, then control method; without a method the shape stays.

    Attributes
    ----------
    raised : ndarray (n,) or None
        Heights of the shape above the bed at rest, m, for a method whose cells go back to rest: it
        sees the bed without them, so that the shape is what its cells go back to.
    """

    display: ShapeDisplayControl
    method: Controller | None
    raised: Floats | None

    @property
    def name(self) -> str:
        """The method's name; the display's where there is none."""
        return self.method.name if self.method else self.display.name

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.method.rows if self.method else 0

    def begin(self) -> Handed:
        """Return the memory before a session."""
        return Handed(self.display.begin(), self.method.begin() if self.method else None)

    def is_displayed(self, memory: Handed) -> bool:
        """Return whether the shape stands, and the method has taken over."""
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
        """Return the bed without the shape, for a method whose cells go back to rest."""
        if self.raised is None:
            return seen
        raised = self.raised.take(seen.cells)
        return seen._replace(height=seen.height - raised, target=seen.target - raised)


def make_handover(shape: Shape, device: DeviceInfo, method: Controller | None, *, recovers: bool) -> Handover:
    """Put a shape's display in front of a method; `recovers`: whether the method's cells go back to rest."""
    assert device.heights is not None
    # As quick as a display is by itself, and never quicker than its control period allows.
    settling = max(DriveParameters().settling_time, 2.0 * device.period)
    parameters = ShapeDisplay(
        refresh=shape.refresh, surfaces=shape.surfaces, patience=shape.patience, settling_time=settling
    )
    raised = device.heights - device.cell.actuator.rest_height if recovers else None
    return Handover(build(parameters, device), method, raised)
