"""Control methods of one's own: the class they derive from, what they are shown, what they order.

An own method is one frozen dataclass: its fields are the parameters, its methods are pure functions. `begin`
returns the memory before a session, `locate` says which cells are to be commanded, and `command` turns
forces and heights into commanded heights or valve openings. Whoever needs more overrides `build`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Controller, Measurement
from .device_info import DeviceInfo, suppress_noise
from .drive import Drive, DriveParameters, make_drive

__all__ = [
    "Cells", "DeviceInfo", "Mode", "Orders", "OwnControl", "OwnMethod", "check_array", "check_modes",
    "quantity", "show_cells", "take_results",
]  # fmt: skip

#: The highest code of a mode; the lowest is 0.
HIGHEST = int(max(Mode))


class Cells(NamedTuple):
    """Cells as an own method sees them, m of them; which ones changes from period to period.

    All arrays are read-only.

    Attributes
    ----------
    x, y : ndarray (m,)
        Where they are, m.
    height, force : ndarray (m,)
        As measured, m and N.
    target : ndarray (m,)
        Height they were last commanded to, m.
    mode : ndarray (m,) of int8
        Their modes, see `Mode`.
    rows : ndarray (rows, m)
        What the method remembers of each cell, all 0 at first; see `OwnMethod.rows`.
    number : ndarray (m,) of int
        Their numbers in the bed.
    """

    x: Floats
    y: Floats
    height: Floats
    force: Floats
    target: Floats
    mode: NDArray[np.int8]
    rows: Floats
    number: NDArray[np.intp]


class Orders(NamedTuple):
    """Orders of an own method; a field that is None gets its default.

    Attributes
    ----------
    height : ndarray (m,) or None
        Commanded heights, m, limited to the stroke; by default those before.
    opening : ndarray (m,) or None
        Valve openings from -1 (down) to 1 (up), limited to these; by default those that take the pins to
        their commanded heights, with the time constant `settling_time`.
    mode : ndarray (m,) of int or None
        By default FORCE_FOLLOW where there is force, else HOLD at a formed height, else REST.
    rows : ndarray (rows, m) or None
        What is remembered of each cell; by default what was.
    """

    height: Any = None
    opening: Any = None
    mode: Any = None
    rows: Any = None


@dataclass(frozen=True)
class OwnMethod(DriveParameters):
    """Base of the control methods of one's own; a subclass is a frozen dataclass with fields of `quantity`.

    Its first line of documentation is what Blender shows of it. What is no field, below, a subclass may
    set to another value.
    """

    #: Numbers the method remembers of each cell, whether or not it is among the cells of a period.
    rows: ClassVar[int] = 0
    #: Defaults for the section [blister] where they differ; None: the method has no such section.
    blister: ClassVar[Mapping[str, float] | None] = None
    #: Whether cells go back to the height they had at rest: then a displayed shape is what they go back to.
    recovers: ClassVar[bool] = False

    reach: float = quantity(
        20e-3,
        "radius around the middle of the forces within which all cells are commanded",
        unit="m",
        symbol="r_reach",
        at_least=0.0,
    )

    def begin(self, device: DeviceInfo) -> Any:
        """Return the memory before a session: None, numbers, arrays, and (named) tuples of them."""

    def locate(
        self, memory: Any, touched: Cells, device: DeviceInfo
    ) -> tuple[Any, tuple[float, float, float] | None]:
        """Return memory and the disc x, y, radius of the cells to command, m; None: those that move.

        `memory`: from `begin`, or `command` a period before; `touched`: those the finger may touch.
        """
        force = suppress_noise(touched.force, device.force_floor)
        total = float(force.sum())
        if not self.reach or not total > 0.0:
            return memory, None
        return memory, (float(force.dot(touched.x)) / total, float(force.dot(touched.y)) / total, self.reach)

    def command(self, memory: Any, cells: Cells, device: DeviceInfo) -> tuple[Any, Orders]:
        """Return memory and orders for the cells of the disc and all that still move.

        `memory`: from `locate`; `device`: control period, cylinders, fluid and noise; see `DeviceInfo`.
        """
        raise NotImplementedError("command must be defined")

    def build(self, device: DeviceInfo) -> Controller:
        """Return the controller for a device; a method with a controller of its own overrides this."""
        return OwnControl(self, device, make_drive(self, device.cell, device.period))


@dataclass(frozen=True, eq=False)
class OwnControl:
    """Controller of an own method that orders heights or openings.

    Attributes
    ----------
    parameters : OwnMethod
    device : DeviceInfo
    drive : Drive
    """

    parameters: OwnMethod
    device: DeviceInfo
    drive: Drive

    name = "own"

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.parameters.rows

    def begin(self) -> Any:
        """Return the memory before a session."""
        return self.parameters.begin(self.device)

    def locate(self, memory: Any, touched: Measurement) -> Any:
        """Let the method say which cells it commands; see `Controller`."""
        return self.parameters.locate(memory, show_cells(touched), self.device)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Let the method order, and work out what it leaves open; see `Controller`."""
        given = self.parameters.command(memory, show_cells(seen), self.device)
        memory, orders = take_results(given, 2, "memory and orders")
        height, opening, mode, rows = _check_orders(orders, seen)
        actuator = self.device.cell.actuator
        target = np.clip(seen.target if height is None else height, 0.0, actuator.stroke)
        if opening is None:
            command = self.drive.command(self.drive.approach(target - seen.height), seen.force)
        else:
            command = np.clip(opening, -1.0, 1.0)
        if mode is None:
            formed = np.abs(target - actuator.rest_height) > self.parameters.dead_band
            touched = suppress_noise(seen.force, self.device.force_floor) > 0.0
            mode = np.where(touched, np.int8(Mode.FORCE_FOLLOW), formed.view(np.int8))
        if rows is not None:
            seen.own[:] = rows
        return memory, Commands(target, mode, command)


def show_cells(seen: Measurement) -> Cells:
    """Return what is measured of cells as an own method sees it: of the copies in `guarded`, read-only."""
    basis, rows = seen.quadratic_basis, seen.own[:]
    rows.flags.writeable = False
    return Cells(basis[1], basis[2], seen.height, seen.force, seen.target, seen.mode, rows, seen.cells)


def take_results(given: Any, count: int, wanted: str) -> Any:
    """Return the results of a function, a tuple of `count`, or raise the broken rule."""
    if not isinstance(given, tuple) or len(given) != count:
        got = f"{len(given)} results" if isinstance(given, tuple) else type(given).__name__
        raise TypeError(f"must return {('two', 'three')[count - 2]} results, {wanted} (got {got})")
    return given


def _check_orders(orders: Any, seen: Measurement) -> tuple[Any, Any, Any, Any]:
    """Return orders as arrays of the right shape and type, None where there are none; else TypeError."""
    if not isinstance(orders, Orders):
        raise TypeError(f"must return Orders as its second result (got {type(orders).__name__})")
    size = seen.height.shape
    modes = check_array(orders.mode, "mode", size, "iu")
    if modes is not None:
        modes = check_modes(modes)
    return (
        check_array(orders.height, "height", size),
        check_array(orders.opening, "opening", size),
        modes,
        check_array(orders.rows, "rows", seen.own.shape),
    )


def check_array(values: Any, name: str, shape: tuple[int, ...], kinds: str = "fiu") -> Any:
    """Return values as an array of a shape and kinds of numbers, or raise the rule; None stays None."""
    if values is None:
        return None
    array = np.asarray(values)
    if array.shape != shape:
        raise ValueError(f"must return {name} of the shape {shape} of the cells (got {array.shape})")
    if array.dtype.kind not in kinds:
        wanted = "real numbers" if "f" in kinds else "whole numbers"
        raise TypeError(f"must return {name} as {wanted} (got {array.dtype})")
    if "f" not in kinds:
        return array
    array = array.astype(np.float64, copy=False)
    if not math.isfinite(array.sum()):  # one call, where all is well
        finite = np.isfinite(array)
        if not finite.all():
            raise ValueError(f"must return {name} as finite numbers (got {array[~finite][0]})")
    return array


def check_modes(modes: NDArray[Any]) -> NDArray[np.int8]:
    """Return modes as they are stored; ValueError, with the rule, where one is none of `Mode`."""
    if modes.size and not (modes.min() >= 0 and modes.max() <= HIGHEST):
        raise ValueError(f"must return mode as codes of Mode, from 0 to {HIGHEST} (got {modes.max()})")
    return modes.astype(np.int8, copy=False)
