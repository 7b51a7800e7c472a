"""Method I: a virtual master cell under the fingertip that leads the blister (Fig. 3 of the paper).

Locate, control, model, create: where the finger presses; a virtual spring until the force
reaches its set point, then force control; a cylinder and valve like a real one turns the
effort into the master's height; the cells around follow the blister's profile.

What concerns cells holds for those of one run, (m,), and of a stack, (m, b); what concerns a
master is decided in plain numbers, run by run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Constants, Floats, any_true, count_true
from ..model.control_interface import Commands, Measurement
from ..model.layout import RELATIVE_TOLERANCE
from .blister import BlisterRule
from .device_info import DeviceInfo, check_floor, suppress_noise
from .ground import GROUNDS, EdgeGround, OwnGround
from .master import Master, MasterControl, Phase, VirtualMaster, make_master_cell
from .runs import decide_by_any, decide_by_run, gather_by_run, sum_weighted
from .servo import lock_overloaded
from .travel import measure_excess

__all__ = ["Master", "Phase", "VirtualMaster", "VirtualMasterBatch", "VirtualMasterControl", "build"]

#: Share of the total force that the cell in the middle of the finger carries while shaping, at least: 0.23
#: to 0.33 of it measured while the finger moves slowly.
HEAVIEST = 0.25
NONE = Constants((0.0,))


@dataclass(frozen=True, eq=False)
class VirtualMasterControl(MasterControl):
    """Controller of Method I for a bed.

    Attributes
    ----------
    lift : float
        Force the high reservoir can lift, N.
    floor : float
        Force from which on the reading of a cell is no noise, N.
    ground : EdgeGround or OwnGround
        Surface from which the blister rises.
    """

    lift: float
    floor: float = 0.0
    ground: EdgeGround | OwnGround = GROUNDS["edge"]

    name = "virtual_master"

    @property
    def rows(self) -> int:
        """State rows a cell needs."""
        return self.ground.rows

    @cached_property
    def reversal(self) -> float:
        """Distance traveled back that reverses the direction, m."""
        return max(self.parameters.travel, self.ground.turning * self.blister.flat_radius)

    @property
    def batch_class(self) -> type[VirtualMasterControl]:
        """Class of the controller of a batch."""
        return VirtualMasterBatch

    def begin(self) -> Master:
        """Return the memory before a session."""
        return Master()

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, Any]:
        """Locate the finger and move the master; see `Controller`."""
        basis, force = touched.quadratic_basis, touched.force
        if self._noisy:
            force = suppress_noise(force, self.floor)
        sums = self._sum_forces(memory, basis, force)
        held = self._sum_held(memory, touched, sums[0]) if self._noisy else sums[0]
        memory = self.follow(memory, *sums)
        if self.is_new(memory):
            memory = self.set_surface(memory, sums[0], sum_weighted(touched.height, force).tolist())
        memory = self.lead(memory, held)
        return memory, self.find_disc(memory)

    def _sum_forces(self, memory: Any, basis: Floats, force: Floats) -> tuple[Any, ...]:
        """Return what `follow` takes: sums over all cells, and over those near the master."""
        (none,) = NONE[force.shape]
        total, x, y, *_ = sum_weighted(basis, force).tolist()
        far = self._measure_excess(memory, basis) > none
        near = sum_weighted(basis, np.where(far, none, force)).tolist()
        return total, x, y, *near[:3]

    def _sum_held(self, memory: Any, touched: Measurement, felt: Any) -> Any:
        """Return the force that is controlled, N: of all touched cells, see docs/equations.md.

        Next to the master noise stays in, for what is below the floor adds up; farther off only what is no
        noise counts. `felt` is the sum of that everywhere, N.
        """
        hidden = self._measure_excess(memory, touched.quadratic_basis) <= 0.0
        hidden &= touched.force < self.floor
        noise = sum_weighted(touched.force, hidden).tolist()
        return self.add_noise(memory, felt, noise)

    def _measure_excess(self, memory: Any, basis: Floats) -> Floats:
        """Return by how much cells are beyond the circle in which the finger is looked for, m²."""
        x, y = self.get_place(memory)
        return measure_excess(x, y, self.parameters.radius * (1.0 + RELATIVE_TOLERANCE), basis)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Create the blister, freeze what is left behind, command every cell; see `Controller`."""
        target = seen.target
        rest, band = self._limits[target.shape]
        off = target - rest
        np.abs(off, off)
        # Outside the blister formed cells hold, the others rest: True and False are the codes of these modes.
        mode: NDArray[np.int8] = (off > band).view(np.int8)
        if self.is_active(memory):
            memory, target = self._create_blister(memory, seen, mode)
        command = lock_overloaded(self.parameters.command(target, seen.height), seen.force, self.lift)
        return memory, Commands(target, mode, command)

    def _create_blister(self, memory: Any, seen: Measurement, mode: NDArray[np.int8]) -> tuple[Any, Floats]:
        """Blister Creation: edge heights, profile, freezing; modes are set in place."""
        cells = self._rule.divide(self.get_pose(memory), seen.quadratic_basis)
        facing = self._rule.find_edge(cells)
        level = sum_weighted(seen.height, facing).tolist()
        memory = self.set_edge(memory, level, count_true(facing))
        edge, top, kind, beyond = self.get_heights(memory)
        ground = self.ground.find(seen, edge)
        profile, uneven = self.ground.find_profile(
            self.blister, cells.distance, cells.inside, ground, top, seen
        )
        frozen = self._rule.find_frozen(cells, seen, uneven)
        if any_true(frozen):
            # What is frozen is never called back; a blister that outgrows it takes it along.
            kept = self.ground.find_kept(seen.target, profile, ground, top, uneven)
            kept |= beyond
            kept &= frozen
            np.putmask(profile, kept, seen.target)
        target = seen.target.copy()
        np.putmask(target, cells.inside, profile)
        self._rule.set_modes(mode, cells, seen.force, kind, frozen)
        return memory, target

    @cached_property
    def _noisy(self) -> bool:
        """Whether some reading may be noise."""
        return bool(np.any(self.floor))

    @cached_property
    def _rule(self) -> BlisterRule:
        """Which cells of the blister are frozen, and which are touched."""
        known = self.parameters
        release = np.maximum(known.release_force, self.floor) if self._noisy else known.release_force
        return BlisterRule(self.blister, known.behind, release, self.floor)

    @cached_property
    def _limits(self) -> Constants:
        """Height of a pin at rest, and how far from it one counts as formed, m."""
        return Constants((self.actuator.rest_height, self.parameters.dead_band))


@dataclass(frozen=True, eq=False)
class VirtualMasterBatch(VirtualMasterControl):
    """Controller of Method I for the beds of a batch: its masters are decided about run by run."""

    follow = decide_by_run(MasterControl.follow)
    lead = decide_by_run(MasterControl.lead)
    set_surface = decide_by_run(MasterControl.set_surface)
    add_noise = decide_by_run(MasterControl.add_noise)
    find_disc = decide_by_run(MasterControl.find_disc)
    set_edge = decide_by_run(MasterControl.set_edge)
    get_place = gather_by_run(MasterControl.get_place)
    get_pose = gather_by_run(MasterControl.get_pose)
    get_heights = gather_by_run(MasterControl.get_heights)

    is_active = decide_by_any(MasterControl.is_active)
    is_new = decide_by_any(MasterControl.is_new)


def build(parameters: VirtualMaster, device: DeviceInfo) -> VirtualMasterControl:
    """Put Method I together for a device; the device has a blister."""
    assert device.blister is not None
    asked = parameters.force_setpoint
    check_floor(HEAVIEST * asked, "force_setpoint", asked, device.force_floor)
    model = make_master_cell(device.cell, device.period)
    parts = parameters, device.blister, device.cell.actuator, model
    ground = GROUNDS[parameters.ground]
    return VirtualMasterControl(*parts, device.period, device.lift, device.force_floor, ground)
