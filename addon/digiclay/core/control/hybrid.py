"""Method III: regional height and force commands, by an estimate of the fingertip.

It is the framework that the paper calls for in its conclusion. A control period has four steps:

1. Observe: the tension of the pulp over each cell, from the force on it.
2. Fit: position and shape of the fingertip, from the undersides over touched cells.
3. Solve: the height of the blister's top at which the predicted forces add up to the set point.
4. Serve: the valve commands that bring each pin to its height in time.

The blister is around the predicted position of the fingertip, and ahead of it as far as the speed
of the pins requires.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Constants, Floats
from ..base.modes import FORCE_FOLLOW
from ..model.contact import Contact
from ..model.control_interface import Commands, Measurement, Memory
from ..model.fingertip import Fingertip
from ..model.layout import enclose_discs
from ..model.null_parts import Unrelaxed
from ..model.touch import Touch
from .blister import BlisterRule
from .device_info import DeviceInfo, check_floor
from .finger_estimate import Aim, FingerFilter, Spread
from .finger_observer import (
    AWAY,
    EVERY,
    OWN_ROWS,
    FingerObserver,
    list_rows,
    measure_trust,
)
from .finger_sections import SHARED, WHOLE, Whole
from .flow_servo import FlowServo, make_flow_servo
from .ground import EdgeGround, raise_blister
from .hybrid_parameters import Hybrid
from .led_blister import SLOWEST, Follower, LeadProfile, LedBlister, Region
from .pulp_estimate import PulpEstimate, Reach, find_tops, lead_heights
from .servo import mark_formed
from .virtual_master import (
    HEAVIEST,
    IDLE,
    SHAPING,
    SPRINGING,
    Master,
    Phase,
    VirtualMaster,
    VirtualMasterControl,
)
from .virtual_master import build as build_master

#: Share of the set point within which the trim is corrected, and largest trim.
LEARNED = 0.5
#: Largest error of predicted forces, as a share of the set point, rms over a number of control
#: periods: beyond it the model is wrong, and Method I follows the fingertip until it is lost. A
#: lift at 22 mm/s has 0.28.
DOUBTED, PERIODS = 0.4, 20.0
#: Share of the set point above which a single pin gives way: under a followed fingertip no pin
#: carries more than 0.4.
OVER = 0.45


#: Surface from which the blister rises.
GROUND = EdgeGround()
#: Height of a blister's top, m, and the total force predicted for it, N.
Top = tuple[float, float]


class Coasting(NamedTuple):
    """Motion without a new command: lowest and highest speeds, m/s, and heights reached, m."""

    limits: Floats
    heights: Floats


@dataclass(frozen=True, eq=False)
class HybridControl:
    """Controller of Method III for a bed."""

    parameters: Hybrid
    device: DeviceInfo
    observer: FingerObserver
    surface: LedBlister
    servo: FlowServo
    contact_radius: float
    """Radius within which the fingertip may touch, m."""
    substitute: VirtualMasterControl
    """Method I, which takes over when the model does not predict the fingertip."""

    @cached_property
    def _limits(self) -> Constants:
        """Rest height, distance from it of a formed pin, and end stops, m."""
        actuator = self.device.cell.actuator
        return Constants((actuator.rest_height, self.parameters.dead_band, 0.0, actuator.stroke))

    @property
    def rows(self) -> int:
        """State rows per cell."""
        return self.observer.pulp.filters + OWN_ROWS + self.servo.rows

    #: See `following.FollowingControl`.
    division = "PredictedDivision"

    @property
    def blister_radius(self) -> float:
        """Largest distance of pins in the blister from the fingertip, m."""
        return self.surface.rule.blister.radius

    @property
    def pin_rows(self) -> tuple[int, ...]:
        """Rows of the command that a cell obeys, of any finger: lead and speeds."""
        at = self.observer.at
        return at.lead, *range(self.rows)[at.speeds]

    def begin(self) -> Follower:
        """Return the memory before a session."""
        return Follower(due=self.observer.unknown)

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Any, Any]:
        """Observe the pulp, and fit the fingertip; see `Controller`."""
        (memory,), (disc,) = self.locate_all([memory], touched)
        return memory, disc

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Form the blister, and drive all pins to their heights; see `Controller`."""
        (memory,), commands = self.command_all([memory], seen)
        return memory, commands

    def sort(self, memory: Follower) -> Phase | None:
        """Return the phase: one call serves fingers of equal phase; None: Method I serves the finger."""
        return memory.phase if memory.master.phase is IDLE else None

    def locate_all(
        self, memories: list[Follower], touched: Measurement, sections: Whole = WHOLE
    ) -> tuple[list[Follower], list[Any]]:
        """Observe the pulp, and fit fingertips with the same `sort` key; see `Controller.locate`."""
        if memories[0].master.phase is not IDLE:
            memory, disc = self._substitute(memories[0], touched)
            return [memory], [disc]
        memories = [self._move_on(memory) for memory in memories]
        if touched.force.size:
            memories = self.observer.observe(memories, touched, sections)
        else:
            memories = list(map(self.substitute.loss.wait, memories))
        return memories, list(map(self.surface.find_disc, memories))

    def _move_on(self, memory: Follower) -> Follower:
        """Return the memory a period later, with the fingertip predicted."""
        estimate = memory.estimate
        if memory.phase is not IDLE:
            estimate = self.observer.finger.predict(estimate)
        return memory._replace(period=memory.period + 1, estimate=estimate)

    def _substitute(self, memory: Follower, touched: Measurement) -> tuple[Follower, Any]:
        """Let Method I follow the fingertip until it is lost."""
        before, begins = memory.master, self.substitute.is_new(memory.master)
        master, disc = self.substitute.locate(
            Master(losses=before.losses) if begins else before, touched
        )
        if begins and master.phase is not IDLE:
            master = master._replace(phase=before.phase)
        if memory.led_radius:
            led = (memory.led_x, memory.led_y, memory.led_radius)
            disc = enclose_discs(disc, led) if disc else led
        period, phase, losses = memory.period + 1, master.phase, master.losses
        return memory._replace(period=period, phase=phase, losses=losses, master=master), disc

    def predict_under(self, memories: list[Follower], basis: Floats) -> Floats:
        """Return the undersides over cells, (f, m), m, of fingertips that are followed."""
        aims: list[Aim] = []
        for memory in memories:
            x, y, z, *_ = memory.estimate.mean.tolist()
            master = memory.master
            aims.append((x, y, z) if master.phase is IDLE else (master.x, master.y, master.height))
        return self.observer.finger.find_underside(
            aims, [memory.estimate for memory in memories], basis, SHARED
        )

    def predict_force(self, depth: Floats, rows: Floats) -> Floats:
        """Return the forces of fingertips on pins, (f, m), N, at depths (f, m), m, by rows (f, r, m)."""
        pulp = self.observer.pulp
        return pulp.predict_force(depth, pulp.predict_loss(rows[:, self.observer.at.pulp]))

    def command_all(
        self, memories: list[Follower], seen: Measurement, sections: Whole = WHOLE
    ) -> tuple[list[Follower], Commands]:
        """Form the blisters of fingers with the same `sort` key, and drive all pins to their heights."""
        lead, speeds = seen.own[self.observer.at.lead], seen.own[self.observer.at.speeds]
        if memories[0].master.phase is not IDLE:
            unled = seen._replace(target=seen.target - lead)
            lead[:] = speeds[:] = 0.0
            master, commands = self.substitute.command(memories[0].master, unled)
            return [memories[0]._replace(master=master, led_radius=0.0)], commands
        if self.device.commands_wait:
            # A valve whose line waited in the last period has stayed shut.
            speeds[0] *= seen.command != 0.0
        coasting = Coasting(
            self.servo.find_limits(seen.force), self.servo.coast(seen.height, speeds)
        )
        left = seen.target - lead
        rest, band, lowest, highest = self._limits[left.shape]
        mode, target = mark_formed(left, rest, band), left
        if memories[0].phase is IDLE:
            memories = [memory._replace(led_radius=0.0) for memory in memories]
        else:
            region = self.surface.survey(memories, seen.quadratic_basis, left, sections)
            memories = self._follow_force(memories, seen, region, coasting, sections)
            edge, top = sections.spread([(memory.edge, memory.top) for memory in memories])
            form = edge, top, FORCE_FOLLOW, False
            before = seen._replace(target=left)
            left = raise_blister(self.surface.rule, GROUND, region.cells, before, form, mode)
            target = lead_heights(left, top, region.drop, sections.spread(region.raised))
            np.maximum(target, lowest, out=target)
            np.minimum(target, highest, out=target)
        most = OVER * self.parameters.force_setpoint
        if np.maximum.reduce(seen.force, initial=0.0) > most:
            # Such a force on a single pin shows that the estimate is wrong: the pin gives way.
            over = seen.force > most
            low = np.maximum(coasting.heights + coasting.limits[0] * self.servo.span, 0.0)
            left, target = np.where(over, low, left), np.where(over, low, target)
        np.subtract(target, left, out=lead)
        command = self.servo.serve(target - coasting.heights, coasting.limits, seen.force, speeds)
        return memories, Commands(target, mode, command)

    def _follow_force(
        self,
        memories: list[Follower],
        seen: Measurement,
        region: Region,
        coasting: Coasting,
        sections: Whole,
    ) -> list[Follower]:
        """Move tops to the heights of the set point; without contact, to the last height with contact."""
        forces, tops = sections.add(seen.force), list[Top | None]()
        for memory, force, part in zip(memories, forces, sections.parts, strict=True):
            if memory.period % EVERY and not memory.alone and self.observer.holds(memory, force):
                top = self._move_top(memory)
                later = seen.own[self.observer.at.later, part]
                later += top - memory.top
                tops.append((top, self.parameters.force_setpoint + memory.trim))
            else:
                tops.append(None)
        if None in tops:
            self._solve_tops(memories, seen, region, coasting, sections, tops)
        counts = [values.size for values in sections.cut(seen.force)]
        fingers = zip(
            memories, tops, forces, counts, region.edges, region.aims, region.speeds, strict=True
        )
        return [self._move_blister(*finger) for finger in fingers]

    def _move_blister(
        self,
        memory: Follower,
        solved: Top | None,
        force: float,
        cells: int,
        edge: float,
        aim: Aim,
        speed: float,
    ) -> Follower:
        """Return the memory with the solved top, m, and the predicted total force, N.

        `force` of so many cells, N; surface, m; lowest point of the fingertip, m, and its speed,
        m/s.
        """
        asked, due, doubt = self.parameters.force_setpoint, self.observer.unknown, memory.doubt
        top, felt, trim, master = memory.felt, memory.felt, memory.trim, memory.master
        if not memory.alone:
            top, coming = solved or (felt, 0.0)
            goes, beyond = self._leaves(memory)
            # A fingertip that has just landed does not leave, whatever its estimate.
            carried = trim != 0.0
            if carried and (goes or beyond) and top > (along := self._move_top(memory)):
                # Fewer cells carry the fingertip, and none must rise for it.
                top = along
                coming = -1.0
            top = min(max(top, 0.0), self.device.cell.actuator.stroke)
            # The trim belongs to a force that pins reach.
            coming -= trim * (coming == asked + trim)
            due, doubt = (*memory.due[1:], coming), self._doubt(memory, force, cells)
            if beyond and not (carried and goes) and force < LEARNED * asked:
                phase = SHAPING if carried else SPRINGING
                master = Master(phase, height=math.nan, losses=memory.losses)
            elif doubt > (DOUBTED * asked) ** 2:
                (x, y, *_), due, doubt = memory.estimate.mean.tolist(), memory.due, 0.0
                master = Master(SHAPING, x, y, top, reference=top, edge=edge, felt=top)
                master = master._replace(heading=memory.heading, losses=memory.losses)
            if abs(asked - force) <= LEARNED * asked:
                learned = (asked - force) * self.device.period / self.parameters.trim_time
                trim += learned * (coming >= 0.0)
                felt, trim = top, min(max(trim, -LEARNED * asked), LEARNED * asked)
        x, y, _ = aim
        return memory._replace(
            top=top,
            edge=edge,
            trim=trim,
            felt=felt,
            led_x=x,
            led_y=y,
            led_radius=self.surface.profile.find_reach(top - edge, speed),
            due=due,
            doubt=doubt,
            master=master,
        )

    def _leaves(self, memory: Follower) -> tuple[bool, bool]:
        """Tell whether the fingertip moves off the bed, and whether few pins carry it beyond the rim."""
        x, y, _, vx, vy, *_ = memory.estimate.mean.tolist()
        rim, speed = self.device.rim, math.hypot(vx, vy)
        goes = speed > SLOWEST and rim.is_ahead(x, y, vx / speed, vy / speed)
        return goes, rim.is_under(x, y, -rim.reach)

    def _doubt(self, memory: Follower, force: float, cells: int) -> float:
        """Return the doubt, N², after a force on cells, N; beyond a limit Method I takes over."""
        due, most = memory.due[0], LEARNED * self.parameters.force_setpoint
        error = min(abs(force - due), most) if due >= 0.0 else 0.0
        doubt = (
            memory.doubt + (error * error - cells * self.observer.noise**2 - memory.doubt) / PERIODS
        )
        return max(doubt, 0.0)

    def _move_top(self, memory: Follower) -> float:
        """Return the height of the top, m, moved with the fingertip for a period."""
        speed: float = memory.estimate.mean.tolist()[5]
        return memory.top + speed * self.device.period

    def _solve_tops(
        self,
        memories: list[Follower],
        seen: Measurement,
        region: Region,
        coasting: Coasting,
        sections: Whole,
        tops: list[Top | None],
    ) -> None:
        """Set, in place, the tops at which predicted forces add up to the set point, and these sums."""
        (near,) = (region.cells.distance <= self.contact_radius + TIE).nonzero()
        wanted = [not (top or memory.alone) for top, memory in zip(tops, memories, strict=True)]
        near, fingers, picked = sections.pick(near, wanted)
        if not fingers:
            return
        aims, edges = [region.aims[i] for i in fingers], [region.edges[i] for i in fingers]
        raised = [region.raised[i] for i in fingers]
        solved = [memories[i] for i in fingers]
        forces = [self.parameters.force_setpoint + memory.trim for memory in solved]
        guesses = list(map(self._move_top, solved))
        estimates = [memory.estimate for memory in solved]
        at, rows = self.observer.at, seen.own.take(near, 1)
        under = self.observer.finger.find_underside(
            aims, estimates, seen.quadratic_basis.take(near, 1), picked
        )
        under += rows[at.residual]
        for i in fingers:
            seen.own[at.later, sections.parts[i]] = AWAY
        seen.own[at.later, near] = under
        ends = coasting.limits.take(near, 1)
        ends *= self.servo.span
        ends += coasting.heights.take(near)
        *_, lowest, highest = self._limits[ends.shape]
        np.maximum(ends, lowest, out=ends)
        np.minimum(ends, highest, out=ends)
        part = self.surface.rule.blister.evaluate_profile(region.cells.distance.take(near))
        reach = Reach(
            picked.spread(edges), picked.spread(raised), part, region.drop.take(near), ends
        )
        pulp = self.observer.pulp
        lost = pulp.predict_loss(rows[at.pulp])
        results = find_tops(forces, guesses, reach, under, lost, pulp, picked)
        for i, top in zip(fingers, results, strict=True):
            tops[i] = top


#: Largest distance of touched cells beyond the fingertip's largest semi-axis, m.
BESIDE = 3e-3
#: Standard deviation of forces that the filter assumes for sensors without noise, N.
QUIET = 2e-4


def build(parameters: Hybrid, device: DeviceInfo) -> HybridControl:
    """Put Method III together for a device; the device has a blister."""
    assert device.blister is not None
    asked = parameters.force_setpoint
    check_floor(HEAVIEST * asked, "force_setpoint", asked, device.force_floor)
    # Without a fingertip nothing is ever felt.
    touch = device.cell.touch or Touch(Fingertip(), Contact(), Unrelaxed())
    tip, blister, share = touch.fingertip, device.blister, parameters.speed_share
    servo = make_flow_servo(device.cell, device.period, device.dead_time, parameters.dead_band)
    felt = max(parameters.felt_force, device.force_floor)
    noise = max(device.force_floor / 5.0, QUIET)
    substitute = build_master(
        VirtualMaster(force_setpoint=asked, loss_time=parameters.loss_time), device
    )
    spread = Spread(
        parameters.acceleration * measure_trust(noise),
        parameters.turn,
        parameters.size_drift,
        parameters.underside_error,
    )
    observer = FingerObserver(
        at=list_rows(touch.pulp.rows),
        pulp=PulpEstimate(touch, device.period, servo.ahead, device.force_floor),
        finger=FingerFilter(tip, spread, device.period),
        felt=felt,
        noise=noise,
        loss=substitute.loss,
        unknown=(-1.0,) * max(1, round(servo.ahead / device.period)),
        asked=asked,
        travel=parameters.travel,
    )
    rule = BlisterRule(blister, parameters.behind, max(parameters.release_force, felt), felt)
    profile = LeadProfile(
        level=blister.flat_radius + parameters.level_margin,
        rise=share * servo.rise,
        fall=share * servo.fall,
        skirt=parameters.skirt_speed,
    )
    surface = LedBlister(rule, profile, servo.ahead)
    reach = max(tip.length, tip.width) + BESIDE
    return HybridControl(parameters, device, observer, surface, servo, reach, substitute)
