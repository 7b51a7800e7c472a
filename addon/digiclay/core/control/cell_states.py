"""Method II: a state machine in every cell, driven by its own force (Fig. 5 of the paper).

There is no coordinator: a cell under enough force follows it, and its neighbors become a blister
around it. Those that feel the fingertip follow the force in turn, so that the contact set spreads
and moves with the fingertip.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Flags, Floats, Modes, any_true
from ..base.modes import BLISTER, CRITICAL, EDGE, FORCE_FOLLOW, HOLD, SPRING, Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import Commands, Measurement, SetPoint
from ..model.layout import RELATIVE_TOLERANCE, Disc
from .blister import Blister
from .device_info import DeviceInfo, check_floor, suppress_noise
from .finger_sections import WHOLE, Whole
from .servo import Tracking, check_order, lock_overloaded, mark_formed
from .travel import Heading, Rim, measure_offsets, measure_square, update_heading

VIRTUAL_SPRING = (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.EDGE)


class Arrow(NamedTuple):
    """From some modes to another, when a condition holds; `follow_arrows` has them by name."""

    source: tuple[Mode, ...]
    goal: Mode
    condition: str


class Arrows(tuple[Arrow, ...]):
    """Arrows that are followed simultaneously; of two from one mode the later one holds."""

    @cached_property
    def conditions(self) -> list[str]:
        """Their conditions, each once."""
        return list(dict.fromkeys(arrow.condition for arrow in self))

    @cached_property
    def goals(self) -> Modes:
        """New modes by conditions, as the digits of a number, the first one leading, and by the old mode."""
        goals = np.tile(np.arange(len(Mode), dtype=np.int8), (2,) * len(self.conditions) + (1,))
        for source, goal, condition in self:
            holds = np.moveaxis(goals, self.conditions.index(condition), 0)[1]
            holds[..., list(source)] = goal
        return goals.ravel()


#: Transitions by the force on a cell.
BY_FORCE = Arrows(
    (
        Arrow(VIRTUAL_SPRING, Mode.FORCE_FOLLOW, "above_spring_trigger"),
        Arrow((Mode.BLISTER, Mode.FROZEN), Mode.FORCE_FOLLOW, "above_blister_trigger"),
        Arrow((Mode.FORCE_FOLLOW,), Mode.CRITICAL, "below_critical_trigger"),
        Arrow((Mode.CRITICAL,), Mode.FORCE_FOLLOW, "above_critical_trigger"),
        Arrow((Mode.CRITICAL,), Mode.BLISTER, "timed_out"),
    )
)

#: Transitions by the distance to the nearest cell under the fingertip.
BY_PLACE = Arrows(
    (
        Arrow(VIRTUAL_SPRING, Mode.BLISTER, "in_blister"),
        Arrow((Mode.BLISTER,), Mode.FROZEN, "left_behind"),
        Arrow((*VIRTUAL_SPRING, Mode.BLISTER, Mode.FROZEN), Mode.EDGE, "at_edge"),
        Arrow((Mode.EDGE, Mode.BLISTER, Mode.FROZEN), Mode.HOLD, "outside"),
    )
)


def follow_arrows(mode: Modes, arrows: Arrows, conditions: dict[str, Flags]) -> Modes:
    """Return the modes (m,) after all arrows were followed simultaneously."""
    at = np.zeros(mode.shape, np.int16)
    for name in arrows.conditions:
        at += at
        at += conditions[name]
    at *= len(Mode)
    at += mode
    return arrows.goals.take(at)


class Patch(NamedTuple):
    """Memory of the controller: centroid of the forces when last felt, m, direction of travel, losses.

    `edge`: height of the surface around the blister, m; `felt`: whether some cell is under the
    fingertip.
    """

    x: float = 0.0
    y: float = 0.0
    heading: Heading = Heading()
    edge: float = 0.0
    felt: bool = False
    losses: int = 0

    @property
    def position(self) -> tuple[float, float] | None:
        """Position of the fingertip, m; None if none is felt."""
        return (self.x, self.y) if self.felt else None

    @property
    def top(self) -> float:
        """Height of the blister's top, m, estimated as that of the surface around it."""
        return self.edge


@dataclass(frozen=True, eq=False, repr=False)
class CellStates(Tracking):
    """Gains and thresholds of Method II, all of them per cell."""

    force_setpoint: float = quantity(
        0.04, "force of a cell held under the fingertip", unit="N", symbol="F_ref", above=0.0
    )
    spring_trigger: float = quantity(
        0.06,
        "force at which a cell at rest begins to follow",
        unit="N",
        symbol="F_trig^VS",
        above=0.0,
    )
    blister_trigger: float = quantity(
        0.015,
        "force at which a cell of the blister begins to follow",
        unit="N",
        symbol="F_trig^blister",
        above=0.0,
    )
    critical_trigger: float = quantity(
        0.005,
        "force below which a following cell is critical",
        unit="N",
        symbol="F_trig^crit",
        above=0.0,
    )
    critical_time: float = quantity(
        50e-3, "time until a critical cell ends following", unit="s", symbol="t_crit", at_least=0.0
    )
    spring_stiffness: float = quantity(20.0, "virtual spring", unit="N/m", symbol="k_VS", above=0.0)
    force_gain: float = quantity(
        15.0, "proportional gain of force", unit="1/N", symbol="K_FF", at_least=0.0
    )
    rise: float = quantity(
        1e-3,
        "rise of the blister for the detection of contact",
        unit="m",
        symbol="h_rise",
        at_least=0.0,
    )
    jump: float = quantity(
        8e-3,
        "motion per control period above which contact counts as lost",
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
        check_order(self, "blister_trigger", "below", "spring_trigger")
        check_order(self, "critical_trigger", "below", "blister_trigger")


@dataclass(frozen=True, eq=False)
class CellStatesControl:
    """Controller of Method II for a bed."""

    parameters: CellStates
    blister: Blister
    """Its radii are measured from the nearest cell under the fingertip."""
    actuator: Actuator
    rim: Rim
    lift: float
    """Largest force that the high reservoir lifts, N."""
    period: float
    """Control period, s."""
    floor: float = 0.0
    """Noise floor of a cell's reading, N."""

    #: Row of a cell: periods since it became critical; of several fingers, also whether it obeys
    #: another one.
    rows = 1
    #: See `following.FollowingControl`.
    division, pin_rows = "CellDivision", ()

    @property
    def blister_radius(self) -> float:
        """Largest distance of pins in the blister from the fingertip, m: it begins at the pressed cells."""
        return self.blister.radius + self.parameters.jump

    def begin(self) -> Patch:
        """Return the memory before a session."""
        return Patch()

    def locate(
        self, memory: Patch, touched: Measurement, part: slice = WHOLE.parts[0]
    ) -> tuple[Patch, Disc | None]:
        """Locate a fingertip by a part of the cells, and the largest extent of its blister."""
        # Cells that follow count with any reading: under a rising fingertip the few readings above
        # the noise would move the centroid to and fro.
        force = touched.force[part]
        pressed = force > (~_under_finger(touched.mode[part]) * self.floor if self.floor else TIE)
        if not any_true(pressed):
            return memory, None
        force, basis = force[pressed], touched.quadratic_basis[:, part][:, pressed]
        total, x, y = np.dot(basis[:3], force).tolist()
        x, y = x / total, y / total
        radius = math.sqrt(float(measure_square(x, y, basis).max()))
        if not memory.felt:
            edge = float(np.dot(force, touched.height[part][pressed])) / total
            memory = memory._replace(heading=Heading(x, y), edge=edge)
        elif math.hypot(x - memory.x, y - memory.y) > self.parameters.jump + TIE:
            memory = memory._replace(heading=Heading(x, y), losses=memory.losses + 1)
        heading = update_heading(memory.heading, x, y, self.parameters.travel)
        return memory._replace(x=x, y=y, heading=heading), (x, y, radius + self.blister.edge_radius)

    def command(self, memory: Patch, seen: Measurement) -> tuple[Patch, Commands]:
        """Apply the transitions of every cell, then the control of its mode; see `Controller`."""
        (memory,), commands = self.command_all([memory], seen)
        return memory, commands

    def sort(self, memory: Patch) -> bool:
        """Return one key for all fingers: one call serves them."""
        return True

    def locate_all(
        self, memories: list[Patch], touched: Measurement, sections: Whole
    ) -> tuple[list[Patch], list[Disc | None]]:
        """Locate each fingertip by its section of the cells; see `Controller.locate`."""
        fingers = zip(memories, sections.parts, strict=True)
        located = [self.locate(memory, touched, part) for memory, part in fingers]
        return [memory for memory, _ in located], [disc for _, disc in located]

    def command_all(
        self, memories: list[Patch], seen: Measurement, sections: Whole = WHOLE
    ) -> tuple[list[Patch], Commands]:
        """Apply the transitions of every cell, then the control of its mode."""
        seen = seen._replace(force=suppress_noise(seen.force, self.floor)) if self.floor else seen
        mode = follow_arrows(seen.mode, BY_FORCE, self._by_force(seen))
        under = _under_finger(mode)
        target = seen.target.copy()
        np.putmask(target, under, seen.height)
        # Without a cell under the fingertip no cell is near it, and its shape is unused.
        around, shape = np.zeros((3, *mode.shape), np.bool_), np.empty(mode.shape)
        after = list(memories)
        for i, (memory, part) in enumerate(zip(memories, sections.parts, strict=True)):
            if any_true(under[part]):
                memory, shape[part] = self._around(memory, seen, part, under[part], around[:, part])
                after[i] = memory._replace(felt=True)
            else:
                after[i] = memory._replace(felt=False, losses=memory.losses + memory.felt)
        in_blister, left_behind, at_edge = around
        regions = {"in_blister": in_blister, "left_behind": left_behind, "at_edge": at_edge}
        mode = follow_arrows(mode, BY_PLACE, regions | {"outside": ~(in_blister | at_edge)})
        np.putmask(target, mode == BLISTER, shape)
        mode = self._resting(mode, target, seen.force)
        seen.own[0] = np.where(mode == CRITICAL, seen.own[0] + 1.0, 0.0)
        most = sections.spread([0.0 if self._leaves(memory) else 1.0 for memory in after])
        return after, Commands(target, mode, self._commands(seen, mode, target, under, most))

    def _leaves(self, memory: Patch) -> bool:
        """Tell whether the fingertip leaves the bed: then no cell rises for it."""
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
            "timed_out": critical & (seen.own[0] * self.period >= limits.critical_time - TIE),
        }

    def _around(
        self, memory: Patch, seen: Measurement, part: slice, under: Flags, around: Flags
    ) -> tuple[Patch, Floats]:
        """Return the shape of the blister around cells under a fingertip: their neighborhoods superposed.

        `around` (3, m): which cells are in it, left behind and at its edge, is set in place.
        """
        blister, basis, height = self.blister, seen.quadratic_basis[:, part], seen.height[part]
        in_blister, left_behind, at_edge = around
        distance = np.sqrt(measure_square(basis[1, under], basis[2, under], basis))
        nearest = distance.min(axis=0)
        np.less(nearest, blister.radius * (1.0 - RELATIVE_TOLERANCE), out=in_blister)
        np.less(nearest, blister.edge_radius * (1.0 - RELATIVE_TOLERANCE), out=at_edge)
        at_edge ^= in_blister
        from_patch, ahead = measure_offsets(memory.x, memory.y, *memory.heading[2:], basis)
        facing = height[at_edge & (ahead >= -TIE)]
        if facing.size:
            memory = memory._replace(edge=float(facing.mean()))
        np.less(ahead, self.parameters.behind * from_patch - TIE, out=left_behind)
        left_behind &= nearest > blister.flat_radius * (1.0 - RELATIVE_TOLERANCE)
        left_behind &= in_blister
        weight = np.maximum(blister.evaluate_profile(distance), 0.0)
        top = np.dot(height[under], weight) / np.maximum(weight.sum(axis=0), 1e-12)
        rise = 0.0 if self._leaves(memory) else self.parameters.rise
        shape = blister.interpolate(nearest, memory.edge, top + rise)
        return memory, np.minimum(np.maximum(shape, 0.0), self.actuator.stroke)

    def _resting(self, mode: Modes, target: Floats, force: Floats) -> Modes:
        """Divide the cells on a virtual spring: pressed, holding a formed height, or at rest."""
        spring = mode <= HOLD
        spring |= mode == SPRING
        formed = mark_formed(target, self.actuator.rest_height, self.parameters.dead_band)
        return np.where(spring, np.where(force > TIE, SPRING, formed), mode)

    def _commands(
        self, seen: Measurement, mode: Modes, target: Floats, under: Flags, most: Any
    ) -> Floats:
        """Return valve commands: force control under the fingertip, springs and profile elsewhere."""
        gains = self.parameters
        springs = (mode <= EDGE) | (mode == SPRING)
        command = gains.command(target - springs * seen.force / gains.spring_stiffness, seen.height)
        follow = gains.force_gain * (gains.force_setpoint - seen.force)
        np.putmask(command, under, np.minimum(np.maximum(follow, -1.0), most))
        return lock_overloaded(command, seen.force, self.lift)


def _under_finger(mode: Modes) -> Flags:
    """Return the cells that follow the force, or did in the last period."""
    return (mode == FORCE_FOLLOW) | (mode == CRITICAL)


def build(parameters: CellStates, device: DeviceInfo) -> CellStatesControl:
    """Put Method II together for a device; the device has a blister."""
    assert device.blister is not None
    asked, floor = parameters.force_setpoint, device.force_floor
    check_floor(asked, "force_setpoint", asked, floor)
    return CellStatesControl(
        parameters,
        device.blister,
        device.cell.actuator,
        device.rim,
        device.overload,
        device.period,
        floor,
    )
