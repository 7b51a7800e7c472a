"""Virtual master of Method I: gains, memory, model of its cell, and the decisions of a control period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.actuator import Actuator
from ..model.control_interface import SetPoint
from ..model.delay import Queue
from ..model.interfaces import Flow
from ..model.physics import GAUSS, Cell
from .blister import Blister
from .runs import BatchControl
from .servo import Tracking
from .travel import Heading, update_heading


class Phase(IntEnum):
    """Phase of the master."""

    IDLE = 0
    SPRING = 1
    SHAPING = 2


@dataclass(frozen=True)
class LossRule:
    """Rule by which a fingertip that is no longer felt is given up.

    Attributes
    ----------
    period : float
        Control period, s.
    time : float
        Time without force until a loss, s.
    """

    period: float
    time: float

    def is_given_up(self, alone: int) -> bool:
        """Tell whether a fingertip not felt for some control periods has been away for the loss time."""
        return alone * self.period >= self.time * (1.0 - 1e-9)

    def wait(self, memory: Any) -> Any:
        """Count a period without a fingertip in a `Master` or `Follower`; give it up after the loss time."""
        if memory.phase is Phase.IDLE:
            return memory
        if not self.is_given_up(memory.alone):
            return memory._replace(alone=memory.alone + 1)
        lost = memory.phase is Phase.SHAPING
        return memory._replace(phase=Phase.IDLE, losses=memory.losses + lost)


class Master(NamedTuple):
    """Memory of the controller.

    Attributes
    ----------
    x, y, height : float
        Where the master is, m.
    opening : float
        Of its own valve.
    reference : float
        Surface height at first touch, from which the virtual spring is pressed down, m.
    edge : float
        Height of the surface around the blister, m.
    heading : Heading
        Which way it travels.
    felt : float
        Its height when the finger was last felt, m.
    alone : int
        Control periods since the finger was last felt.
    losses : int
        How often the finger was lost while shaping.
    """

    phase: Phase = Phase.IDLE
    x: float = 0.0
    y: float = 0.0
    height: float = 0.0
    opening: float = 0.0
    reference: float = 0.0
    edge: float = 0.0
    heading: Heading = Heading()
    felt: float = 0.0
    alone: int = 0
    losses: int = 0

    # What changes every period is written out: `_replace` takes nearly twice as long.

    def move_to(self, x: float, y: float, heading: Heading) -> Master:
        """Return the master where it has felt the finger. `x`, `y`, m."""
        phase, _, _, height, opening, reference, edge, _, felt, _, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, 0, losses)

    def lead(self, phase: Phase, height: float, opening: float) -> Master:
        """Return the master after a period, with its valve's opening.

        `height`, m; `opening`: of its valve.
        """
        _, x, y, _, _, reference, edge, heading, felt, alone, losses = self
        felt = height if alone == 0 else felt
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)

    def with_edge(self, edge: float) -> Master:
        """Return the master in a surface of this height."""
        phase, x, y, height, opening, reference, _, heading, felt, alone, losses = self
        return Master(phase, x, y, height, opening, reference, edge, heading, felt, alone, losses)


@dataclass(frozen=True)
class MasterCell:
    """One unloaded cell in plain numbers: exact valve opening, averaged flow.

    Attributes
    ----------
    openings : tuple of (float, float)
        The opening at the Gauss points of a control period, then at its end, as
        ``a K + b K_com``.
    flow : Flow
        The law of valve and conduit.
    laminar : bool
        No unloaded valve is turbulent.
    up, down : float
        Pressures of the reservoirs over the area of a pin, Pa/m².
    area : float
        Of a pin, m².
    stroke : float
        Upper end stop, m.
    period : float
        Control period, s.
    """

    openings: tuple[tuple[float, float], ...]
    flow: Flow
    laminar: bool
    up: float
    down: float
    area: float
    stroke: float
    period: float

    def advance(self, height: float, opening: float, command: float) -> tuple[float, float]:
        """Return height, m, and opening after one period of a held command. `height`, m."""
        (a, b), (c, d), (e, f) = self.openings
        first, second = a * opening + b * command, c * opening + d * command
        speed = 0.5 * (self.speed(first) + self.speed(second))
        return min(max(height + self.period * speed, 0.0), self.stroke), e * opening + f * command

    def speed(self, opening: float) -> float:
        """Return the speed of the unloaded pin, m/s."""
        drive = self.up if opening > 0.0 else self.down
        if self.laminar:
            speed: float = self.flow.laminar_conductance(opening) * drive
            return speed
        return float(self.flow.conductance(np.array(opening), np.array(drive * self.area))) * drive


def make_master_cell(cell: Cell, period: float) -> MasterCell:
    """Make the master's cylinder and valve like those of the real cells. `period`: control period, s."""
    nodes = cell.lag.response(Queue(), [node * period for node in GAUSS] + [period])
    # Without a lag there is no column for the opening at the start.
    openings = tuple((row[0] if cell.lag.rows else 0.0, row[-1]) for row in nodes.tolist())
    laminar = cell.flow.knee > cell.supply.largest
    area, stroke = cell.actuator.area, cell.actuator.stroke
    up, down = cell.supply.high / area, cell.supply.low / area
    return MasterCell(openings, cell.flow, laminar, up, down, area, stroke, period)


#: Where an idle master of a batch stands, m: so far away that no cell is in its blister.
NOWHERE = 1e3
#: Share of its radius that a blister in search of the finger may take along what is frozen: 1.5 mm of 15 mm.
#: The paper's pins rise by 1.2 mm within the loss time, quick ones by 5 mm, which would be left as spikes.
CARRIED = 0.1
#: Plain numbers: numpy takes an enumeration's member ten times as long.
SPRING, FORCE_FOLLOW = int(Mode.SPRING), int(Mode.FORCE_FOLLOW)


@dataclass(frozen=True)
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
        200.0, "stiffness of the virtual spring before shaping", unit="N/m", symbol="k_VS", above=0.0
    )
    force_gain: float = quantity(5.0, "proportional gain of force", unit="1/N", symbol="K_f", at_least=0.0)
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
class MasterControl(BatchControl):
    """Decisions about one virtual master in a control period, in plain numbers.

    Attributes
    ----------
    actuator : Actuator
        The cells' cylinders.
    model : MasterCell
        The master's own cylinder and valve.
    period : float
        Control period, s.
    """

    parameters: VirtualMaster
    blister: Blister
    actuator: Actuator
    model: MasterCell
    period: float

    @property
    def reversal(self) -> float:
        """Distance traveled back that reverses the direction, m."""
        return self.parameters.travel

    def follow(
        self, master: Master, total: float, x: float, y: float, near: float, near_x: float, near_y: float
    ) -> Master:
        """VM Locate: the centroid of the forces near the master; at first touch, of all (equation 13).

        `total`, `x`, `y`: sum of the forces on all cells, N, and their moments with x and y, N m; `near`,
        `near_x`, `near_y`: those of the cells near the master. Returns where it has found a finger, `is_new`:
        to be put into the surface by `set_surface`.
        """
        known = self.parameters
        if total < known.felt_force:
            waiting: Master = self._loss.wait(master)
            return waiting
        if master.phase is not Phase.IDLE:
            if near >= known.felt_force:
                x, y = near_x / near, near_y / near
                return master.move_to(x, y, update_heading(master.heading, x, y, known.travel, self.reversal))
            # The finger has jumped out of reach: this is a new touch elsewhere.
            master = master._replace(losses=master.losses + 1)
        x, y = x / total, y / total
        return Master(Phase.SPRING, x, y, math.nan, heading=Heading(x, y), losses=master.losses)

    def is_new(self, master: Master) -> bool:
        """Tell whether a master has found a finger, and is not in the surface yet."""
        # It has no height yet; a comparison, since a batch asks once a run and period.
        return not master.height > -math.inf

    def set_surface(self, master: Master, total: float, surface: float) -> Master:
        """Put a master that has found a finger into the surface; others stay where they are.

        `total`: sum of the forces on all cells, N; `surface`: sum of force times height, N m.
        """
        if not self.is_new(master):
            return master
        height = surface / total
        edge = min(max(height, 0.0), self.actuator.stroke)
        return master._replace(height=height, reference=height, edge=edge, felt=height)

    @cached_property
    def _loss(self) -> LossRule:
        """When a finger is given up."""
        return LossRule(self.period, self.parameters.loss_time)

    def lead(self, master: Master, force: float) -> Master:
        """VM Control and VM Model: the effort, and the height a real cell would make of it.

        `force`: total force on the bed, N.
        """
        known, phase = self.parameters, master.phase
        if phase is Phase.IDLE:
            return master
        # What it rose in search of the finger is taken back, or every lift-off would leave a lump.
        if self._loss.is_given_up(master.alone):
            return master._replace(height=master.felt)
        if force >= known.force_setpoint:
            phase = Phase.SHAPING
        if phase is Phase.SPRING:
            effort = known.position_gain * (master.reference - force / known.spring_stiffness - master.height)
        else:
            effort = known.force_gain * (known.force_setpoint - force)
        height, opening = self.model.advance(master.height, master.opening, min(max(effort, -1.0), 1.0))
        return master.lead(phase, height, opening)

    def add_noise(self, master: Master, felt: float, noise: float) -> float:
        """Return the controlled force with what noise hides, N, once there is a master to be near to.

        `felt`, `noise`, N.
        """
        return felt if master.phase is Phase.IDLE else felt + noise

    def find_disc(self, master: Master) -> tuple[float, float, float] | None:
        """Return the disc that a master controls, m."""
        return None if master.phase is Phase.IDLE else (master.x, master.y, self.blister.edge_radius)

    def is_active(self, master: Master) -> bool:
        """Tell whether a master follows a finger."""
        return master.phase is not Phase.IDLE

    def get_place(self, master: Master) -> tuple[float, float]:
        """Return where a master is, m."""
        return master.x, master.y

    def get_pose(self, master: Master) -> tuple[float, float, float, float]:
        """Return where a master is, m, and which way it travels."""
        _, _, toward_x, toward_y = master.heading
        if master.phase is Phase.IDLE:
            return NOWHERE, NOWHERE, toward_x, toward_y
        return master.x, master.y, toward_x, toward_y

    def set_edge(self, master: Master, level: float, count: int) -> Master:
        """Put a master into a surface whose height is the mean of some cells'; `level` is their sum, m.

        `level`: sum of the heights, m; `count`: cells in the sum.
        """
        return master.with_edge(min(max(level / count, 0.0), self.actuator.stroke)) if count else master

    def get_heights(self, master: Master) -> tuple[float, float, int, bool]:
        """Return what the blister is made of.

        Returns `edge`, `top`: heights of the surface around a master and of itself, m; `kind`: mode of felt
        cells; `beyond`: whether it has risen farther in search of the finger than what is frozen goes along.
        """
        kind = FORCE_FOLLOW if master.phase is Phase.SHAPING else SPRING
        beyond = master.alone > 0 and master.height - master.felt > CARRIED * self.blister.radius
        return master.edge, master.height, kind, beyond
