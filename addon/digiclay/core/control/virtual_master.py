"""Method I: a virtual master cell under the fingertip that leads the blister (Fig. 3 of the paper).

Locate, control, model, create: where the fingertip presses; a virtual spring until the force
reaches its set point, then force control; a cylinder and valve like a real one turns the
effort into the master's height; the cells around follow the blister's profile.

Formulas for cells hold for one run, (m,), and for a batch, (m, b); decisions about a master are
made in plain numbers, run by run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Constants, Floats, Modes, count_true
from ..base.modes import FORCE_FOLLOW, SPRING
from ..base.quantity import quantity
from ..model.actuator import Actuator, Supply
from ..model.control_interface import Commands, Measurement, Memory, SetPoint
from ..model.delay import Queue
from ..model.interfaces import Flow
from ..model.laws import import_part
from ..model.layout import RELATIVE_TOLERANCE, Disc
from ..model.physics import GAUSS, Cell
from .blister import Blister, BlisterRule
from .device_info import DeviceInfo, check_floor, suppress_noise
from .ground import GROUNDS, EdgeGround, OwnGround, raise_blister
from .servo import BatchControl, Tracking, lock_overloaded, mark_formed, sum_weighted
from .travel import PARTS, Heading, Rim, measure_excess, update_heading

#: Least share of the total force on the cell in the middle of the fingertip while shaping: 0.23 to
#: 0.33 were measured under a slow fingertip.
HEAVIEST = 0.25
NONE = Constants((0.0,))
#: Least number of runs whose masters are led side by side: for fewer, plain numbers are faster.
MANY = 40
#: Position of an idle master, m, so far away that no cell is in its blister.
NOWHERE = 1e3
#: Largest rise of frozen cells with a blister that searches for the fingertip, as a share of its
#: radius: 1.5 of 15 mm. The paper's pins rise by 1.2 mm within the loss time, fast ones by 5 mm,
#: which would remain as spikes.
CARRIED = 0.1


class Phase(IntEnum):
    """Phase of the master."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2
    LEAVING = 3
    """Shaping under a fingertip that moves off the bed."""


#: Python finds a plain name five times as fast as a member of an enumeration.
IDLE, SPRINGING, SHAPING, LEAVING = Phase


def bound(value: float, least: float, most: float) -> float:
    """Return a number, limited to a range."""
    return least if value < least else most if value > most else value


@dataclass(frozen=True, eq=False)
class LossRule:
    """Rule to give up a fingertip that is not felt for a `time`, s; `period`: control period, s."""

    period: float
    time: float

    def is_given_up(self, alone: int) -> bool:
        """Tell whether a fingertip has not been felt for the loss time; `alone`: control periods."""
        return alone * self.period >= self.time * (1.0 - 1e-9)

    def wait(self, memory: Memory) -> Any:
        """Count a period without a fingertip in a `Master` or `Follower`; give it up after the loss time."""
        if memory.phase is IDLE:
            return memory
        if not self.is_given_up(memory.alone):
            return memory._replace(alone=memory.alone + 1)
        lost = memory.phase is SHAPING
        return memory._replace(phase=IDLE, losses=memory.losses + lost)


class Master(NamedTuple):
    """Memory of the controller."""

    phase: Phase = IDLE
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    opening: float = 0.0
    """Position of the master, m, and opening of its valve."""
    reference: float = 0.0
    edge: float = 0.0
    """Height of the surface at first touch, from which the virtual spring is compressed, and around the
    blister, m."""
    heading: Heading = Heading()
    felt: float = 0.0
    alone: int = 0
    """Height when the fingertip was last felt, m, and control periods since then."""
    losses: int = 0
    """Number of losses of the fingertip while shaping."""

    @property
    def position(self) -> tuple[float, float] | None:
        """Position of the fingertip, m; None if none is followed."""
        return None if self.phase is IDLE else (self.x, self.y)

    @property
    def top(self) -> float:
        """Height of the blister's top, m."""
        return self.height


@dataclass(frozen=True, eq=False)
class MasterCell:
    """One unloaded cell in plain numbers: exact valve opening, averaged flow."""

    openings: tuple[tuple[float, float], ...]
    """At the Gauss points of a control period, then at its end, as ``a K + b K_com``."""
    flow: Flow
    laminar: bool
    """Law of valve and conduit; whether the flow without load is always laminar."""
    supply: Supply
    area: float
    """Area of a pin, m²."""
    stroke: float
    period: float
    """Upper end stop, m; control period, s."""

    def advance(self, height: float, opening: float, command: float) -> tuple[float, float]:
        """Return height, m, and opening after one period of a constant command."""
        (a, b), (c, d), (e, f) = self.openings
        first, second = self.speed(a * opening + b * command), self.speed(c * opening + d * command)
        height += self.period * (0.5 * (first + second))
        return bound(height, 0.0, self.stroke), e * opening + f * command

    def speed(self, opening: float) -> float:
        """Return the speed of the unloaded pin, m/s."""
        drive = self.supply.select(opening) / self.area
        if self.laminar:
            return self.flow.laminar_conductance(opening) * drive
        return float(self.flow.conductance(np.array(opening), np.array(drive * self.area))) * drive


def make_master_cell(cell: Cell, period: float) -> MasterCell:
    """Return the master's cylinder and valve, like those of the real cells; `period`: control period, s."""
    nodes = cell.lag.response(Queue(), [node * period for node in GAUSS] + [period])
    # Without a lag there is no column for the opening at the start.
    openings = tuple((row[0] if cell.lag.rows else 0.0, row[-1]) for row in nodes.tolist())
    laminar = cell.flow.knee > cell.supply.largest
    area, stroke = cell.actuator.area, cell.actuator.stroke
    return MasterCell(openings, cell.flow, laminar, cell.supply, area, stroke, period)


@dataclass(frozen=True, eq=False, repr=False)
class VirtualMaster(Tracking):
    """Gains and thresholds of Method I."""

    force_setpoint: float = quantity(
        0.4,
        "total force held while shaping, and at which shaping starts",
        unit="N",
        symbol="F_ref",
        above=0.0,
    )
    spring_stiffness: float = quantity(
        200.0,
        "stiffness of the virtual spring before shaping",
        unit="N/m",
        symbol="k_VS",
        above=0.0,
    )
    force_gain: float = quantity(
        5.0, "proportional gain of force", unit="1/N", symbol="K_f", at_least=0.0
    )
    radius: float = quantity(
        8e-3,
        "radius of the search for the fingertip around the master",
        unit="m",
        symbol="r_VM",
        source="P",
        above=0.0,
    )
    release_force: float = quantity(
        0.02, "force that releases a frozen cell", unit="N", symbol="F_free", above=0.0
    )
    felt_force: float = quantity(
        1e-3, "total force below which there is no contact", unit="N", symbol="F_0", above=0.0
    )
    loss_time: float = quantity(
        50e-3, "time without force until a loss", unit="s", symbol="t_l", at_least=0.0
    )
    ground: str = quantity(
        "edge",
        "surface from which the blister rises: the mean height at its edge, or each cell's own",
        choices=("edge", "cell"),
        later=True,
    )

    @property
    def set_point(self) -> SetPoint:
        """Set point of all cells together."""
        return SetPoint(self.force_setpoint)


@dataclass(frozen=True, eq=False)
class VirtualMasterControl(BatchControl):
    """Controller of Method I for a bed."""

    parameters: VirtualMaster
    blister: Blister
    actuator: Actuator
    model: MasterCell
    """Cylinder and valve of the master."""
    rim: Rim
    period: float
    lift: float
    floor: float = 0.0
    """Largest force that the high reservoir lifts, and noise floor of a cell's reading, N."""
    ground: EdgeGround | OwnGround = GROUNDS["edge"]
    """Surface from which the blister rises."""

    #: See `following.FollowingControl`.
    division = "PinDivision"

    @property
    def rows(self) -> int:
        """State rows per cell."""
        return self.ground.rows

    @property
    def pin_rows(self) -> range:
        """Rows that fingers share: the ground of a pin before it is in the first blister."""
        return range(self.rows)

    @property
    def blister_radius(self) -> float:
        """Largest distance of pins in the blister from the fingertip, m."""
        return self.blister.radius

    def find_batch_class(self, count: int) -> type[VirtualMasterControl]:
        """Return the class of the controller of a batch of `count` runs."""
        name = "VirtualMasterBatch" if count < MANY else "VirtualMasterColumns"
        return import_part("control.masters", name)

    def begin(self) -> Master:
        """Return the memory before a session."""
        return Master()

    # Decisions about one master, in plain numbers.

    def follow(
        self,
        master: Master,
        total: float,
        x: float,
        y: float,
        near: float,
        near_x: float,
        near_y: float,
    ) -> Master:
        """VM Locate: centroid of the forces near the master; at first touch, of all (equation 13); N, N m."""
        gains = self.parameters
        if total < gains.felt_force:
            return self.loss.wait(master)
        # `_make` of all numbers takes half as long as `_replace`, and happens every period.
        phase, _, _, height, opening, reference, edge, heading, felt, _, losses = master
        if phase is not IDLE:
            if near >= gains.felt_force:
                x, y = round(near_x / near * PARTS) / PARTS, round(near_y / near * PARTS) / PARTS
                reversal, reach = self.reversal, self.rim.reach
                if self.rim.is_under(x, y, reach):
                    # The contact patch varies beside the rim: only a longer way back is a new
                    # direction.
                    reversal = max(reversal, reach)
                heading = update_heading(heading, x, y, gains.travel, reversal)
                return Master._make(
                    (phase, x, y, height, opening, reference, edge, heading, felt, 0, losses)
                )
            # The fingertip has jumped out of reach: a new touch begins.
            losses += 1
        x, y = x / total, y / total
        return Master(SPRINGING, x, y, math.nan, heading=Heading(x, y), losses=losses)

    def is_new(self, master: Master) -> bool:
        """Tell whether a master has located a fingertip, and has no height yet."""
        # A comparison is faster than `isnan`: a batch calls this for each run and period.
        return not master.height > -math.inf

    def lead(self, master: Master, force: float, surface: float, noise: float = 0.0) -> Master:
        """VM Control and VM Model: effort, and the resulting height of a real cell; N, N m, noise N."""
        gains = self.parameters
        phase, x, y, height, opening, reference, edge, heading, felt, alone, losses = master
        if phase is IDLE:
            return master
        if self.is_new(master):
            height = reference = felt = surface / force
            edge = bound(height, 0.0, self.actuator.stroke)
        if alone and self.loss.is_given_up(alone):
            # The rise during the search is undone, or every lift-off would leave a lump.
            height = felt
        else:
            error = gains.force_setpoint - (force + noise)
            if phase is SPRINGING and error > TIE:
                compressed = (force + noise) / gains.spring_stiffness
                effort = gains.position_gain * (reference - compressed - height)
            else:
                effort = gains.force_gain * error
                # Beyond the outer cells, forces no longer show where the fingertip moves.
                leaves = self.rim.is_ahead(x, y, heading.toward_x, heading.toward_y)
                leaves = leaves or (phase is LEAVING and self.rim.is_under(x, y))
                phase = LEAVING if leaves else SHAPING
                effort = min(effort, 0.0) if leaves else effort
            height, opening = self.model.advance(height, opening, bound(effort, -1.0, 1.0))
            felt = height if alone == 0 else felt
        return Master._make(
            (phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)
        )

    def find_disc(self, master: Master) -> Disc | None:
        """Return the disc that a master controls, m."""
        return None if master.phase is IDLE else (master.x, master.y, self.blister.edge_radius)

    def is_active(self, master: Master) -> bool:
        """Tell whether a master follows a fingertip."""
        return master.phase is not IDLE

    def get_pose(self, master: Master) -> tuple[float, float, float, float]:
        """Return the position of a master, m, and its direction of travel."""
        _, _, toward_x, toward_y = master.heading
        if master.phase is IDLE:
            return NOWHERE, NOWHERE, toward_x, toward_y
        return master.x, master.y, toward_x, toward_y

    def set_edge(self, master: Master, level: float, count: int) -> Master:
        """Return a master with the mean height of `count` edge cells; `level`: sum of their heights, m."""
        if not count:
            return master
        phase, x, y, height, opening, reference, _, heading, felt, alone, losses = master
        edge = bound(level / count, 0.0, self.actuator.stroke)
        return Master._make(
            (phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)
        )

    def get_heights(self, master: Master) -> tuple[float, float, np.int8, bool]:
        """Return heights around and of a master, m, mode of felt cells, whether frozen ones stay behind."""
        kind = SPRING if master.phase is SPRINGING else FORCE_FOLLOW
        beyond = master.alone > 0 and master.height - master.felt > CARRIED * self.blister.radius
        return master.edge, master.height, kind, beyond

    @cached_property
    def loss(self) -> LossRule:
        """Rule to give up a fingertip."""
        return LossRule(self.period, self.parameters.loss_time)

    @cached_property
    def reversal(self) -> float:
        """Distance traveled back that reverses the direction, m."""
        return max(self.parameters.travel, self.ground.turning * self.blister.flat_radius)

    # Sums over cells, and their commands: of one run, or of a batch.

    def to_numbers(self, sums: Floats) -> Any:
        """Return sums as `follow`, `lead` and `set_edge` take them: plain numbers, of a batch (b,)."""
        return sums.tolist()

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Any, Any]:
        """Locate the fingertip and move the master; see `Controller`."""
        basis, force = touched.quadratic_basis, touched.force
        if self._noisy:
            force = suppress_noise(force, self.floor)
        x, y, *_ = self.get_pose(memory)
        beyond = measure_excess(x, y, self.parameters.radius * (1.0 + RELATIVE_TOLERANCE), basis)
        (none,) = NONE[force.shape]
        total, *center = self.to_numbers(sum_weighted(basis, force))
        near = self.to_numbers(sum_weighted(basis, np.where(beyond > none, none, force)))
        # Near the master the controlled force includes readings below the noise floor, since they
        # add up; farther away only those above it count, see docs/equations.md.
        hidden = (beyond <= 0.0) & (touched.force < self.floor) if self._noisy else None
        noise = () if hidden is None else (self.to_numbers(sum_weighted(touched.force, hidden)),)
        memory = self.follow(memory, total, *center[:2], *near[:3])
        surface = (
            self.to_numbers(sum_weighted(touched.height, force)) if self.is_new(memory) else total
        )
        memory = self.lead(memory, total, surface, *noise)
        return memory, self.find_disc(memory)

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Create the blister, freeze cells behind it, command every cell; see `Controller`."""
        target = seen.target
        mode = mark_formed(target, *self._limits[target.shape])
        if self.is_active(memory):
            memory, target = self._create_blister(memory, seen, mode)
        command = lock_overloaded(
            self.parameters.command(target, seen.height), seen.force, self.lift
        )
        return memory, Commands(target, mode, command)

    def _create_blister(self, memory: Memory, seen: Measurement, mode: Modes) -> tuple[Any, Floats]:
        """Blister Creation: edge heights, profile, freezing; modes are set in place."""
        cells = self._rule.divide(self.get_pose(memory), seen.quadratic_basis)
        facing = self._rule.find_edge(cells)
        level = self.to_numbers(sum_weighted(seen.height, facing))
        memory = self.set_edge(memory, level, count_true(facing))
        return memory, raise_blister(
            self._rule, self.ground, cells, seen, self.get_heights(memory), mode
        )

    @cached_property
    def _noisy(self) -> bool:
        """Whether the sensors have noise."""
        return bool(np.any(self.floor))

    @cached_property
    def _rule(self) -> BlisterRule:
        """Rule for frozen and touched cells of the blister."""
        gains = self.parameters
        release = (
            np.maximum(gains.release_force, self.floor) if self._noisy else gains.release_force
        )
        return BlisterRule(self.blister, gains.behind, release, self.floor)

    @cached_property
    def _limits(self) -> Constants:
        """Rest height, and distance from it of a formed pin, m."""
        return Constants((self.actuator.rest_height, self.parameters.dead_band))


def build(parameters: VirtualMaster, device: DeviceInfo) -> VirtualMasterControl:
    """Put Method I together for a device; the device has a blister."""
    assert device.blister is not None
    asked = parameters.force_setpoint
    check_floor(HEAVIEST * asked, "force_setpoint", asked, device.force_floor)
    model = make_master_cell(device.cell, device.period)
    parts = parameters, device.blister, device.cell.actuator, model, device.rim
    ground = GROUNDS[parameters.ground]
    return VirtualMasterControl(*parts, device.period, device.overload, device.force_floor, ground)
