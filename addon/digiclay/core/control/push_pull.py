"""Push and pull: contact from commanded less measured height, without a force sensor.

A shut valve locks its pin, and a locked pin does not move under a force. So pins near the hand
listen: their valves open slightly to the high and to the low reservoir in turn. A free pin ends
each cycle where it began; a loaded one rises less than it falls, and its drift reveals the hand.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..base.arrays import Flags, Floats
from ..base.errors import ParameterError
from ..base.modes import FORCE_FOLLOW
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Measurement
from ..model.layout import RELATIVE_TOLERANCE, Disc
from .device_info import DeviceInfo
from .pin_motion import MotionParameters, PinMotion, make_pin_motion
from .servo import check_order
from .travel import measure_square

#: Control periods of a cycle: up, then down.
CYCLE = 2


class Listening(NamedTuple):
    """Memory of the controller: listening disc, m (a negative radius: none), and number of periods."""

    x: float = 0.0
    y: float = 0.0
    radius: float = -1.0
    period: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class PushPull(MotionParameters):
    """Motion of listening pins, and their compliance."""

    listening_speed: float = quantity(
        8e-3, "speed of a free listening pin, up and down", unit="m/s", symbol="v_l", above=0.0
    )
    following_speed: float = quantity(
        20e-3, "speed of a free touched pin, up and down", unit="m/s", symbol="v_f", above=0.0
    )
    threshold: float = quantity(
        0.1e-3,
        "commanded less measured height at which contact is detected",
        unit="m",
        symbol="θ",
        above=0.0,
    )
    centring_time: float = quantity(
        0.5, "time constant of a listening pin's centering", unit="s", symbol="τ_c", above=0.0
    )
    assist: float = quantity(
        0.5,
        "share of its last drift speed that a touched pin keeps",
        symbol="a",
        at_least=0.0,
        at_most=0.9,
    )
    release_time: float = quantity(
        0.1, "time without drift until a pin is released", unit="s", symbol="t_r", at_least=0.0
    )

    def check(self) -> None:
        """The following speed is at least the listening speed."""
        check_order(self, "following_speed", "at_least", "listening_speed")


@dataclass(frozen=True, eq=False)
class PushPullControl:
    """Controller of push and pull for a bed.

    With e = H_com - H at the end of a cycle, a cell is pushed if e > θ and pulled if e < -θ; its
    commanded height then follows to within θ of the measured one. Rows of a cell: remaining cycles
    in which it counts as touched, and its last drift speed, m/s.
    """

    parameters: PushPull
    actuator: Actuator
    motion: PinMotion
    period: float
    margin: float

    rows = 2

    def begin(self) -> Listening:
        """Return the memory before a session."""
        return Listening()

    def locate(self, memory: Listening, touched: Measurement) -> tuple[Listening, Disc | None]:
        """Listen near a possible hand: pins farther away do not move; see `Controller`."""
        memory = memory._replace(period=memory.period + 1, radius=-1.0)
        if not touched.height.size:
            return memory, None
        low = touched.quadratic_basis[1:3].min(axis=1)
        high = touched.quadratic_basis[1:3].max(axis=1)
        x, y = ((low + high) / 2).tolist()
        radius = float(np.hypot(*(high - low))) / 2 + self.margin
        return memory._replace(x=x, y=y, radius=radius), (x, y, radius)

    def command(self, memory: Listening, seen: Measurement) -> tuple[Listening, Commands]:
        """Drag commanded heights along, and move every pin up or down; see `Controller`."""
        speeds, target = self.parameters, seen.target
        limit = memory.radius * abs(memory.radius) * (1.0 + RELATIVE_TOLERANCE)
        listening = measure_square(memory.x, memory.y, seen.quadratic_basis) <= limit
        rising = memory.period % CYCLE == 0
        if rising:  # a whole cycle is over: the remaining error is no ripple
            target = self._drag_targets(seen, listening)
        touched = seen.own[0] > 0.0
        error = target - seen.height
        stroke = np.where(touched, speeds.following_speed, speeds.listening_speed)
        # Centering acts only in the rising half, and so at twice the speed.
        centering = CYCLE * error / speeds.centring_time
        swing = stroke + centering if rising else -stroke
        speed = np.where(
            listening, swing + speeds.assist * seen.own[1], self.motion.approach(error)
        )
        mode = self.motion.mark_formed(target, self.actuator.rest_height)
        np.putmask(mode, touched & listening, FORCE_FOLLOW)
        return memory, Commands(target, mode, self.motion.open_for(speed))

    def _drag_targets(self, seen: Measurement, listening: Flags) -> Floats:
        """Return the targets after a cycle; updates the rows of the cells in place."""
        gains, left = self.parameters, seen.own[0]
        error = seen.target - seen.height
        # A height dragged to the threshold is on it, except for rounding.
        moved = (np.abs(error) > gains.threshold * (1.0 + RELATIVE_TOLERANCE)) & listening
        was = left > 0.0
        cycles = 1.0 + round(gains.release_time / (CYCLE * self.period))
        left[:] = np.where(moved, cycles, np.where(listening, np.maximum(left - 1.0, 0.0), 0.0))
        released = was & (left == 0.0)
        play = np.minimum(np.maximum(error, -gains.threshold), gains.threshold)
        followed: Floats = np.where(moved, seen.height + play, seen.target)
        seen.own[1] = np.where(moved, followed - seen.target, 0.0) / (CYCLE * self.period)
        np.putmask(followed, released, seen.height)
        return followed


def build(parameters: PushPull, device: DeviceInfo) -> PushPullControl:
    """Put push and pull together for a device; ParameterError when a pin's own ripple would be a touch."""
    ripple = parameters.listening_speed * device.period
    if device.height_floor:
        threshold = max(parameters.threshold, ripple + device.height_floor)
        parameters = replace(parameters, threshold=threshold)
    if not parameters.threshold > ripple:
        rule = f"must be above a listening pin's own way in a control period, {ripple:g} m"
        raise ParameterError("control", "threshold", rule, f"{parameters.threshold:g} m")
    motion = make_pin_motion(parameters, device.cell, device.period)
    margin = device.grid.layout.pitch
    return PushPullControl(parameters, device.cell.actuator, motion, device.period, margin)
