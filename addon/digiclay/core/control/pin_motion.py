"""Pin motion by speed, height or force: common part of the behaviors.

The flow of a valve is proportional to the square of its opening, so that a height control
proportional in the opening converges like 1/t. Here the opening is computed from the requested
speed by the flow law of a pin without load, and heights converge exponentially.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..base.arrays import Floats, Modes
from ..base.errors import ParameterError
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Measurement
from ..model.physics import Cell
from .methods import ControlParameters
from .servo import BatchControl, Tracking, declare_again, lock_overloaded, mark_formed

#: Openings at which the speed is tabulated; between them it is interpolated.
OPENINGS = np.linspace(0.0, 1.0, 129)


@dataclass(frozen=True, eq=False, repr=False)
class MotionParameters(ControlParameters):
    """Parameters of the height control of every behavior."""

    settling_time: float = quantity(
        20e-3,
        "time constant of a free pin's approach to its height",
        unit="s",
        symbol="τ_s",
        above=0.0,
    )
    dead_band: float = declare_again(Tracking, "dead_band")


@dataclass(frozen=True, eq=False, repr=False)
class TouchParameters(MotionParameters):
    """Parameters of the behaviors that use the force on each cell."""

    felt_force: float = quantity(
        5e-3,
        "least force of a touched cell; at least five times the sensors' noise",
        unit="N",
        symbol="F_0",
        above=0.0,
    )


Touch = TypeVar("Touch", bound=TouchParameters)


def raise_felt_force(floor: float, parameters: Touch) -> Touch:
    """Return parameters whose `felt_force` is at least the noise floor, N; the same ones for a floor of 0."""
    return (
        replace(parameters, felt_force=max(parameters.felt_force, floor)) if floor else parameters
    )


@dataclass(frozen=True, eq=False)
class PinMotion:
    """Conversion of pin speeds to valve commands."""

    settling_time: float
    dead_band: float
    """Time constant of the approach to a height, s, and dead band of the error, m."""
    up: Floats
    down: Floats
    """(129,) or (129, b): Speeds of a pin without load at `OPENINGS`, towards each reservoir, m/s."""
    lift: float
    """Force the high reservoir can lift, N."""

    def command(self, speed: Floats, force: Floats) -> Floats:
        """Return valve commands for speeds, m/s, under forces, N; an overloaded pin is locked."""
        return lock_overloaded(self.open_for(speed), force, self.lift)

    def open_for(self, speed: Floats) -> Floats:
        """Return valve commands that move pins without load at speeds of shape (m[, b]), m/s, up positive."""
        size = np.abs(speed)
        return np.where(speed > 0.0, _look_up(size, self.up), -_look_up(size, self.down))

    def approach(self, error: Floats) -> Floats:
        """Return the speed of a pin to its height, m/s, ``v = e / τ_s``; 0 in the dead band, m."""
        return np.where(np.abs(error) > self.dead_band, error / self.settling_time, 0.0)

    def mark_formed(self, target: Floats, rest: float) -> Modes:
        """Return HOLD for cells commanded farther from rest than the dead band, m, REST for the others."""
        return mark_formed(target, rest, self.dead_band)


class BalancingMotion(PinMotion):
    """Motion by back-drivable motors, which balance the load."""

    def command(self, speed: Floats, force: Floats) -> Floats:
        """Return motor commands for speeds, m/s, under forces, N: ``K = v / v0 + F / F_stall``."""
        return np.clip(self.open_for(speed) + force / self.lift, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class CellwiseControl(BatchControl):
    """Controller without memory: the orders for a cell depend on that cell alone."""

    parameters: MotionParameters
    actuator: Actuator
    motion: PinMotion

    rows = 0

    def begin(self) -> None:
        """Return no memory: cells have only their rows."""

    def locate(self, memory: None, touched: Measurement) -> tuple[None, None]:
        """Request the cells near the fingertip and those in motion only; see `Controller`."""
        return memory, None


def _look_up(speed: Floats, speeds: Floats) -> Floats:
    """Return the openings of speeds (m[, b]), m/s, by tables (129[, b]) of the speeds at `OPENINGS`."""
    if speeds.ndim == 1:
        return np.interp(speed, speeds, OPENINGS)
    runs = zip(speed.T, speeds.T, strict=True)
    return np.stack([np.interp(speeds, table, OPENINGS) for speeds, table in runs], axis=-1)


def find_free_speeds(cell: Cell, way: float) -> Floats:
    """Return speeds (129,), m/s, of a free pin at `OPENINGS`, up (`way` 1) or down (-1); growing.

    With another `way` the pressure is that share of the reservoir's.
    """
    drop = way * cell.supply.pressure(np.copysign(OPENINGS, way))
    free = cell.flow.flow(OPENINGS, drop) / cell.actuator.area
    # A reservoir that cannot move a pin gets the valve wide open.
    return np.maximum(free, 0.0) + 1e-12 * OPENINGS


def make_pin_motion(parameters: MotionParameters, cell: Cell, period: float) -> PinMotion:
    """Return the motion of pins; ParameterError when heights are approached faster than in two periods, s."""
    if parameters.settling_time < 2.0 * period:
        rule = f"must be at least two control periods, {2.0 * period:g} s"
        raise ParameterError("control", "settling_time", rule, f"{parameters.settling_time:g} s")
    supply = cell.supply
    kind = PinMotion if supply.locks else BalancingMotion
    return kind(
        parameters.settling_time,
        parameters.dead_band,
        find_free_speeds(cell, 1.0),
        find_free_speeds(cell, -1.0),
        supply.high * cell.actuator.area,
    )


def check_damping(damping: float, cell: Cell, period: float, stiffness: float = 0.0) -> None:
    """Refuse a damping at which finger and pin would oscillate.

    A pin that yields by ``c dH/dt = -F`` under a pulp of stiffness k loses ``k T_c / c`` of the
    force in a control period. With the dead time and the lag of the default valve it oscillates
    from about 2 on, so 1 is permitted. The pulp is stiffest at the largest force a pin can lift,
    ``k = f_d b exp(m (x - x0)) = f_d b + m F``; a spring under the pin, `stiffness` in N/m, adds to
    it.
    """
    if cell.touch is None:
        return
    contact = cell.touch.contact
    stiffest = (
        contact.share * contact.stiffness + contact.exponent * cell.supply.high * cell.actuator.area
    )
    least = (stiffest + stiffness) * period
    if damping < least:
        rule = f"must be at least {least:.3g} N s/m at this control period, or the pin would swing"
        raise ParameterError("control", "damping", rule, f"{damping:g} N s/m")
