"""Handover from the display of a shape to the control method of the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ..base.arrays import Floats
from ..model.control_interface import Commands, Controller, Measurement
from ..shapes.request import Shape
from .device_info import DeviceInfo
from .drive import DriveParameters
from .shape_display import Progress, ShapeDisplay, ShapeDisplayControl, build


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
    display : ShapeDisplayControl
    method : Controller or None
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

    def locate(
        self, memory: Handed, touched: Measurement
    ) -> tuple[Handed, tuple[float, float, float] | None]:
        """Let the one whose turn it is look at the touched cells; see `Controller`."""
        if not self.is_displayed(memory):
            progress, disc = self.display.locate(memory.display, touched)
            return memory._replace(display=progress), disc
        if self.method is None:
            return memory, None
        known, disc = self.method.locate(memory.method, self._subtract_shape(touched))
        return memory._replace(method=known), disc

    def command(self, memory: Handed, seen: Measurement) -> tuple[Handed, Commands]:
        """Let the one whose turn it is command the cells; see `Controller`."""
        if self.method is None or not self.is_displayed(memory):
            progress, orders = self.display.command(memory.display, seen)
            return memory._replace(display=progress), orders
        known, orders = self.method.command(memory.method, self._subtract_shape(seen))
        if self.raised is not None:
            target = orders.target + self.raised.take(seen.cells)
            orders = Commands(target, orders.mode, orders.command)
        return memory._replace(method=known), orders

    def _subtract_shape(self, seen: Measurement) -> Measurement:
        """Return what the method is to see: the bed without the shape, where its cells go back to rest."""
        if self.raised is None:
            return seen
        raised = self.raised.take(seen.cells)
        return seen._replace(height=seen.height - raised, target=seen.target - raised)


def make_handover(shape: Shape, device: DeviceInfo, method: Controller | None, *, recovers: bool) -> Handover:
    """Put a shape's display in front of a method.

    `shape`: says how the surface gets there; `device`: with the heights to display; `recovers`: whether the
    method's cells go back to rest.
    """
    assert device.heights is not None
    # As quick as a display is by itself, and never quicker than its control period allows.
    settling = max(DriveParameters().settling_time, 2.0 * device.period)
    known = ShapeDisplay(
        refresh=shape.refresh, surfaces=shape.surfaces, patience=shape.patience, settling_time=settling
    )
    raised = device.heights - device.cell.actuator.rest_height if recovers else None
    return Handover(build(known, device), method, raised)
