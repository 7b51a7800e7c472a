"""Method I for a batch: `control.virtual_master` with an axis for the runs.

See there for what it does and why. Where a single run asks "if", here all runs go both ways, and
`np.where` or a mask takes what holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..control.blister import Blister
from ..control.master import Master, Phase, VirtualMaster
from ..control.travel import ABEAM, Heading
from ..control.virtual_master import VirtualMasterControl
from ..model.actuator import Actuator
from ..model.interfaces import Measurement, Orders
from ..model.layout import ON_THE_SIDE
from ..model.physics import Cell
from .beds import Disc
from .broadcasting import Floats, numbers, together

__all__ = ["Masters", "VirtualMasters", "virtual_masters"]

Flags = NDArray[np.bool_]


EDGE, BLISTER, SPRING, FORCE_FOLLOW, FROZEN = (
    np.int8(mode) for mode in (Mode.EDGE, Mode.BLISTER, Mode.SPRING, Mode.FORCE_FOLLOW, Mode.FROZEN)
)
#: `Phase` as plain numbers: numpy compares with those ten times as fast.
IDLE, SPRINGING, SHAPING = (float(phase) for phase in Phase)


class Masters(NamedTuple):
    """The memory of all runs; (b,) each, see `control.master.Master`."""

    phase: Floats
    x: Floats
    y: Floats
    height: Floats
    opening: Floats
    reference: Floats
    edge: Floats
    settled_x: Floats
    settled_y: Floats
    toward_x: Floats
    toward_y: Floats
    felt: Floats
    alone: Floats
    losses: Floats

    def where(self, chosen: Flags, other: Masters) -> Masters:
        """Return these masters, but the others in the chosen runs (b,)."""
        return Masters(*(np.where(chosen, new, old) for new, old in zip(other, self, strict=True)))


@dataclass(frozen=True, eq=False)
class VirtualMasters:
    """Method I, put together for a stack; numbers are arrays (b,) where runs differ.

    Attributes
    ----------
    parameters : VirtualMaster
    blister : Blister
    actuator : Actuator
    cell : Cell
        The master's cylinder and valve are like the cells'.
    lift : ndarray (b,)
        Force the high reservoir can lift, N.
    period : ndarray (b,)
        Control period, s.
    nodes : tuple of (ndarray, ndarray)
        The master's opening at the Gauss points of a control period, then at its end, as
        ``a K + b K_com``; (b,) each.
    laminar : bool
        No unloaded valve is turbulent, in any run.
    """

    parameters: VirtualMaster
    blister: Blister
    actuator: Actuator
    cell: Cell
    lift: Floats
    period: Floats
    nodes: tuple[tuple[Floats, Floats], ...]
    laminar: bool

    def begin(self) -> Masters:
        """Return the memory before the sessions."""
        return Masters(*(np.zeros_like(self.period) for _ in Masters._fields))

    def attend(self, memory: Masters, touched: Measurement) -> tuple[Masters, Disc]:
        """Locate the fingers and move the masters; see `StackedController`."""
        force = np.add.reduce(touched.force)
        master = self._locate(memory, touched, force)
        active = master.phase != IDLE
        # What it rose in search of the finger is taken back, or every lift-off would leave a lump.
        given_up = self._given_up(master)
        led = self._led(master, force)
        height = np.where(given_up, master.felt, led.height)
        master = master._replace(
            phase=np.where(active & ~given_up, led.phase, master.phase),
            height=np.where(active, height, master.height),
            opening=np.where(active & ~given_up, led.opening, master.opening),
            felt=np.where(active & ~given_up, led.felt, master.felt),
        )
        return master, (master.x, master.y, np.where(active, self.blister.edge_radius, -1.0))

    def _locate(self, master: Masters, touched: Measurement, total: Floats) -> Masters:
        """VM Locate: the centroid of the forces near the master; at first touch, of all (equation 13)."""
        known, place, force = self.parameters, touched.place, touched.force
        active, present = master.phase != IDLE, total >= known.felt_force
        dx, dy = place[1] - master.x, place[2] - master.y
        near = force * (dx * dx + dy * dy <= (known.radius * (1.0 + ON_THE_SIDE)) ** 2)
        felt = np.add.reduce(near)
        followed = active & present & (felt >= known.felt_force)
        # Where nothing is felt the quotient is of no use, but it must be a number.
        weight = np.where(followed, felt, 1.0)
        x = np.add.reduce(place[1] * near) / weight
        y = np.add.reduce(place[2] * near) / weight
        way_x, way_y = x - master.settled_x, y - master.settled_y
        way = np.hypot(way_x, way_y)
        turns = followed & (way >= known.travel)
        way = np.where(turns, way, 1.0)
        gone = active & ~present
        given_up = gone & self._given_up(master)
        after = master._replace(
            phase=np.where(given_up, IDLE, master.phase),
            x=np.where(followed, x, master.x),
            y=np.where(followed, y, master.y),
            settled_x=np.where(turns, x, master.settled_x),
            settled_y=np.where(turns, y, master.settled_y),
            toward_x=np.where(turns, way_x / way, master.toward_x),
            toward_y=np.where(turns, way_y / way, master.toward_y),
            alone=np.where(followed, 0.0, master.alone + (gone & ~given_up)),
            losses=master.losses + (given_up & (master.phase == SHAPING)),
        )
        new = present & ~followed
        return after.where(new, self._touching_down(master, touched, total)) if new.any() else after

    def _touching_down(self, master: Masters, touched: Measurement, total: Floats) -> Masters:
        """Return new masters; one that was active has lost its finger, which has jumped out of reach."""
        weight = np.where(total > 0.0, total, 1.0)
        x, y, surface = (
            (values * touched.force).sum(axis=0) / weight
            for values in (touched.place[1], touched.place[2], touched.height)
        )
        none = np.zeros_like(x)
        return Masters(
            phase=none + SPRINGING,
            x=x, y=y, height=surface, opening=none, reference=surface, edge=surface,
            settled_x=x, settled_y=y, toward_x=none, toward_y=none, felt=surface, alone=none,
            losses=master.losses + (master.phase != IDLE),
        )  # fmt: skip

    def _given_up(self, master: Masters) -> Flags:
        """Tell where the finger has been away for longer than the loss time."""
        away: Flags = master.alone * self.period >= self.parameters.loss_time * (1.0 - 1e-9)
        return away

    def _led(self, master: Masters, force: Floats) -> Masters:
        """VM Control and VM Model: the effort, and the height a real cell would make of it."""
        known = self.parameters
        phase = np.where(force >= known.force_setpoint, SHAPING, master.phase)
        sprung = known.position_gain * (master.reference - force / known.spring_stiffness - master.height)
        effort = np.where(phase == SPRINGING, sprung, known.force_gain * (known.force_setpoint - force))
        effort = np.minimum(np.maximum(effort, -1.0), 1.0)
        *nodes, opening = (a * master.opening + b * effort for a, b in self.nodes)
        rise = self.period * sum(self._speed(node) for node in nodes) / len(nodes)
        height = np.minimum(np.maximum(master.height + rise, 0.0), self.actuator.stroke)
        felt = np.where(master.alone == 0.0, height, master.felt)
        return master._replace(phase=phase, height=height, opening=opening, felt=felt)

    def _speed(self, opening: Floats) -> Floats:
        """Return the speed of an unloaded pin, m/s."""
        flow, pressure = self.cell.flow, self.cell.supply.pressure(opening)
        if self.laminar:
            speed: Floats = flow.laminar_conductance(opening) * pressure / self.actuator.area
            return speed
        return flow.flow(opening, pressure) / self.actuator.area

    def command(self, memory: Masters, seen: Measurement) -> tuple[Masters, Orders]:
        """Create the blisters, freeze what is left behind, command every cell; see `StackedController`."""
        known = self.parameters
        # False and True are the codes of rest and of a formed height that is held.
        formed = np.abs(seen.target - self.actuator.rest_height) > known.dead_band
        mode: NDArray[np.int8] = formed.view(np.int8)
        memory, target = self._created(memory, seen, mode)
        error = target - seen.height
        command = np.minimum(np.maximum(error * known.position_gain, -1.0), 1.0)
        np.putmask(command, np.abs(error) <= known.dead_band, 0.0)
        overloaded = seen.force >= self.lift
        if overloaded.any():
            np.putmask(command, overloaded & (command > 0.0), 0.0)
        return memory, Orders(target, mode, command)

    def _created(self, master: Masters, seen: Measurement, mode: NDArray[np.int8]) -> tuple[Masters, Floats]:
        """Blister Creation: edge heights, profile, freezing; modes are set in place."""
        blister, known, active = self.blister, self.parameters, master.phase != IDLE
        dx, dy = seen.place[1] - master.x, seen.place[2] - master.y
        distance = dx * dx
        distance += dy * dy
        np.sqrt(distance, distance)
        ahead = dx * master.toward_x
        ahead += dy * master.toward_y
        inside = distance <= np.where(active, blister.radius * (1.0 + ON_THE_SIDE), -1.0)
        ring = distance <= np.where(active, blister.edge_radius * (1.0 + ON_THE_SIDE), -1.0)
        ring ^= inside
        # While a master travels, only what lies ahead counts: the finished ridge behind is no edge.
        facing = ring & (ahead >= -ABEAM)
        count = np.count_nonzero(facing, axis=0)
        level = np.add.reduce(seen.height * facing) / np.maximum(count, 1)
        master = master._replace(edge=np.where(count > 0, level, master.edge))
        backward = ahead < known.behind * distance
        backward &= distance > blister.flat_radius * (1.0 + ON_THE_SIDE)
        backward |= seen.mode == FROZEN
        backward &= inside
        frozen = backward & (seen.force < known.release_force)
        profile = self._shape(distance)
        edge = np.minimum(np.maximum(master.edge, 0.0), self.actuator.stroke)
        profile *= master.height - edge
        profile += edge
        # What is frozen is never called back; a blister that outgrows it takes it along.
        beyond = seen.target > profile
        beyond ^= master.height < master.edge
        beyond &= frozen
        np.putmask(profile, beyond, seen.target)
        target = seen.target.copy()
        np.putmask(target, inside, profile)
        np.putmask(mode, inside, BLISTER)
        under = inside & (seen.force > 0.0)
        np.putmask(mode, under, SPRING)
        np.putmask(mode, under & (master.phase == SHAPING), FORCE_FOLLOW)
        np.putmask(mode, ring, EDGE)
        np.putmask(mode, frozen, FROZEN)
        return master, target

    def _shape(self, distance: Floats) -> Floats:
        """Return the profile p(r), see `control.blister.Blister.shape`."""
        blister = self.blister
        if blister.profile == "gaussian":
            bell: Floats = np.exp(distance * distance * (-0.5 / blister.sigma**2))
            return bell
        cone: Floats = blister.radius - distance
        cone *= 1.0 / (blister.radius - blister.flat_radius)
        np.minimum(cone, 1.0, out=cone)
        return cone

    def kept(self, memory: Masters, runs: NDArray[np.intp]) -> Masters:
        """Return the memory of some of the runs."""
        return Masters(*(column[runs] for column in memory))

    def of(self, memory: Masters, run: int) -> Master:
        """Return the memory of one run as its own controller would have it."""
        own = {name: float(column[run]) for name, column in memory._asdict().items()}
        heading = Heading(*(own.pop(name) for name in ("settled_x", "settled_y", "toward_x", "toward_y")))
        phase, alone, losses = Phase(int(own.pop("phase"))), int(own.pop("alone")), int(own.pop("losses"))
        return Master(phase=phase, heading=heading, alone=alone, losses=losses, **own)


def virtual_masters(controllers: Sequence[VirtualMasterControl], cell: Cell, laminar: bool) -> VirtualMasters:
    """Put Method I together for a stack.

    Parameters
    ----------
    controllers : sequence of VirtualMasterControl
        Those of the runs.
    cell : Cell
        Of all runs.
    laminar : bool
        No unloaded valve is turbulent, in any run.
    """
    openings = [controller.model.openings for controller in controllers]
    return VirtualMasters(
        together([controller.parameters for controller in controllers]),
        together([controller.blister for controller in controllers]),
        cell.actuator,
        cell,
        numbers([controller.lift for controller in controllers]),
        numbers([controller.period for controller in controllers]),
        tuple(
            (numbers([a for a, _ in pairs]), numbers([b for _, b in pairs]))
            for pairs in zip(*openings, strict=True)
        ),
        laminar,
    )
