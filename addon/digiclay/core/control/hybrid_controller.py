"""Control period of Method III: observe the pulp, fit the finger, solve for the height, drive the pins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Constants, any_true, count_true
from ..base.modes import Mode
from ..model.control_interface import Commands, Measurement
from ..model.layout import Disc, enclose_discs
from .blister import Blister
from .blister_cells import BlisterCells, BlisterRule
from .device_info import DeviceInfo
from .finger_estimate import Estimate, FingerFilter
from .flow_servo import FlowServo
from .force_height import Reach, find_top, lead_heights
from .ground import EdgeGround
from .hybrid_memory import Follower
from .hybrid_parameters import Hybrid
from .hybrid_rows import OWN_ROWS, Own, Region, split_rows
from .lead_profile import LeadProfile
from .master_memory import LossRule, Phase
from .pulp_estimate import PulpEstimate
from .travel import Heading, update_heading

__all__ = ["HybridControl"]

Floats = NDArray[np.float64]

#: Share of the set point within which the force counts as held: then the trim learns; it is at most as large.
LEARNED = 0.5
#: How far a touched cell may be from the predicted place of the finger, in semi-axes: beyond is a new touch.
JUMP = 1.5
#: Surface from which the blister rises.
GROUND = EdgeGround()
#: Plain number: numpy takes an enumeration's member ten times as long.
FORCE_FOLLOW = int(Mode.FORCE_FOLLOW)
#: How much farther than the place estimated and the reach of the period before pins may be led, m.
MARGIN = 2e-3


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

    name = "hybrid"

    @cached_property
    def farthest(self) -> float:
        """Distance from the predicted place beyond which a touch is a new one, m."""
        return JUMP * max(self.finger.fingertip.length, self.finger.fingertip.width)

    @cached_property
    def _loss(self) -> LossRule:
        """When a finger is given up."""
        return LossRule(self.device.period, self.parameters.loss_time)

    @cached_property
    def _rule(self) -> BlisterRule:
        """Which cells of the blister are frozen, and which are touched."""
        known = self.parameters
        return BlisterRule(self.blister, known.behind, max(known.release_force, self.felt), self.felt)

    @cached_property
    def _limits(self) -> Constants:
        """Height of a pin at rest, how far from it one counts as formed, and its end stops, m."""
        actuator = self.device.cell.actuator
        return Constants((actuator.rest_height, self.parameters.dead_band, 0.0, actuator.stroke))

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.pulp.filters + OWN_ROWS + self.servo.rows

    def begin(self) -> Follower:
        """Return the memory before a session."""
        return Follower()

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, Any]:
        """Observe the pulp, and fit the finger; see `Controller`."""
        memory = memory._replace(period=memory.period + 1)
        if memory.phase is not Phase.IDLE:
            memory = memory._replace(estimate=self.finger.predict(memory.estimate))
        if touched.force.size:
            memory = self._observe(memory, touched, split_rows(touched.own, self.pulp.filters))
        else:
            memory = self._loss.wait(memory)
        return memory, self._find_disc(memory)

    def _find_disc(self, memory: Follower) -> Disc | None:
        """Return the disc of the pins to command: those led now, and those led before."""
        led = (memory.led_x, memory.led_y, memory.led_radius)
        if memory.phase is Phase.IDLE:
            return led if memory.led_radius else None
        x, y, _, vx, vy, *_ = memory.estimate.mean.tolist()
        reach = self.profile.find_reach(memory.top - memory.edge, math.hypot(vx, vy))
        disc = (x, y, max(self.blister.edge_radius, reach) + MARGIN)
        return enclose_discs(disc, led) if memory.led_radius else disc

    def _observe(self, memory: Follower, touched: Measurement, own: Own) -> Follower:
        """Observe the pulp of the cells the finger may touch, and follow or find the finger."""
        late = (memory.period - 1.0) - own.stamp
        if late.any():
            self.pulp.age(own.pulp, late * (own.stamp > 0.0))
        own.stamp[:] = memory.period
        (here,) = (touched.force > self.felt).nonzero()
        if memory.phase is Phase.IDLE:
            self.pulp.observe(own.pulp, touched.force, np.zeros(touched.force.size))
            return self._find(memory, touched, own, here) if here.size else memory
        expected = self.pulp.touch.contact.tension(touched.height - own.coming)
        self.pulp.observe(own.pulp, touched.force, expected)
        own.coming[:] = own.later
        own.residual[:] = 0.0
        if not here.size:
            waiting: Follower = self._loss.wait(memory)
            return waiting
        basis = touched.quadratic_basis.take(here, 1)
        if self._has_jumped(memory.estimate, basis):
            return self._find(memory._replace(losses=memory.losses + 1), touched, own, here)
        return self._fit(memory, touched, own, here, basis)

    def _has_jumped(self, guess: Estimate, basis: Floats) -> bool:
        """Tell whether no touched cell is where the finger can be."""
        place, (_, x, y) = tuple(guess.mean[:2].tolist()), basis[:3].tolist()
        return not any(math.dist(place, cell) <= self.farthest for cell in zip(x, y, strict=True))

    def _find(self, memory: Follower, touched: Measurement, own: Own, here: NDArray[np.intp]) -> Follower:
        """Begin to follow a finger that has touched: at the centroid of its forces (equation 13)."""
        force, basis = touched.force.take(here), touched.quadratic_basis.take(here, 1)
        under, _ = self.pulp.find_underside(touched.height.take(here), own.pulp[-1].take(here), self.noise)
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
        )
        return self._fit(memory, touched, own, here, basis)

    def _fit(
        self, memory: Follower, touched: Measurement, own: Own, here: NDArray[np.intp], basis: Floats
    ) -> Follower:
        """Fit the finger to the undersides over the touched cells, whose basis is given."""
        seen, noise = self.pulp.find_underside(touched.height.take(here), own.pulp[-1].take(here), self.noise)
        noise *= noise
        noise += self.finger.spread.underside**2
        at = self.finger.measure(memory.estimate.mean, basis)
        estimate, left = self.finger.correct(memory.estimate, at, seen, noise)
        x, y = estimate.mean[:2].tolist()
        if not math.dist((x, y), memory.estimate.mean[:2].tolist()) <= self.farthest:
            # No finger is that quick: these undersides are not its own.
            return memory._replace(alone=0)
        own.residual[here] = left
        heading = update_heading(memory.heading, x, y, self.parameters.travel)
        return memory._replace(estimate=estimate, heading=heading, alone=0)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Form the blister, and drive all pins to their heights; see `Controller`."""
        own = split_rows(seen.own, self.pulp.filters)
        limits = self.servo.find_limits(seen.force)
        coasted = self.servo.coast(seen.height, own.speeds)
        left = seen.target - own.lead
        rest, band, lowest, highest = self._limits[left.shape]
        off = left - rest
        np.abs(off, off)
        mode: NDArray[np.int8] = (off > band).view(np.int8)
        target = left
        if memory.phase is Phase.IDLE:
            memory = memory._replace(led_radius=0.0)
        else:
            edge, region = self._survey(memory, seen.quadratic_basis, left)
            raised = memory.top > edge
            memory = self._set_top(memory._replace(edge=edge), seen, region, limits, coasted, raised)
            left = self._leave(memory, seen, left, region.cells, mode)
            target = lead_heights(left, memory.top, region.drop, raised=raised)
            np.maximum(target, lowest, out=target)
            np.minimum(target, highest, out=target)
        np.subtract(target, left, out=own.lead)
        command = self.servo.serve(target - coasted, limits, seen.force, own.speeds)
        return memory, Commands(target, mode, command)

    def _survey(self, memory: Follower, basis: Floats, left: Floats) -> tuple[float, Region]:
        """Return the height of the surface ahead, m, and the cells about the predicted finger."""
        x, y, z, vx, vy, vz, *_ = memory.estimate.mean.tolist()
        time, speed = self.servo.ahead, math.hypot(vx, vy)
        aim = (x + vx * time, y + vy * time, z + vz * time)
        cells = self._rule.divide((*aim[:2], *memory.heading[2:]), basis)
        facing = self._rule.find_edge(cells)
        count = count_true(facing)
        edge = float(left.dot(facing)) / count if count else memory.edge
        drop = self.profile.find_drop(cells.distance, cells.ahead, speed, raised=memory.top > edge)
        return edge, Region(aim, speed, cells, drop)

    def _set_top(
        self,
        memory: Follower,
        seen: Measurement,
        region: Region,
        limits: Floats,
        coasted: Floats,
        raised: bool,
    ) -> Follower:
        """Turn the force into the height of the top; without contact go back to where it was felt."""
        (near,) = (region.cells.distance <= self.contact_radius).nonzero()
        if memory.alone or not near.size:
            return self._with_top(memory, region, memory.felt)
        own = split_rows(seen.own.take(near, 1), self.pulp.filters)
        under = self.finger.find_underside(region.aim, memory.estimate, seen.quadratic_basis.take(near, 1))
        under += own.residual
        split_rows(seen.own, self.pulp.filters).later[near] = under
        ends = limits.take(near, 1)
        ends *= self.servo.span
        ends += coasted.take(near)
        part = self.blister.evaluate_profile(region.cells.distance.take(near))
        asked = self.parameters.force_setpoint
        guess = memory.top + float(memory.estimate.mean[5]) * self.device.period
        top = find_top(
            asked + memory.trim, guess, memory.edge, Reach(part, region.drop.take(near), ends), under,
            self.pulp.predict_loss(own.pulp), self.pulp, raised=raised,
        )  # fmt: skip
        top = min(max(top, 0.0), self.device.cell.actuator.stroke)
        error = asked - float(seen.force.sum())
        if abs(error) > LEARNED * asked:
            return self._with_top(memory, region, top)
        trim = memory.trim + error * self.device.period / self.parameters.trim_time
        trim = min(max(trim, -LEARNED * asked), LEARNED * asked)
        return self._with_top(memory, region, top)._replace(felt=top, trim=trim)

    def _with_top(self, memory: Follower, region: Region, top: float) -> Follower:
        """Return the memory with a height of the top, m, and the disc of the pins led for it."""
        reach = self.profile.find_reach(top - memory.edge, region.speed)
        return memory._replace(top=top, led_x=region.aim[0], led_y=region.aim[1], led_radius=reach)

    def _leave(
        self, memory: Follower, seen: Measurement, left: Floats, cells: BlisterCells, mode: NDArray[np.int8]
    ) -> Floats:
        """Return the heights at which pins are left by the finger, m; modes are set in place."""
        top, edge = memory.top, memory.edge
        heights = self.blister.interpolate(cells.distance, edge, top)
        frozen = self._rule.find_frozen(cells, seen)
        if any_true(frozen):
            # What is frozen is never called back; a blister that outgrows it takes it along.
            kept = GROUND.find_kept(left, heights, edge, top)
            kept &= frozen
            np.putmask(heights, kept, left)
        self._rule.set_modes(mode, cells, seen.force, FORCE_FOLLOW, frozen)
        return np.where(cells.inside, heights, left)
