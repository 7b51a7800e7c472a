"""Viscous behavior: a pressed pin sinks slowly, displaces its neighbors, and recovers slowly.

What Materiable calls viscosity: every cell a spring and a damper, and neighbors evened out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Floats
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Measurement
from .device_info import DeviceInfo
from .drive import Drive, TouchParameters, check_damping, make_drive, raise_felt_force
from .exchange import Exchange, make_exchange

#: Displacement below which the border of the displaced region is of no interest, in dead bands.
BORDER = 0.1


class Spot(NamedTuple):
    """Memory of the controller: the box around all displaced cells, m; empty before any touch."""

    left: float = math.inf
    right: float = -math.inf
    bottom: float = math.inf
    top: float = -math.inf

    def around(self, basis: Floats) -> Spot:
        """Return a box that holds some places as well."""
        if not basis.shape[1]:
            return self
        (left, bottom), (right, top) = basis[1:3].min(axis=1).tolist(), basis[1:3].max(axis=1).tolist()
        return Spot(
            min(self.left, left), max(self.right, right), min(self.bottom, bottom), max(self.top, top)
        )

    def disc(self, margin: float) -> tuple[float, float, float] | None:
        """Return x, y and radius of a disc that holds the box and a margin, m; None of an empty one."""
        if self.left > self.right:
            return None
        across = math.hypot(self.right - self.left, self.top - self.bottom)
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2, across / 2 + margin


@dataclass(frozen=True)
class Viscous(TouchParameters):
    """Spring and damper in parallel under every pin, and the exchange between neighbors."""

    damping: float = quantity(10.0, "force over speed of a sinking pin", unit="N s/m", symbol="c", above=0.0)
    recovery_time: float = quantity(
        1.0, "time constant of the surface's recovery", unit="s", symbol="τ_r", above=0.0
    )
    diffusivity: float = quantity(
        10e-6, "diffusivity of the displacement between neighbors", unit="m2/s", symbol="D", at_least=0.0
    )


@dataclass(frozen=True, eq=False)
class ViscousControl:
    """Controller of the viscous behavior for a bed.

    ``du/dt = -F / c - u / τ_r + D ∇²u`` with u = H_com - H_0; each period, neighbors exchange,
    then every cell relaxes under its force, exactly. The exchange keeps Σ u, so that the volume of a
    dent decays with τ_r whatever D is.

    Attributes
    ----------
    margin : float
        How far beyond the displaced cells cells take part, m.
    """

    parameters: Viscous
    actuator: Actuator
    drive: Drive
    exchange: Exchange
    period: float
    margin: float

    name = "viscous"
    rows = 0

    def begin(self) -> Spot:
        """Return the memory before a session."""
        return Spot()

    def locate(self, memory: Spot, touched: Measurement) -> tuple[Spot, tuple[float, float, float] | None]:
        """Request all displaced cells and a margin around them; see `Controller`."""
        spot = memory.around(touched.quadratic_basis[:, touched.force >= self.parameters.felt_force])
        return spot, spot.disc(self.margin)

    def command(self, memory: Spot, seen: Measurement) -> tuple[Spot, Commands]:
        """Exchange, relax, and move every cell to its new height; see `Controller`."""
        known, actuator = self.parameters, self.actuator
        cells, rest = seen.cells, actuator.rest_height
        pressed = seen.force >= known.felt_force
        shift = self.exchange.even_out(cells, seen.target - rest)
        decay = math.exp(-self.period / known.recovery_time)
        # Spring k = c / τ_r: the exact solution of c du/dt = -F - k u over the period.
        shift *= decay
        shift -= seen.force * pressed * (known.recovery_time / known.damping * (1.0 - decay))
        shift = np.minimum(np.maximum(shift, -rest), actuator.stroke - rest)
        size = np.abs(shift)
        if not pressed.any() and size.max(initial=0.0) <= known.dead_band:
            memory, shift, size = Spot(), np.zeros(shift.size), np.zeros(shift.size)
        else:
            memory = memory.around(seen.quadratic_basis[:, size > BORDER * known.dead_band])
        target, formed = rest + shift, size > known.dead_band
        # The surface creeps by less than the dead band a period: its own speed is asked for as well.
        creep = np.where(formed, (target - seen.target) / self.period, 0.0)
        command = self.drive.command(creep + self.drive.approach(target - seen.height), seen.force)
        return memory, Commands(target, self._modes(cells, pressed, formed), command)

    def _modes(self, cells: Cells, pressed: NDArray[np.bool_], formed: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Return the modes: pressed, drawn along by a pressed neighbor, recovering, at rest."""
        drawn = np.zeros(cells.size, np.bool_)
        if pressed.any():
            for one, other, _ in self.exchange.find_pairs(cells):
                drawn[one] |= pressed[other]
                drawn[other] |= pressed[one]
        mode = np.where(formed, np.int8(Mode.HOLD), np.int8(Mode.REST))
        np.putmask(mode, drawn & formed, np.int8(Mode.BLISTER))
        np.putmask(mode, pressed, np.int8(Mode.SPRING))
        return mode


def build(parameters: Viscous, device: DeviceInfo) -> ViscousControl:
    """Put the viscous behavior together for a device."""
    check_damping(parameters.damping, device.cell, device.period)
    return ViscousControl(
        raise_felt_force(device.force_floor, parameters),
        device.cell.actuator,
        make_drive(parameters, device.cell, device.period),
        make_exchange(device.grid, parameters.diffusivity, device.period),
        device.period,
        2.0 * device.grid.layout.pitch,
    )
