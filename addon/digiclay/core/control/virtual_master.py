"""Method I: a virtual master cell under the finger leads the blister (Fig. 3 of the paper).

Locate, control, model, create: where the finger presses; a virtual spring until the force
reaches its set point, then force control; a cylinder and valve like a real one turns the
effort into the master's height; the cells around follow the blister's profile.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..actuator import Actuator
from ..modes import Mode
from ..places import Measurement, Orders
from ..quantity import Parameters, quantity
from .blister import Blister
from .servo import Servo

__all__ = ["Master", "Phase", "VirtualMaster", "VirtualMasterControl"]

Floats = NDArray[np.float64]

#: Modes of cells outside the blister: not formed, formed.
OUTSIDE = np.array([Mode.REST, Mode.HOLD], np.int8)


class Phase(IntEnum):
    """What the master is doing."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2


@dataclass(frozen=True)
class Master:
    """The controller's memory.

    Attributes
    ----------
    phase : Phase
    x, y, height : float
        Where the master is, m.
    lag : tuple of float
        State rows of its own valve.
    reference : float
        Surface height at first touch, from which the virtual spring is pressed down, m.
    edge : float
        Height of the surface around the blister, m.
    anchor_x, anchor_y : float
        Where the direction of travel was last worked out, m.
    toward_x, toward_y : float
        Direction of travel, a unit vector; 0, 0 before the master has travelled.
    alone : int
        Control periods since the finger was last felt.
    losses : int
        How often the finger was lost while shaping.
    """

    phase: Phase = Phase.IDLE
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    lag: tuple[float, ...] = ()
    reference: float = 0.0
    edge: float = 0.0
    anchor_x: float = 0.0
    anchor_y: float = 0.0
    toward_x: float = 0.0
    toward_y: float = 0.0
    alone: int = 0
    losses: int = 0


@dataclass(frozen=True)
class VirtualMaster(Parameters):
    """Gains and thresholds of Method I."""

    force_setpoint: float = quantity(
        0.4, "total force held while shaping, and at which shaping starts", unit="N", symbol="F_ref", above=0.0
    )
    spring_stiffness: float = quantity(200.0, "virtual spring before shaping", unit="N/m", symbol="k_VS", above=0.0)
    position_gain: float = quantity(500.0, "proportional gain of height", unit="1/m", symbol="K_p", at_least=0.0)
    dead_band: float = quantity(10e-6, "height error left alone", unit="m", symbol="δ", at_least=0.0)
    force_gain: float = quantity(5.0, "proportional gain of force", unit="1/N", symbol="K_f", at_least=0.0)
    radius: float = quantity(
        8e-3, "how far from the master the finger is looked for", unit="m", symbol="r_VM", source="P", above=0.0
    )
    travel: float = quantity(
        1.5e-3, "distance travelled that settles the direction", unit="m", symbol="d_t", above=0.0
    )
    behind: float = quantity(-0.3, "cosine below which a cell lies behind", symbol="cos_f", at_least=-1.0, below=0.0)
    felt_force: float = quantity(
        1e-3, "total force below which there is no finger", unit="N", symbol="F_0", above=0.0
    )
    loss_time: float = quantity(
        50e-3, "time without force after which the finger is lost", unit="s", symbol="t_l", at_least=0.0
    )


@dataclass(frozen=True)
class VirtualMasterControl:
    """Method I, put together for a bed.

    Attributes
    ----------
    parameters : VirtualMaster
    blister : Blister
    actuator : Actuator
        The cells' cylinders.
    lift : float
        Pressure of the high reservoir: no cell can lift more, Pa.
    period : float
        Control period, s.
    model : callable
        VM Model: moves the rows of an unloaded real cell, (r, 1), on by one period of a
        held command, (1, 1), in place.
    model_rows : int
        Number r of those rows: height, m, and the valve's.
    """

    parameters: VirtualMaster
    blister: Blister
    actuator: Actuator
    lift: float
    period: float
    model: Callable[[Floats, Floats], None]
    model_rows: int

    name = "virtual_master"

    @property
    def servo(self) -> Servo:
        """The cells' height control."""
        return Servo(self.parameters.position_gain, self.parameters.dead_band)

    def begin(self) -> Master:
        """Return the memory before a session."""
        return Master(lag=(0.0,) * (self.model_rows - 1))

    def attend(self, memory: Master, touched: Measurement) -> tuple[Master, tuple[float, float, float] | None]:
        """Locate the finger and move the master; see `places.Controller`."""
        master = self._lead(self._locate(memory, touched), float(touched.force.sum()))
        if master.phase is Phase.IDLE:
            return master, None
        return master, (master.x, master.y, self.blister.edge_radius)

    def _locate(self, master: Master, touched: Measurement) -> Master:
        """VM Locate: the centroid of the forces near the master; at first touch, of all (equation 13)."""
        force, x, y = touched.force, touched.x, touched.y
        total = float(force.sum())
        if total < self.parameters.felt_force:
            return self._alone(master)
        if master.phase is not Phase.IDLE:
            near = (x - master.x) ** 2 + (y - master.y) ** 2 <= self.parameters.radius**2
            felt = float(force @ near)
            if felt >= self.parameters.felt_force:
                weight = force * near / felt
                return self._turned(replace(master, x=float(weight @ x), y=float(weight @ y), alone=0))
            # The finger has jumped out of reach: this is a new touch elsewhere.
            master = replace(master, losses=master.losses + 1)
        weight = force / total
        at_x, at_y, surface = float(weight @ x), float(weight @ y), float(weight @ touched.height)
        return Master(
            Phase.SPRING, at_x, at_y, surface, (0.0,) * (self.model_rows - 1), reference=surface, edge=surface,
            anchor_x=at_x, anchor_y=at_y, losses=master.losses,
        )  # fmt: skip

    def _alone(self, master: Master) -> Master:
        """Count the periods without a finger; give it up after the loss time."""
        if master.phase is Phase.IDLE:
            return master
        alone = master.alone + 1
        if alone * self.period <= self.parameters.loss_time:
            return replace(master, alone=alone)
        lost = master.phase is Phase.SHAPING
        return replace(master, phase=Phase.IDLE, alone=alone, losses=master.losses + lost)

    def _turned(self, master: Master) -> Master:
        """Settle the direction by distance travelled: a slow or resting finger keeps its direction."""
        dx, dy = master.x - master.anchor_x, master.y - master.anchor_y
        way = math.hypot(dx, dy)
        if way < self.parameters.travel:
            return master
        return replace(master, anchor_x=master.x, anchor_y=master.y, toward_x=dx / way, toward_y=dy / way)

    def _lead(self, master: Master, force: float) -> Master:
        """VM Control and VM Model: the effort, and the height a real cell would make of it."""
        if master.phase is Phase.IDLE:
            return master
        known = self.parameters
        if master.phase is Phase.SPRING and force >= known.force_setpoint:
            master = replace(master, phase=Phase.SHAPING)
        if master.phase is Phase.SPRING:
            effort = known.position_gain * (master.reference - force / known.spring_stiffness - master.height)
        else:
            effort = known.force_gain * (known.force_setpoint - force)
        y = np.array([[master.height], *([opening] for opening in master.lag)])
        self.model(y, np.array([[min(max(effort, -1.0), 1.0)]]))
        return replace(master, height=float(y[0, 0]), lag=tuple(y[1:, 0].tolist()))

    def command(self, memory: Master, seen: Measurement) -> tuple[Master, Orders]:
        """Create the blister, freeze what is left behind, and follow with every cell; see `places.Controller`."""
        target, mode = seen.target, self._left_alone(seen.target)
        if memory.phase is not Phase.IDLE:
            memory, target, mode = self._created(memory, seen, mode)
        overload = self.actuator.pressure(seen.force) >= self.lift
        return memory, Orders(target, mode, self.servo.command(target, seen.height, overload))

    def _left_alone(self, target: Floats) -> NDArray[np.int8]:
        """Return the modes of cells outside the blister: formed ones hold, the others rest."""
        formed = np.abs(target - self.actuator.rest_height) > self.parameters.dead_band
        return OUTSIDE.take(formed.view(np.int8))

    def _created(
        self, master: Master, seen: Measurement, mode: NDArray[np.int8]
    ) -> tuple[Master, Floats, NDArray[np.int8]]:
        """Blister Creation: edge heights, profile, freezing."""
        dx, dy = seen.x - master.x, seen.y - master.y
        distance = np.hypot(dx, dy)
        dx *= master.toward_x
        dy *= master.toward_y
        ahead = dx + dy
        inside = distance <= self.blister.radius
        ring = (distance <= self.blister.edge_radius) & ~inside
        # While the master travels, only what lies ahead counts: the finished ridge behind is no edge.
        facing = seen.height[ring & (ahead >= 0.0)]
        if facing.size:
            master = replace(master, edge=float(facing.mean()))
        touched = seen.force > 0.0
        backward = (ahead < self.parameters.behind * distance) & (distance > self.blister.flat_radius)
        frozen = inside & ~touched & (backward | (seen.mode == Mode.FROZEN))
        shaped = inside & ~frozen
        target = seen.target.copy()
        profile = self.blister.height(distance[shaped], master.edge, master.height)
        target[shaped] = np.minimum(np.maximum(profile, 0.0), self.actuator.stroke)
        mode[inside] = Mode.BLISTER
        mode[inside & touched] = Mode.FORCE_FOLLOW if master.phase is Phase.SHAPING else Mode.SPRING
        mode[ring] = Mode.EDGE
        mode[frozen] = Mode.FROZEN
        return master, target, mode
