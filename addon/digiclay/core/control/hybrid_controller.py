"""Control period of Method III: observe the pulp, fit the finger, solve for the height, drive the pins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..model.control_interface import Commands, Measurement
from ..model.layout import ON_THE_SIDE, Disc, enclose_discs
from .blister import Blister
from .device_info import DeviceInfo
from .finger_estimate import Estimate, FingerFilter
from .flow_servo import FlowServo
from .force_height import Reach, find_top, lead_heights
from .hybrid_memory import Follower
from .hybrid_parameters import Hybrid
from .hybrid_rows import OWN_ROWS, Own, Region, split_rows
from .lead_profile import LeadProfile
from .master_memory import Phase
from .pulp_estimate import PulpEstimate
from .travel import ABEAM, Heading, measure_excess, measure_offsets, update_heading

__all__ = ["HybridControl"]

Floats = NDArray[np.float64]

#: Share of the set point within which the force counts as held: then the trim learns; it is at most as large.
LEARNED = 0.5
#: How far a touched cell may be from the predicted place of the finger, in semi-axes: beyond is a new touch.
JUMP = 1.5
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
        if touched.force.size:
            memory = self._observe(memory, touched, split_rows(touched.own, self.pulp.filters))
        elif memory.phase is not Phase.IDLE:
            memory = self._wait(memory._replace(estimate=self.finger.predict(memory.estimate)))
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
        late = memory.period - 1.0 - own.stamp
        if late.any():
            self.pulp.age(own.filters, own.tension, late * (own.stamp > 0.0))
        own.stamp[:] = memory.period
        felt = touched.force > self.felt
        if memory.phase is Phase.IDLE:
            self.pulp.observe(own.filters, own.tension, touched.force, np.zeros(felt.size))
            here = np.flatnonzero(felt)
            return self._find(memory, touched, own, here) if here.size else memory
        expected = self.pulp.touch.contact.tension(touched.height - own.coming)
        self.pulp.observe(own.filters, own.tension, touched.force, expected)
        own.coming[:] = own.later
        own.residual[:] = 0.0
        memory = memory._replace(estimate=self.finger.predict(memory.estimate))
        here = np.flatnonzero(felt)
        if not here.size:
            return self._wait(memory)
        if self._has_jumped(memory.estimate, touched, here):
            return self._find(memory._replace(losses=memory.losses + 1), touched, own, here)
        return self._fit(memory, touched, own, here)

    def _has_jumped(self, guess: Estimate, touched: Measurement, here: NDArray[np.intp]) -> bool:
        """Tell whether no touched cell is where the finger can be."""
        x, y = guess.mean[:2].tolist()
        excess = measure_excess(x, y, self.farthest, touched.quadratic_basis[:, here])
        return not excess.min() <= 0.0

    def _find(self, memory: Follower, touched: Measurement, own: Own, here: NDArray[np.intp]) -> Follower:
        """Begin to follow a finger that has touched: at the centroid of its forces (equation 13)."""
        force = touched.force[here]
        under = touched.height[here] - self.pulp.find_indentation(own.tension[here])
        rows = np.vstack((touched.quadratic_basis[:3, here], under, touched.height[here]))
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
        return self._fit(memory, touched, own, here)

    def _fit(self, memory: Follower, touched: Measurement, own: Own, here: NDArray[np.intp]) -> Follower:
        """Fit the finger to the undersides over the touched cells."""
        tension = own.tension[here]
        seen = touched.height[here] - self.pulp.find_indentation(tension)
        noise = self.noise / self.pulp.find_stiffness(tension)
        noise *= noise
        noise += self.finger.spread.underside**2
        at = self.finger.measure(memory.estimate.mean, touched.quadratic_basis[:, here])
        estimate, left = self.finger.correct(memory.estimate, at, seen, noise)
        x, y = estimate.mean[:2].tolist()
        if not math.dist((x, y), memory.estimate.mean[:2].tolist()) <= self.farthest:
            # No finger is that quick: these undersides are not its own.
            return memory._replace(alone=0)
        own.residual[here] = left
        heading = update_heading(memory.heading, x, y, self.parameters.travel)
        return memory._replace(estimate=estimate, heading=heading, alone=0)

    def _wait(self, memory: Follower) -> Follower:
        """Count the periods without a finger; give it up after the loss time."""
        if memory.alone * self.device.period < self.parameters.loss_time * (1.0 - 1e-9):
            return memory._replace(alone=memory.alone + 1)
        return memory._replace(phase=Phase.IDLE, losses=memory.losses + 1)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Form the blister, and drive all pins to their heights; see `Controller`."""
        own = split_rows(seen.own, self.pulp.filters)
        limits = self.servo.find_limits(seen.force)
        coasted = self.servo.coast(seen.height, own.speeds)
        left = seen.target - own.lead
        off = np.abs(left - self.device.cell.actuator.rest_height)
        mode: NDArray[np.int8] = (off > self.parameters.dead_band).view(np.int8)
        target = left
        if memory.phase is Phase.IDLE:
            memory = memory._replace(led_radius=0.0)
        else:
            region = self._survey(memory, seen.quadratic_basis)
            memory = self._set_edge(memory, left, region)
            raised = memory.top > memory.edge
            drop = self.profile.find_drop(region.distance, region.ahead, region.speed, raised=raised)
            memory = self._set_top(memory, seen, own, region, drop, limits, coasted, raised)
            reach = self.profile.find_reach(memory.top - memory.edge, region.speed)
            memory = memory._replace(led_x=region.aim[0], led_y=region.aim[1], led_radius=reach)
            left = self._leave(memory, seen, left, region, mode)
            target = lead_heights(left, memory.top, drop, raised=raised)
            np.maximum(target, 0.0, out=target)
            np.minimum(target, self.device.cell.actuator.stroke, out=target)
        np.subtract(target, left, out=own.lead)
        command = self.servo.serve(target - coasted, limits, seen.force, own.speeds)
        return memory, Commands(target, mode, command)

    def _survey(self, memory: Follower, basis: Floats) -> Region:
        """Return where cells are about the place of the finger predicted."""
        x, y, z, vx, vy, vz, *_ = memory.estimate.mean.tolist()
        time = self.servo.ahead
        aim = (x + vx * time, y + vy * time, z + vz * time)
        _, _, toward_x, toward_y = memory.heading
        distance, ahead = measure_offsets(aim[0], aim[1], toward_x, toward_y, basis)
        inside = distance <= self.blister.radius * (1.0 + ON_THE_SIDE)
        ring = distance <= self.blister.edge_radius * (1.0 + ON_THE_SIDE)
        ring ^= inside
        part = self.blister.evaluate_profile(distance)
        return Region(aim, math.hypot(vx, vy), distance, ahead, inside, ring, part)

    def _set_edge(self, memory: Follower, left: Floats, region: Region) -> Follower:
        """Take the height of the surface ahead; the finished ridge behind is no edge."""
        facing = region.ahead >= -ABEAM
        facing &= region.ring
        count = np.count_nonzero(facing)
        return memory._replace(edge=float(left.dot(facing)) / count) if count else memory

    def _set_top(
        self,
        memory: Follower,
        seen: Measurement,
        own: Own,
        region: Region,
        drop: Floats,
        limits: tuple[Floats, Floats],
        coasted: Floats,
        raised: bool,
    ) -> Follower:
        """Turn the force into the height of the top; without contact go back to where it was felt."""
        near = np.flatnonzero(region.distance <= self.contact_radius)
        if memory.alone or not near.size:
            return memory._replace(top=memory.felt)
        under = self.finger.find_underside(region.aim, memory.estimate, seen.quadratic_basis[:, near])
        under += own.residual[near]
        own.later[near] = under
        lost = self.pulp.predict_loss(own.filters[:, near], own.tension[near])
        span, base = self.servo.span, coasted[near]
        reach = Reach(
            region.part[near], drop[near], base + span * limits[0][near], base + span * limits[1][near]
        )
        asked = self.parameters.force_setpoint
        top = find_top(asked + memory.trim, memory.edge, reach, under, lost, self.pulp, raised=raised)
        top = min(max(top, 0.0), self.device.cell.actuator.stroke)
        error = asked - float(seen.force.sum())
        if abs(error) > LEARNED * asked:
            return memory._replace(top=top)
        trim = memory.trim + error * self.device.period / self.parameters.trim_time
        return memory._replace(top=top, felt=top, trim=min(max(trim, -LEARNED * asked), LEARNED * asked))

    def _leave(
        self, memory: Follower, seen: Measurement, left: Floats, region: Region, mode: NDArray[np.int8]
    ) -> Floats:
        """Return the heights at which pins are left by the finger, m; modes are set in place."""
        known, top, edge = self.parameters, memory.top, memory.edge
        frozen = region.ahead < known.behind * region.distance
        frozen &= region.distance > self.blister.flat_radius
        frozen |= seen.mode == Mode.FROZEN
        frozen &= region.inside
        frozen &= seen.force < max(known.release_force, self.felt)
        heights = region.part * (top - edge)
        heights += edge
        # What is frozen is never called back; a blister that outgrows it takes it along.
        kept = left < heights if top < edge else left > heights
        kept &= frozen
        np.putmask(heights, kept, left)
        touched = seen.force > self.felt
        touched &= region.inside
        np.putmask(mode, region.inside, Mode.BLISTER)
        np.putmask(mode, touched, Mode.FORCE_FOLLOW)
        np.putmask(mode, region.ring, Mode.EDGE)
        np.putmask(mode, frozen, Mode.FROZEN)
        return np.where(region.inside, heights, left)
