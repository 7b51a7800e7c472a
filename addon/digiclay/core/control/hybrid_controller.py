"""Control period of Method III: observe the pulp, fit the finger, solve for the height, drive the pins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Constants, Floats
from ..model.control_interface import Commands, Measurement
from ..model.layout import enclose_discs
from .blister import Blister
from .blister_cells import BlisterRule
from .device_info import DeviceInfo
from .finger_estimate import Estimate, FingerFilter
from .flow_servo import FlowServo
from .force_height import Reach, find_top, lead_heights
from .hybrid_memory import Follower
from .hybrid_parameters import Hybrid
from .hybrid_rows import OWN_ROWS, OwnRows, number_rows
from .lead_profile import LeadProfile
from .led_blister import LedBlister, Region
from .master_memory import LossRule, Master, Phase
from .pulp_estimate import PulpEstimate
from .travel import Heading, update_heading
from .virtual_master import VirtualMasterControl

#: Share of the set point within which the force counts as held: then the trim learns; it is at most as large.
LEARNED = 0.5
#: While the force is within this share of the set point, and the finger no faster than this, m/s, the finger
#: is fitted and the top solved for in one of so many periods; in the others the top goes along with it.
HELD, SLOW, EVERY = 0.02, 20e-3, 2
#: How far a touched cell may be from the predicted place of the finger, in semi-axes: beyond is a new touch.
JUMP = 1.5
#: Underside where none is predicted, m.
AWAY = 1.0
#: Share of the set point by which the forces predicted may be off, rms over that many control periods: beyond
#: it the model is wrong, and Method I follows the fingertip until it is lost. A lift at 22 mm/s has 0.28.
DOUBTED, PERIODS = 0.4, 20.0


class Moved(NamedTuple):
    """Motion of the cells that no command of this period changes.

    Attributes
    ----------
    limits : ndarray (2, m)
        Lowest and highest speeds, m/s.
    coasted : ndarray (m,)
        Heights at which earlier commands leave them, m.
    """

    limits: Floats
    coasted: Floats


@dataclass(frozen=True, eq=False)
class HybridControl:
    """Controller of Method III for a bed.

    Attributes
    ----------
    parameters : Hybrid
    blister : Blister
    device : DeviceInfo
    pulp : PulpEstimate
    finger : FingerFilter
    profile : LeadProfile
    servo : FlowServo
    felt : float
        Force above which a cell is touched, N.
    noise : float
        Standard deviation of forces, N.
    contact_radius : float
        Within which the finger may touch, m.
    substitute : VirtualMasterControl
        Method I, for a finger that the model does not predict.
    """

    parameters: Hybrid
    blister: Blister
    device: DeviceInfo
    pulp: PulpEstimate
    finger: FingerFilter
    profile: LeadProfile
    servo: FlowServo
    felt: float
    noise: float
    contact_radius: float
    substitute: VirtualMasterControl

    name = "hybrid"

    @cached_property
    def farthest(self) -> float:
        """Distance from the predicted place beyond which a touch is a new one, m."""
        return JUMP * max(self.finger.fingertip.length, self.finger.fingertip.width)

    @cached_property
    def _unknown(self) -> tuple[float, ...]:
        """Forces until the heights aimed at, of which none is predicted."""
        return (-1.0,) * max(1, round(self.servo.ahead / self.device.period))

    @cached_property
    def _loss(self) -> LossRule:
        """When a finger is given up."""
        return LossRule(self.device.period, self.parameters.loss_time)

    @cached_property
    def _surface(self) -> LedBlister:
        """Blister and the pins led ahead of it."""
        known = self.parameters
        rule = BlisterRule(self.blister, known.behind, max(known.release_force, self.felt), self.felt)
        return LedBlister(self.blister, rule, self.profile, self.servo.ahead)

    @cached_property
    def _limits(self) -> Constants:
        """Height of a pin at rest, how far from it one counts as formed, and its end stops, m."""
        actuator = self.device.cell.actuator
        return Constants((actuator.rest_height, self.parameters.dead_band, 0.0, actuator.stroke))

    @cached_property
    def _at(self) -> OwnRows:
        """Numbers of a cell's rows."""
        return number_rows(self.pulp.filters)

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.pulp.filters + OWN_ROWS + self.servo.rows

    def begin(self) -> Follower:
        """Return the memory before a session."""
        return Follower(due=self._unknown)

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, Any]:
        """Observe the pulp, and fit the finger; see `Controller`."""
        if memory.master.phase is not Phase.IDLE:
            return self._substitute(memory, touched)
        idle, period = memory.phase is Phase.IDLE, memory.period + 1
        estimate = memory.estimate if idle else self.finger.predict(memory.estimate)
        memory = memory._replace(period=period, estimate=estimate)
        memory = self._observe(memory, touched) if touched.force.size else self._loss.wait(memory)
        return memory, self._surface.find_disc(memory)

    def _substitute(self, memory: Follower, touched: Measurement) -> tuple[Follower, Any]:
        """Let Method I follow the finger; the next one is predicted again."""
        master, disc = self.substitute.locate(memory.master, touched)
        if memory.led_radius:
            led = (memory.led_x, memory.led_y, memory.led_radius)
            disc = enclose_discs(disc, led) if disc else led
        period, phase, losses = memory.period + 1, master.phase, master.losses
        return memory._replace(period=period, phase=phase, losses=losses, master=master), disc

    def _observe(self, memory: Follower, touched: Measurement) -> Follower:
        """Observe the pulp of the cells the finger may touch, and follow or find the finger."""
        at, own, force = self._at, touched.own, touched.force
        late = (memory.period - 1.0) - own[at.stamp]
        if np.count_nonzero(late):
            self.pulp.age(own[at.pulp], late * (own[at.stamp] > 0.0))
            np.putmask(own[at.later], late, AWAY)
            np.putmask(own[at.coming], late, AWAY)
        own[at.stamp] = memory.period
        (felt,) = (force > self.felt).nonzero()
        if memory.phase is Phase.IDLE:
            self.pulp.observe(own[at.pulp], force, np.zeros(force.size))
            own[at.coming] = own[at.later] = AWAY
            return self._find(memory, touched, felt) if felt.size else memory
        expected = self.pulp.touch.contact.tension(touched.height - own[at.coming])
        (here,) = self.pulp.observe(own[at.pulp], force, expected).nonzero()
        own[at.coming] = own[at.later]
        if not felt.size and not self._is_felt(force.take(here)):
            own[at.residual] = 0.0
            waiting: Follower = self._loss.wait(memory)
            return waiting
        if memory.period % EVERY and self._holds(memory, float(np.add.reduce(force))):
            return memory if not memory.alone else memory._replace(alone=0)
        own[at.residual] = 0.0
        if felt.size and self._has_jumped(memory.estimate, touched.quadratic_basis.take(felt, 1)):
            return self._find(memory._replace(losses=memory.losses + 1), touched, felt)
        return self._fit(memory, touched, here, touched.quadratic_basis.take(here, 1))

    def _is_felt(self, force: Floats) -> bool:
        """Tell whether forces under the predicted fingertip, N, are more than their noise together."""
        return float(np.add.reduce(force)) > self.felt * math.sqrt(force.size)

    def _holds(self, memory: Follower, force: float) -> bool:
        """Tell whether a finger is slow, and a total force, N, near the set point: then less is solved."""
        _, _, _, vx, vy, vz, *_ = memory.estimate.mean.tolist()
        error = abs(force - self.parameters.force_setpoint)
        return error <= HELD * self.parameters.force_setpoint and math.hypot(vx, vy, vz) <= SLOW

    def _has_jumped(self, guess: Estimate, basis: Floats) -> bool:
        """Tell whether no touched cell is where the finger can be."""
        place, (_, x, y) = tuple(guess.mean[:2].tolist()), basis[:3].tolist()
        return not any(math.dist(place, cell) <= self.farthest for cell in zip(x, y, strict=True))

    def _find(self, memory: Follower, touched: Measurement, here: NDArray[np.intp]) -> Follower:
        """Begin to follow a finger that has touched: at the centroid of its forces (equation 13)."""
        force, basis = touched.force.take(here), touched.quadratic_basis.take(here, 1)
        under, _ = self.pulp.find_underside(
            touched.height.take(here), touched.own[self._at.tension].take(here), self.noise
        )
        rows = np.vstack((basis[:3], under, touched.height.take(here)))
        total, x, y, z, height = rows.dot(force).tolist()
        x, y, height = x / total, y / total, height / total
        memory = Follower(
            Phase.SHAPING,
            memory.period,
            self.finger.begin(x, y, z / total),
            height,
            height,
            Heading(x, y),
            felt=height,
            losses=memory.losses,
            due=self._unknown,
        )
        return self._fit(memory, touched, here, basis)

    def _fit(self, memory: Follower, touched: Measurement, here: NDArray[np.intp], basis: Floats) -> Follower:
        """Fit the finger to the undersides over the touched cells, whose basis is given."""
        seen, noise = self.pulp.find_underside(
            touched.height.take(here), touched.own[self._at.tension].take(here), self.noise
        )
        noise *= noise
        noise += self.finger.spread.underside**2
        at = self.finger.measure(memory.estimate.mean, basis)
        estimate, left = self.finger.correct(memory.estimate, at, seen, noise)
        x, y = estimate.mean[:2].tolist()
        if not math.dist((x, y), memory.estimate.mean[:2].tolist()) <= self.farthest:
            # No finger is that quick: these undersides are not its own.
            return memory._replace(alone=0)
        touched.own[self._at.residual, here] = left
        heading = update_heading(memory.heading, x, y, self.parameters.travel)
        return memory._replace(estimate=estimate, heading=heading, alone=0)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Form the blister, and drive all pins to their heights; see `Controller`."""
        lead, speeds = seen.own[self._at.lead], seen.own[self._at.speeds]
        if memory.master.phase is not Phase.IDLE:
            known = seen._replace(target=seen.target - lead)
            lead[:] = speeds[:] = 0.0
            master, commands = self.substitute.command(memory.master, known)
            return memory._replace(master=master, led_radius=0.0), commands
        moved = Moved(self.servo.find_limits(seen.force), self.servo.coast(seen.height, speeds))
        left = seen.target - lead
        rest, band, lowest, highest = self._limits[left.shape]
        off = left - rest
        np.abs(off, off)
        mode: NDArray[np.int8] = (off > band).view(np.int8)
        target = left
        if memory.phase is Phase.IDLE:
            memory = memory._replace(led_radius=0.0)
        else:
            edge, region = self._surface.survey(memory, seen.quadratic_basis, left)
            raised = memory.top > edge
            memory = self._follow_force(memory._replace(edge=edge), seen, region, moved, raised=raised)
            left = self._surface.leave(memory, seen, left, region.cells, mode)
            target = lead_heights(left, memory.top, region.drop, raised=raised)
            np.maximum(target, lowest, out=target)
            np.minimum(target, highest, out=target)
        np.subtract(target, left, out=lead)
        command = self.servo.serve(target - moved.coasted, moved.limits, seen.force, speeds)
        return memory, Commands(target, mode, command)

    def _follow_force(
        self, memory: Follower, seen: Measurement, region: Region, moved: Moved, *, raised: bool
    ) -> Follower:
        """Turn the force into the height of the top; without contact go back to where it was felt."""
        top, felt, trim = memory.felt, memory.felt, memory.trim
        if memory.alone:
            memory = memory._replace(due=self._unknown)
        else:
            asked, force = self.parameters.force_setpoint, float(np.add.reduce(seen.force))
            holds = self._holds(memory, force)
            top, coming = self._set_top(memory, seen, region, moved, holds, raised=raised)
            # The trim belongs to a force that pins reach.
            coming -= trim * (coming == asked + trim)
            memory = self._doubt(memory, force, coming, seen.force.size, top)
            if abs(asked - force) <= LEARNED * asked:
                trim += (asked - force) * self.device.period / self.parameters.trim_time
                felt, trim = top, min(max(trim, -LEARNED * asked), LEARNED * asked)
        x, y, _ = region.aim
        reach = self.profile.find_reach(top - memory.edge, region.speed)
        return memory._replace(top=top, felt=felt, trim=trim, led_x=x, led_y=y, led_radius=reach)

    def _doubt(self, memory: Follower, force: float, coming: float, cells: int, top: float) -> Follower:
        """Compare a force of some cells, N, with its prediction; hand over to Method I when they disagree."""
        (due, *later), asked = memory.due, self.parameters.force_setpoint
        error = min(abs(force - due), LEARNED * asked) if due >= 0.0 else 0.0
        doubt = memory.doubt + (error * error - cells * self.noise**2 - memory.doubt) / PERIODS
        doubt = max(doubt, 0.0)
        if doubt <= (DOUBTED * asked) ** 2:
            return memory._replace(due=(*later, coming), doubt=doubt)
        x, y = memory.estimate.mean[:2].tolist()
        master = Master(
            Phase.SHAPING, x, y, top, 0.0, top, memory.edge, memory.heading, top, 0, memory.losses
        )
        return memory._replace(master=master, doubt=0.0)

    def _set_top(
        self, memory: Follower, seen: Measurement, region: Region, moved: Moved, held: bool, *, raised: bool
    ) -> tuple[float, float]:
        """Return height of the top, m, and its force, N: solved for, or while held along with the finger."""
        guess = memory.top + float(memory.estimate.mean[5]) * self.device.period
        if held and memory.period % EVERY:
            seen.own[self._at.later] += guess - memory.top
            top, force = guess, self.parameters.force_setpoint + memory.trim
        else:
            top, force = self._solve_top(memory, seen, region, moved, guess, raised=raised)
        return min(max(top, 0.0), self.device.cell.actuator.stroke), force

    def _solve_top(
        self, memory: Follower, seen: Measurement, region: Region, moved: Moved, guess: float, *, raised: bool
    ) -> tuple[float, float]:
        """Return the height of the top at which predicted forces add up to the set point, and that sum."""
        (near,) = (region.cells.distance <= self.contact_radius).nonzero()
        if not near.size:
            return memory.felt, 0.0
        at, own = self._at, seen.own.take(near, 1)
        under = self.finger.find_underside(region.aim, memory.estimate, seen.quadratic_basis.take(near, 1))
        under += own[at.residual]
        seen.own[at.later] = AWAY
        seen.own[at.later, near] = under
        ends = moved.limits.take(near, 1)
        ends *= self.servo.span
        ends += moved.coasted.take(near)
        *_, lowest, highest = self._limits[ends.shape]
        np.maximum(ends, lowest, out=ends)
        np.minimum(ends, highest, out=ends)
        part = self.blister.evaluate_profile(region.cells.distance.take(near))
        wanted, lost = self.parameters.force_setpoint + memory.trim, self.pulp.predict_loss(own[at.pulp])
        reach = Reach(part, region.drop.take(near), ends)
        return find_top(wanted, guess, memory.edge, reach, under, lost, self.pulp, raised=raised)
