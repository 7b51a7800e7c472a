"""Method I: a virtual master cell under the fingertip that leads the blister (Fig. 3 of the paper).

Locate, control, model, create: where the finger presses; a virtual spring until the force
reaches its set point, then force control; a cylinder and valve like a real one turns the
effort into the master's height; the cells around follow the blister's profile.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import any_true, constants, count_true
from ..base.modes import Mode
from ..model.actuator import Actuator
from ..model.interfaces import Measurement, Orders
from ..model.layout import ON_THE_SIDE
from .bench import Bench
from .blister import Blister
from .master import Master, Phase, VirtualMaster
from .master_cell import MasterCell, master_cell
from .noise_floor import above, check_told
from .servo import locked_under_overload
from .travel import ABEAM, Heading, beyond, seen_from, turned

__all__ = ["Master", "Phase", "VirtualMaster", "VirtualMasterControl", "assembled"]

Floats = NDArray[np.float64]

#: Share of the total force that the cell in the middle of the finger carries while shaping, at least: 0.23
#: to 0.33 of it measured while the finger moves slowly.
HEAVIEST = 0.25
CODES = (Mode.EDGE, Mode.BLISTER, Mode.SPRING, Mode.FORCE_FOLLOW, Mode.FROZEN)


@dataclass(frozen=True)
class VirtualMasterControl:
    """Controller of Method I for a bed.

    Attributes
    ----------
    parameters : VirtualMaster
    blister : Blister
    actuator : Actuator
        The cells' cylinders.
    lift : float
        Force the high reservoir can lift, N.
    period : float
        Control period, s.
    model : MasterCell
        The master's own cylinder and valve.
    floor : float
        Force from which on the reading of a cell is no noise, N.
    """

    parameters: VirtualMaster
    blister: Blister
    actuator: Actuator
    lift: float
    period: float
    model: MasterCell
    floor: float = 0.0

    name = "virtual_master"
    rows = 0

    def begin(self) -> Master:
        """Return the memory before a session."""
        return Master()

    def attend(
        self, memory: Master, touched: Measurement
    ) -> tuple[Master, tuple[float, float, float] | None]:
        """Locate the finger and move the master; see `interfaces.Controller`."""
        felt = touched._replace(force=above(touched.force, self.floor)) if self.floor else touched
        pressed = felt.place.dot(felt.force).tolist()[:3]
        master = self._locate(memory, felt, pressed)
        if master.phase is Phase.IDLE:
            return master, None
        # What it rose in search of the finger is taken back, or every lift-off would leave a lump.
        given_up = self._given_up(master)
        master = (
            master._replace(height=master.felt)
            if given_up
            else self._lead(master, self._total(memory, touched, pressed[0]))
        )
        return master, (master.x, master.y, self.blister.edge_radius)

    def _total(self, master: Master, touched: Measurement, felt: float) -> float:
        """Return the force that is controlled, N: of all touched cells, see docs/equations.md.

        Next to the master noise stays in, for what is below the floor adds up; farther off only what is no
        noise counts. `felt` is the sum of that everywhere, N.
        """
        if not self.floor or master.phase is Phase.IDLE:
            return felt
        off = beyond(master.x, master.y, self.parameters.radius * (1.0 + ON_THE_SIDE), touched.place)
        hidden = (off <= 0.0) & (touched.force < self.floor)
        return felt + float(touched.force.dot(hidden))

    def _locate(self, master: Master, touched: Measurement, pressed: list[float]) -> Master:
        """VM Locate: the centroid of the forces near the master; at first touch, of all (equation 13).

        `pressed` are the sum of all forces, N, and their moments with x and y, N m.
        """
        total, x, y = pressed
        known, place, force = self.parameters, touched.place, touched.force
        if total < known.felt_force:
            return self._alone(master)
        if master.phase is not Phase.IDLE:
            none = constants(self.limits, force.shape)[0]
            far = beyond(master.x, master.y, known.radius * (1.0 + ON_THE_SIDE), place) > none
            far &= force != none
            felt = total
            if any_true(far):
                felt, x, y = place.dot(np.where(far, none, force)).tolist()[:3]
            if felt >= known.felt_force:
                x, y = x / felt, y / felt
                return master.at(x, y, turned(master.heading, x, y, known.travel))
            # The finger has jumped out of reach: this is a new touch elsewhere.
            master = master._replace(losses=master.losses + 1)
            _, x, y = pressed
        x, y = x / total, y / total
        surface = float(force @ touched.height) / total
        return Master(
            Phase.SPRING,
            x,
            y,
            surface,
            0.0,
            reference=surface,
            edge=surface,
            felt=surface,
            heading=Heading(x, y),
            losses=master.losses,
        )

    def _alone(self, master: Master) -> Master:
        """Count the periods without a finger; give it up after the loss time."""
        if master.phase is Phase.IDLE:
            return master
        if not self._given_up(master):
            return master._replace(alone=master.alone + 1)
        lost = master.phase is Phase.SHAPING
        return master._replace(phase=Phase.IDLE, losses=master.losses + lost)

    def _given_up(self, master: Master) -> bool:
        """Return whether the finger has been away for longer than the loss time."""
        return master.alone * self.period >= self.parameters.loss_time * (1.0 - 1e-9)

    def _lead(self, master: Master, force: float) -> Master:
        """VM Control and VM Model: the effort, and the height a real cell would make of it."""
        known, phase = self.parameters, master.phase
        if force >= known.force_setpoint:
            phase = Phase.SHAPING
        if phase is Phase.SPRING:
            effort = known.position_gain * (master.reference - force / known.spring_stiffness - master.height)
        else:
            effort = known.force_gain * (known.force_setpoint - force)
        height, opening = self.model.after(master.height, master.opening, min(max(effort, -1.0), 1.0))
        return master.led(phase, height, opening)

    def command(self, memory: Master, seen: Measurement) -> tuple[Master, Orders]:
        """Create the blister, freeze what is left behind, command every cell; see `interfaces.Controller`."""
        target, mode = seen.target, self._left_alone(seen.target)
        if memory.phase is not Phase.IDLE:
            memory, target = self._created(memory, seen, mode)
        command = locked_under_overload(
            self.parameters.servo.command(target, seen.height), seen.force, self.lift
        )
        return memory, Orders(target, mode, command)

    def _left_alone(self, target: Floats) -> NDArray[np.int8]:
        """Return the modes of cells outside the blister: formed ones hold, the others rest."""
        rest, band = constants(self.limits, target.shape)[-2:]
        off = target - rest
        np.abs(off, off)
        # False and True are the codes of these two modes.
        mode: NDArray[np.int8] = (off > band).view(np.int8)
        return mode

    def _created(self, master: Master, seen: Measurement, mode: NDArray[np.int8]) -> tuple[Master, Floats]:
        """Blister Creation: edge heights, profile, freezing; modes are set in place."""
        blister, stroke = self.blister, self.actuator.stroke
        limits = constants(self.limits, seen.target.shape)
        _, abeam, radius, edge_radius, flat_radius, behind, release, noise, *_ = limits
        edge, formed, spring, follow, froze = constants(CODES, seen.target.shape, np.int8)
        distance, ahead = seen_from(master.heading, master.x, master.y, seen.place)
        inside = distance <= radius
        ring = distance <= edge_radius
        ring ^= inside
        # While the master travels, only what lies ahead counts: the finished ridge behind is no edge.
        facing = ahead >= abeam
        facing &= ring
        count = count_true(facing)
        if count:
            master = master.with_edge(float(facing.astype(np.float64).dot(seen.height)) / count)
        frozen = ahead < behind * distance
        frozen &= distance > flat_radius
        frozen |= seen.mode == froze
        frozen &= inside
        frozen &= seen.force < release
        profile = blister.surface(distance, min(max(master.edge, 0.0), stroke), master.height)
        if any_true(frozen):
            # What is frozen is never called back; a blister that outgrows it takes it along.
            outgrown = np.maximum if master.height >= master.edge else np.minimum
            np.putmask(profile, frozen, outgrown(profile, seen.target))
        target = seen.target.copy()
        np.putmask(target, inside, profile)
        touched = seen.force > noise
        touched &= inside
        np.putmask(mode, inside, formed)
        np.putmask(mode, touched, follow if master.phase is Phase.SHAPING else spring)
        np.putmask(mode, ring, edge)
        np.putmask(mode, frozen, froze)
        return master, target

    @cached_property
    def limits(self) -> tuple[float, ...]:
        """Thresholds of the cells.

        No force; how far ahead; radii of blister, edge and flat top, m; a cosine; forces, N; the
        height of a pin at rest, and how far from it one counts as formed, m. Circles are widened
        by a billionth, for the sake of cells exactly on them.
        """
        blister = self.blister
        wider = (
            radius * (1.0 + ON_THE_SIDE)
            for radius in (blister.radius, blister.edge_radius, blister.flat_radius)
        )
        known = self.parameters
        rest = self.actuator.rest_height, known.dead_band
        release = max(known.release_force, self.floor)
        return (0.0, -ABEAM, *wider, known.behind, release, self.floor, *rest)


def assembled(parameters: VirtualMaster, bench: Bench) -> VirtualMasterControl:
    """Put Method I together for a device; the bench has a blister."""
    assert bench.blister is not None
    asked = parameters.force_setpoint
    check_told(HEAVIEST * asked, "force_setpoint", asked, bench.force_floor)
    model = master_cell(bench.cell, bench.period)
    return VirtualMasterControl(
        parameters, bench.blister, bench.cell.actuator, bench.lift, bench.period, model, bench.force_floor
    )
