"""Method II: a state machine in every cell, driven by its own force (Fig. 5 of the paper).

No coordinator: a cell pressed hard enough follows the force, its neighbors become a blister
around it, those of them that feel the fingertip follow the force in turn, and so the contact
set spreads and moves with the fingertip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import Flags, Floats, Modes, any_true
from ..base.errors import ParameterError
from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Measurement, SetPoint
from ..model.layout import RELATIVE_TOLERANCE, Disc
from .blister import Blister
from .device_info import DeviceInfo, check_floor, suppress_noise
from .servo import Tracking, lock_overloaded, mark_formed
from .travel import ABEAM, Heading, Rim, measure_lead, measure_square, update_heading

VIRTUAL_SPRING = (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.EDGE)


class Arrow(NamedTuple):
    """From some modes to another, when a condition holds; `follow_arrows` has them by name."""

    source: tuple[Mode, ...]
    goal: Mode
    condition: str


#: What a cell's own force decides.
BY_FORCE = (
    Arrow(VIRTUAL_SPRING, Mode.FORCE_FOLLOW, "above_spring_trigger"),
    Arrow((Mode.BLISTER, Mode.FROZEN), Mode.FORCE_FOLLOW, "above_blister_trigger"),
    Arrow((Mode.FORCE_FOLLOW,), Mode.CRITICAL, "below_critical_trigger"),
    Arrow((Mode.CRITICAL,), Mode.FORCE_FOLLOW, "above_critical_trigger"),
    Arrow((Mode.CRITICAL,), Mode.BLISTER, "timed_out"),
)

#: What the distance to the nearest cell under the fingertip decides.
BY_PLACE = (
    Arrow(VIRTUAL_SPRING, Mode.BLISTER, "in_blister"),
    Arrow((Mode.BLISTER,), Mode.FROZEN, "left_behind"),
    Arrow((*VIRTUAL_SPRING, Mode.BLISTER, Mode.FROZEN), Mode.EDGE, "at_edge"),
    Arrow((Mode.EDGE, Mode.BLISTER, Mode.FROZEN), Mode.HOLD, "outside"),
)


def follow_arrows(mode: Modes, arrows: tuple[Arrow, ...], conditions: dict[str, Flags]) -> Modes:
    """Return the modes after all arrows were followed at once; of two from one mode the later wins."""
    after = mode.copy()
    for source, goal, condition in arrows:
        starts = _MEMBERS[source].take(mode)
        np.putmask(after, starts & conditions[condition], np.int8(goal))
    return after


#: For each set of source modes, whether a mode is among them, by its code.
_MEMBERS = {arrow.source: np.isin(np.arange(len(Mode)), arrow.source) for arrow in (*BY_FORCE, *BY_PLACE)}


class Patch(NamedTuple):
    """Memory of the controller: centroid of the forces when last felt, m, direction of travel, losses.

    `edge`: height of the surface around the blister, m; `felt`: whether some cell is under the fingertip.
    """

    x: float = 0.0
    y: float = 0.0
    heading: Heading = Heading()
    edge: float = 0.0
    felt: bool = False
    losses: int = 0

    @property
    def place(self) -> tuple[float, float] | None:
        """Where the fingertip is, m; None: none is felt."""
        return (self.x, self.y) if self.felt else None


@dataclass(frozen=True, eq=False, repr=False)
class CellStates(Tracking):
    """Gains and thresholds of Method II, all of them per cell."""

    force_setpoint: float = quantity(
        0.04, "force of a cell held under the fingertip", unit="N", symbol="F_ref", above=0.0
    )
    spring_trigger: float = quantity(
        0.06, "force at which a cell at rest begins to follow", unit="N", symbol="F_trig^VS", above=0.0
    )
    blister_trigger: float = quantity(
        0.015,
        "force at which a cell of the blister begins to follow",
        unit="N",
        symbol="F_trig^blister",
        above=0.0,
    )
    critical_trigger: float = quantity(
        0.005, "force below which a following cell is critical", unit="N", symbol="F_trig^crit", above=0.0
    )
    critical_time: float = quantity(
        50e-3, "time until a critical cell ends following", unit="s", symbol="t_crit", at_least=0.0
    )
    spring_stiffness: float = quantity(20.0, "virtual spring", unit="N/m", symbol="k_VS", above=0.0)
    force_gain: float = quantity(15.0, "proportional gain of force", unit="1/N", symbol="K_FF", at_least=0.0)
    rise: float = quantity(
        1e-3,
        "rise of the blister for the detection of contact",
        unit="m",
        symbol="h_rise",
        at_least=0.0,
    )
    jump: float = quantity(
        8e-3,
        "motion in a control period beyond which there is a loss",
        unit="m",
        symbol="r_VM",
        source="P",
        above=0.0,
    )

    @property
    def set_point(self) -> SetPoint:
        """Set point of every following cell."""
        return SetPoint(self.force_setpoint, per_cell=True)

    def check(self) -> None:
        """A blister cell starts to follow before one at rest does, and is critical below that."""
        if not self.blister_trigger < self.spring_trigger:
            rule = f"must be below spring_trigger, {self.spring_trigger:g} N"
            raise ParameterError("CellStates", "blister_trigger", rule, f"{self.blister_trigger:g} N")
        if not self.critical_trigger < self.blister_trigger:
            rule = f"must be below blister_trigger, {self.blister_trigger:g} N"
            raise ParameterError("CellStates", "critical_trigger", rule, f"{self.critical_trigger:g} N")


@dataclass(frozen=True)
class CellStatesControl:
    """Controller of Method II for a bed."""

    parameters: CellStates
    blister: Blister
    """Its radii count from the nearest cell under the fingertip."""
    actuator: Actuator
    rim: Rim
    lift: float
    """Force the high reservoir can lift, N."""
    period: float
    """Control period, s."""
    floor: float = 0.0
    """Force from which on the reading of a cell is no noise, N."""

    #: A cell remembers how many periods it has been critical, and of several fingers whose it is.
    rows = 1
    whose = 0

    def begin(self) -> Patch:
        """Return the memory before a session."""
        return Patch()

    def locate(self, memory: Patch, touched: Measurement) -> tuple[Patch, Disc | None]:
        """Find where the fingertip presses, and how far its blister can reach; see `Controller`."""
        # A cell that follows counts with what it reads: of a fingertip that rises the few readings above the
        # noise would draw the centroid to and fro.
        pressed = touched.force > (~_under_finger(touched.mode) * self.floor if self.floor else 0.0)
        if not any_true(pressed):
            return memory, None
        force, basis = touched.force[pressed], touched.quadratic_basis[:, pressed]
        total, x, y = np.dot(basis[:3], force).tolist()
        x, y = x / total, y / total
        radius = math.sqrt(float(measure_square(x, y, basis).max()))
        if not memory.felt:
            edge = float(np.dot(force, touched.height[pressed])) / total
            memory = memory._replace(heading=Heading(x, y), edge=edge)
        elif math.hypot(x - memory.x, y - memory.y) > self.parameters.jump:
            memory = memory._replace(heading=Heading(x, y), losses=memory.losses + 1)
        heading = update_heading(memory.heading, x, y, self.parameters.travel)
        return memory._replace(x=x, y=y, heading=heading), (x, y, radius + self.blister.edge_radius)

    def command(self, memory: Patch, seen: Measurement) -> tuple[Patch, Commands]:
        """Apply the transitions of every cell, then the control of its mode; see `Controller`."""
        seen = seen._replace(force=suppress_noise(seen.force, self.floor)) if self.floor else seen
        mode = follow_arrows(seen.mode, BY_FORCE, self._by_force(seen))
        under = _under_finger(mode)
        target = seen.target.copy()
        np.putmask(target, under, seen.height)
        if any_true(under):
            memory, mode, target = self._around(memory, seen, mode, under, target)
            memory = memory._replace(felt=True)
        else:
            gone = {"in_blister": under, "left_behind": under, "at_edge": under, "outside": ~under}
            mode = follow_arrows(mode, BY_PLACE, gone)
            memory = memory._replace(felt=False, losses=memory.losses + memory.felt)
        mode = self._resting(mode, target, seen.force)
        seen.own[0] = np.where(mode == Mode.CRITICAL, seen.own[0] + 1.0, 0.0)
        most = 0.0 if self._leaves(memory) else 1.0
        return memory, Commands(target, mode, self._commands(seen, mode, target, under, most))

    def _leaves(self, memory: Patch) -> bool:
        """Tell whether the fingertip leaves the bed: then no cell is to rise for it."""
        x, y, (_, _, *toward), *_ = memory
        return any(toward) and (self.rim.is_under(x, y) or self.rim.is_ahead(x, y, *toward))

    def _by_force(self, seen: Measurement) -> dict[str, Flags]:
        """Return the conditions of `BY_FORCE`."""
        limits, force = self.parameters, seen.force
        critical = force < limits.critical_trigger
        return {
            "above_spring_trigger": force >= limits.spring_trigger,
            "above_blister_trigger": force >= limits.blister_trigger,
            "below_critical_trigger": critical,
            "above_critical_trigger": ~critical,
            "timed_out": critical & (seen.own[0] * self.period >= limits.critical_time),
        }

    def _around(
        self, memory: Patch, seen: Measurement, mode: Modes, under: Flags, target: Floats
    ) -> tuple[Patch, Modes, Floats]:
        """Form the blister around the cells under the fingertip: their neighborhoods superposed."""
        blister, basis = self.blister, seen.quadratic_basis
        distance = np.sqrt(measure_square(basis[1, under], basis[2, under], basis))
        nearest = distance.min(axis=0)
        in_blister = nearest < blister.radius * (1.0 - RELATIVE_TOLERANCE)
        at_edge = ~in_blister & (nearest < blister.edge_radius * (1.0 - RELATIVE_TOLERANCE))
        ahead = measure_lead(memory.heading, memory.x, memory.y, basis)
        facing = seen.height[at_edge & (ahead >= -ABEAM)]
        if facing.size:
            memory = memory._replace(edge=float(facing.mean()))
        from_patch = np.sqrt(measure_square(memory.x, memory.y, basis))
        left_behind = (ahead < self.parameters.behind * from_patch) & (nearest > blister.flat_radius)
        left_behind &= in_blister
        conditions = {
            "in_blister": in_blister,
            "left_behind": left_behind,
            "at_edge": at_edge,
            "outside": ~(in_blister | at_edge),
        }
        mode = follow_arrows(mode, BY_PLACE, conditions)
        weight = np.maximum(blister.evaluate_profile(distance), 0.0)
        top = np.dot(seen.height[under], weight) / np.maximum(weight.sum(axis=0), 1e-12)
        rise = 0.0 if self._leaves(memory) else self.parameters.rise
        shape = blister.interpolate(nearest, memory.edge, top + rise)
        shape = np.minimum(np.maximum(shape, 0.0), self.actuator.stroke)
        np.putmask(target, mode == Mode.BLISTER, shape)
        return memory, mode, target

    def _resting(self, mode: Modes, target: Floats, force: Floats) -> Modes:
        """Divide the cells on a virtual spring: pressed, holding a formed height, or at rest."""
        spring = mode <= Mode.HOLD
        spring |= mode == Mode.SPRING
        formed = mark_formed(target, self.actuator.rest_height, self.parameters.dead_band)
        return np.where(spring, np.where(force > 0.0, np.int8(Mode.SPRING), formed), mode)

    def _commands(self, seen: Measurement, mode: Modes, target: Floats, under: Flags, most: float) -> Floats:
        """Return valve commands: force control under the fingertip, springs and profile elsewhere."""
        gains = self.parameters
        springs = (mode <= Mode.EDGE) | (mode == Mode.SPRING)
        command = gains.command(target - springs * seen.force / gains.spring_stiffness, seen.height)
        follow = gains.force_gain * (gains.force_setpoint - seen.force)
        np.putmask(command, under, np.minimum(np.maximum(follow, -1.0), most))
        return lock_overloaded(command, seen.force, self.lift)


def _under_finger(mode: Modes) -> Flags:
    """Return the cells that follow the force, or did in the last period."""
    following: Flags = (mode == Mode.FORCE_FOLLOW) | (mode == Mode.CRITICAL)
    return following


def build(parameters: CellStates, device: DeviceInfo) -> CellStatesControl:
    """Put Method II together for a device; the device has a blister."""
    assert device.blister is not None
    asked, floor = parameters.force_setpoint, device.force_floor
    check_floor(asked, "force_setpoint", asked, floor)
    return CellStatesControl(
        parameters, device.blister, device.cell.actuator, device.rim, device.lift, device.period, floor
    )
