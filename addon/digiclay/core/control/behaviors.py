"""Elastic, plastic and viscous behaviors of pins: motion under a force, and after its release."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Cells, Flags, Floats, Modes
from ..base.modes import BLISTER, FORCE_FOLLOW, HOLD, REST, SPRING
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Measurement, Memory
from ..model.layout import Disc
from .device_info import DeviceInfo, check_floor
from .exchange import Exchange, make_exchange
from .pin_motion import (
    CellwiseControl,
    PinMotion,
    TouchParameters,
    check_damping,
    make_pin_motion,
    raise_felt_force,
)
from .servo import check_order

#: Share of the felt force above which a touched cell remains touched: its spring may press no
#: harder.
STILL = 0.2
#: Displacement at the border of the displaced region, in dead bands.
BORDER = 0.1


@dataclass(frozen=True, eq=False, repr=False)
class Elastic(TouchParameters):
    """Spring and damper under every pin."""

    stiffness: float = quantity(
        20.0, "stiffness of a cell's spring", unit="N/m", symbol="k", above=0.0
    )
    damping: float = quantity(
        5.0, "force per speed of a pressed pin", unit="N s/m", symbol="c", above=0.0
    )


@dataclass(frozen=True, eq=False)
class ElasticControl(CellwiseControl):
    """Controller of the elastic behavior: a pressed pin yields like a spring and returns.

    Pressed: ``c dH/dt = k (H_0 - H) - F``. Released: back to rest, ``dH/dt = (H_0 - H) / τ_s``.
    """

    parameters: Elastic

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Let pressed cells yield, and the others spring back; see `Controller`."""
        gains, rest = self.parameters, self.actuator.rest_height
        error = rest - seen.height
        pressed = seen.force >= gains.felt_force * np.where(seen.mode == SPRING, STILL, 1.0)
        giving = (gains.stiffness * error - seen.force) / gains.damping
        speed = np.where(pressed, giving, self.motion.approach(error))
        mode = np.where(pressed, SPRING, REST)
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.motion.command(speed, seen.force))


@dataclass(frozen=True, eq=False, repr=False)
class Plastic(TouchParameters):
    """Bingham body under every pin: rigid up to a yield force, viscous above."""

    yield_force: float = quantity(
        0.03, "force above which a cell yields", unit="N", symbol="F_y", above=0.0
    )
    damping: float = quantity(
        5.0,
        "force above the yield force per speed of a sinking pin",
        unit="N s/m",
        symbol="c",
        above=0.0,
    )

    def check(self) -> None:
        """The yield force is at least the felt force."""
        check_order(self, "yield_force", "at_least", "felt_force")


@dataclass(frozen=True, eq=False)
class PlasticControl(CellwiseControl):
    """Controller of the plastic behavior: a pin above its yield force yields and keeps its lowest height.

    Above yield: ``c dH/dt = -(F - F_y)``, and the height becomes the cell's target. Below it the
    pin does not move; released, it goes to the lowest height to which it was pressed.
    """

    parameters: Plastic

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Let cells above their yield force yield, and hold the others; see `Controller`."""
        limits = self.parameters
        pressed = seen.force >= limits.felt_force
        yielding = seen.force > limits.yield_force
        target = np.where(yielding, np.minimum(seen.target, seen.height), seen.target)
        # A pin under the fingertip is not raised again after it has sunk beyond its target.
        back = self.motion.approach(target - seen.height)
        speed = np.where(pressed, np.minimum(back, 0.0), back)
        np.putmask(speed, yielding, (limits.yield_force - seen.force) / limits.damping)
        mode = self.motion.mark_formed(target, self.actuator.rest_height)
        np.putmask(mode, pressed, SPRING)
        np.putmask(mode, yielding, FORCE_FOLLOW)
        return memory, Commands(target, mode, self.motion.command(speed, seen.force))


@dataclass(frozen=True, eq=False, repr=False)
class Viscous(TouchParameters):
    """Spring and damper in parallel under every pin, and the exchange between neighbors.

    Materiable calls this viscosity: a spring and a damper per cell, and exchange between neighbors.
    """

    damping: float = quantity(
        10.0, "force per speed of a sinking pin", unit="N s/m", symbol="c", above=0.0
    )
    recovery_time: float = quantity(
        1.0, "time constant of the surface's recovery", unit="s", symbol="τ_r", above=0.0
    )
    diffusivity: float = quantity(
        10e-6,
        "diffusivity of the displacement between neighbors",
        unit="m2/s",
        symbol="D",
        at_least=0.0,
    )


class Spot(NamedTuple):
    """Memory of the viscous behavior: the box around all displaced cells, m; empty before any touch."""

    left: float = math.inf
    right: float = -math.inf
    bottom: float = math.inf
    top: float = -math.inf

    def around(self, basis: Floats) -> Spot:
        """Return the box extended to positions with the basis (6, m)."""
        if not basis.shape[1]:
            return self
        (left, bottom), (right, top) = (
            basis[1:3].min(axis=1).tolist(),
            basis[1:3].max(axis=1).tolist(),
        )
        return Spot(
            min(self.left, left),
            max(self.right, right),
            min(self.bottom, bottom),
            max(self.top, top),
        )

    def disc(self, margin: float) -> Disc | None:
        """Return a disc around the box with a margin, m; None for an empty box."""
        if self.left > self.right:
            return None
        across = math.hypot(self.right - self.left, self.top - self.bottom)
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2, across / 2 + margin


@dataclass(frozen=True, eq=False)
class ViscousControl:
    """Controller of the viscous behavior: a pressed pin sinks slowly, displaces its neighbors, and recovers.

    ``du/dt = -F / c - u / τ_r + D ∇²u`` with u = H_com - H_0; each period, neighbors exchange, then
    every cell relaxes under its force, exactly. The exchange keeps Σ u, so that the volume of a
    dent decays with τ_r whatever D is.
    """

    parameters: Viscous
    actuator: Actuator
    motion: PinMotion
    exchange: Exchange
    period: float
    margin: float
    """Margin of active cells around the displaced ones, m."""

    rows = 0

    def begin(self) -> Spot:
        """Return the memory before a session."""
        return Spot()

    def locate(self, memory: Spot, touched: Measurement) -> tuple[Spot, Disc | None]:
        """Request all displaced cells and a margin around them; see `Controller`."""
        spot = memory.around(
            touched.quadratic_basis[:, touched.force >= self.parameters.felt_force]
        )
        return spot, spot.disc(self.margin)

    def command(self, memory: Spot, seen: Measurement) -> tuple[Spot, Commands]:
        """Exchange, relax, and move every cell to its new height; see `Controller`."""
        gains, actuator = self.parameters, self.actuator
        rest = actuator.rest_height
        pressed = seen.force >= gains.felt_force
        shift = self.exchange.even_out(seen.cells, seen.target - rest)
        decay = math.exp(-self.period / gains.recovery_time)
        # Spring k = c / τ_r: the exact solution of c du/dt = -F - k u over the period.
        shift *= decay
        shift -= seen.force * pressed * (gains.recovery_time / gains.damping * (1.0 - decay))
        shift = np.minimum(np.maximum(shift, -rest), actuator.stroke - rest)
        size = np.abs(shift)
        if not pressed.any() and size.max(initial=0.0) <= gains.dead_band:
            memory, shift, size = Spot(), np.zeros(shift.size), np.zeros(shift.size)
        else:
            memory = memory.around(seen.quadratic_basis[:, size > BORDER * gains.dead_band])
        target, formed = rest + shift, size > gains.dead_band
        # The surface creeps by less than the dead band per period: its speed is added.
        creep = np.where(formed, (target - seen.target) / self.period, 0.0)
        command = self.motion.command(
            creep + self.motion.approach(target - seen.height), seen.force
        )
        return memory, Commands(target, self._modes(seen.cells, pressed, formed), command)

    def _modes(self, cells: Cells, pressed: Flags, formed: Flags) -> Modes:
        """Return the modes: pressed, drawn along by a pressed neighbor, recovering, at rest."""
        drawn = np.zeros(cells.size, np.bool_)
        if pressed.any():
            for first, second, _ in self.exchange.find_pairs(cells):
                drawn[first] |= pressed[second]
                drawn[second] |= pressed[first]
        mode = np.where(formed, HOLD, REST)
        np.putmask(mode, drawn & formed, BLISTER)
        np.putmask(mode, pressed, SPRING)
        return mode


def build(parameters: Any, device: DeviceInfo) -> ElasticControl | PlasticControl | ViscousControl:
    """Put the behavior with these parameters together for a device."""
    stiffness = parameters.stiffness if isinstance(parameters, Elastic) else 0.0
    check_damping(parameters.damping, device.cell, device.period, stiffness)
    if isinstance(parameters, Plastic):
        check_floor(
            parameters.yield_force, "yield_force", parameters.yield_force, device.force_floor
        )
    actuator, motion = device.cell.actuator, make_pin_motion(parameters, device.cell, device.period)
    parameters = raise_felt_force(device.force_floor, parameters)
    if isinstance(parameters, Elastic):
        return ElasticControl(parameters, actuator, motion)
    if isinstance(parameters, Plastic):
        return PlasticControl(parameters, actuator, motion)
    exchange = make_exchange(device.grid, parameters.diffusivity, device.period)
    margin = 2.0 * device.grid.layout.pitch
    return ViscousControl(parameters, actuator, motion, exchange, device.period, margin)
