"""Masters of a batch: those of few runs are led one by one, those of many in arrays.

Array formulas lead the masters in the usual situation. A master that is touched or lost, turns, or
comes near the rim is led in plain numbers like that of a single run. All results are the same, bit
for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import TIE, Flags, Floats
from ..base.modes import FORCE_FOLLOW, SPRING
from ..model.control_interface import Memory
from .travel import PARTS, Heading
from .virtual_master import (
    CARRIED,
    IDLE,
    NOWHERE,
    SHAPING,
    SPRINGING,
    Master,
    MasterCell,
    Phase,
    VirtualMasterControl,
)

#: Rows of the masters' numbers.
PHASE, X, Y, HEIGHT, OPENING, REFERENCE, EDGE = range(7)
FROM_X, FROM_Y, TOWARD_X, TOWARD_Y, FELT, ALONE, LOSSES = range(7, 14)
#: Phases as plain numbers, which numpy takes ten times as fast as members of an enumeration.
AWAY, SPRUNG, SHAPED = float(IDLE), float(SPRINGING), float(SHAPING)
#: Share of the travel within which no new direction is certain.
SHORT = 0.99


def _decide_by_run(
    decide: Callable[..., Any], join: Callable[[Iterable[Any]], Any] = list
) -> Callable[..., Any]:
    """Return a method of a batch that calls a method of each run with its memory and numbers."""

    def decide_all(batch: VirtualMasterBatch, memory: list[Master], *columns: list[Any]) -> Any:
        return join(map(decide, batch.runs, memory, *columns))

    return decide_all


def _gather(rows: Iterable[tuple[Any, ...]]) -> tuple[Any, ...]:
    """Return the numbers of each run as arrays (b,)."""
    return tuple(map(np.array, zip(*rows, strict=True)))


@dataclass(frozen=True, eq=False)
class VirtualMasterBatch(VirtualMasterControl):
    """Controller of Method I for the beds of a batch: its memory is a list of masters."""

    follow = _decide_by_run(VirtualMasterControl.follow)
    is_new = _decide_by_run(VirtualMasterControl.is_new, any)
    lead = _decide_by_run(VirtualMasterControl.lead)
    find_disc = _decide_by_run(VirtualMasterControl.find_disc)
    is_active = _decide_by_run(VirtualMasterControl.is_active, any)
    get_pose = _decide_by_run(VirtualMasterControl.get_pose, lambda poses: np.array(list(poses)).T)
    set_edge = _decide_by_run(VirtualMasterControl.set_edge)
    get_heights = _decide_by_run(VirtualMasterControl.get_heights, _gather)


class Masters(Sequence[Master]):
    """Masters of b runs: their numbers (14, b)."""

    def __init__(self, numbers: Floats) -> None:
        self.numbers = numbers

    def __len__(self) -> int:
        return self.numbers.shape[1]

    def __getitem__(self, run: Any) -> Any:
        phase, *numbers, from_x, from_y, toward_x, toward_y, felt, alone, losses = self.numbers[
            :, run
        ].tolist()
        heading = Heading(from_x, from_y, toward_x, toward_y)
        return Master._make((Phase(phase), *numbers, heading, felt, int(alone), int(losses)))

    def copy(self) -> Masters:
        """Return masters that share no array with these."""
        return Masters(self.numbers.copy())

    def put(self, runs: Flags, masters: list[Master]) -> None:
        """Replace those of some runs (b,), in place."""
        for run, master in zip(runs.nonzero()[0].tolist(), masters, strict=True):
            self.numbers[:, run] = _list(master)


def _list(master: Master) -> tuple[Any, ...]:
    """Return the numbers of a master."""
    return (*master[:7], *master.heading, *master[8:])


def gather(memory: Sequence[Master]) -> Masters:
    """Return masters side by side: those of a list, or as they are."""
    if isinstance(memory, Masters):
        return memory
    return Masters(np.array([_list(master) for master in memory]).T)


def _find_speed(cell: MasterCell, opening: Floats) -> Floats:
    """Return the speeds of unloaded pins, (b,), m/s; see `MasterCell.speed`."""
    drive = cell.supply.pressure(opening) / cell.area
    conductance: Floats = cell.flow.laminar_conductance(opening)
    if not np.all(cell.laminar):
        turbulent = cell.flow.conductance(opening, drive * cell.area)
        conductance = np.where(cell.laminar, conductance, turbulent)
    conductance *= drive
    return conductance


@dataclass(frozen=True, eq=False)
class VirtualMasterColumns(VirtualMasterControl):
    """Controller of Method I for the beds of a batch of many runs: its memory are `Masters`, sums (b,)."""

    def to_numbers(self, sums: Floats) -> Any:
        """Return the sums, (b,), as they are."""
        return sums

    def follow(self, memory: Memory, *sums: Any) -> Any:
        """VM Locate: see `VirtualMasterControl.follow`."""
        masters, gains = gather(memory).copy(), self.parameters
        numbers, felt = masters.numbers, gains.felt_force
        total, _, _, near, near_x, near_y = np.array(sums)
        none, idle = total < felt, numbers[PHASE] == AWAY
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = np.rint(np.array((near_x, near_y)) / near * PARTS) / PARTS
            square = (x - numbers[FROM_X]) ** 2 + (y - numbers[FROM_Y]) ** 2
        goes = ~none & ~idle & (near >= felt) & (square < (SHORT * gains.travel) ** 2)
        others = ~goes & ~(none & idle)
        alone = [
            self.runs[i].follow(masters[i], *(values[i] for values in sums))
            for i in others.nonzero()[0]
        ]
        np.copyto(numbers[X], x, where=goes)
        np.copyto(numbers[Y], y, where=goes)
        np.copyto(numbers[ALONE], 0.0, where=goes)
        masters.put(others, alone)
        return masters

    def is_new(self, memory: Memory) -> bool:
        """Tell whether some master has located a fingertip, and has no height yet."""
        return bool(np.isnan(memory.numbers[HEIGHT]).any())

    def lead(self, memory: Memory, force: Any, surface: Any, noise: Any = 0.0) -> Any:
        """VM Control and VM Model: see `VirtualMasterControl.lead`."""
        masters, gains, cell = memory.copy(), self.parameters, self.model
        numbers = masters.numbers
        phase, x, y, height, opening = numbers[:5]
        (at_x, at_y, reach), noises = self.rim, np.broadcast_to(noise, len(masters))
        inner = (np.abs(x) + reach <= at_x) & (np.abs(y) + reach <= at_y)
        goes = (phase > AWAY) & (numbers[ALONE] == 0.0) & (height > -np.inf) & inner
        others = ~goes & (phase > AWAY)
        alone = [
            self.runs[i].lead(masters[i], force[i], surface[i], noises[i])
            for i in others.nonzero()[0]
        ]
        felt = force + noise
        error = gains.force_setpoint - felt
        springs = (phase == SPRUNG) & (error > TIE)
        sprung = gains.position_gain * (numbers[REFERENCE] - felt / gains.spring_stiffness - height)
        effort = np.where(springs, sprung, gains.force_gain * error)
        command = np.minimum(np.maximum(effort, -1.0), 1.0)
        (a, b), (c, d), (e, f) = cell.openings
        first, second = (_find_speed(cell, p * opening + q * command) for p, q in ((a, b), (c, d)))
        risen = height + cell.period * (0.5 * (first + second))
        risen = np.minimum(np.maximum(risen, 0.0), cell.stroke)
        after = np.where(springs, SPRUNG, SHAPED), risen, e * opening + f * command, risen
        for row, values in zip((PHASE, HEIGHT, OPENING, FELT), after, strict=True):
            np.copyto(numbers[row], values, where=goes)
        masters.put(others, alone)
        return masters

    def find_disc(self, memory: Memory) -> Any:
        """Return the discs that the masters control, m, or None of each."""
        radius = np.broadcast_to(self.blister.edge_radius, len(memory)).tolist()
        phase, x, y = memory.numbers[:3].tolist()
        return [disc[1:] if disc[0] else None for disc in zip(phase, x, y, radius, strict=True)]

    def is_active(self, memory: Memory) -> bool:
        """Tell whether some master follows a fingertip."""
        return bool(memory.numbers[PHASE].any())

    def get_pose(self, memory: Memory) -> tuple[Any, Any, Any, Any]:
        """Return positions of the masters, (b,), m, and directions of travel."""
        numbers = gather(memory).numbers
        idle = numbers[PHASE] == AWAY
        x, y = np.where(idle, NOWHERE, numbers[X : Y + 1])
        return x, y, numbers[TOWARD_X], numbers[TOWARD_Y]

    def set_edge(self, memory: Memory, level: Any, count: Any) -> Any:
        """Put masters into surfaces: see `VirtualMasterControl.set_edge`."""
        masters, cells = memory.copy(), np.array(count)
        edge = level / np.maximum(cells, 1)
        edge = np.minimum(np.maximum(edge, 0.0), self.actuator.stroke)
        np.copyto(masters.numbers[EDGE], edge, where=cells > 0)
        return masters

    def get_heights(self, memory: Memory) -> tuple[Any, Any, Any, Any]:
        """Return heights around and of the masters, (b,), and the rest of `VirtualMasterControl`'s."""
        phase, height, edge, felt, alone = memory.numbers[[PHASE, HEIGHT, EDGE, FELT, ALONE]]
        kind = np.where(phase == SPRUNG, SPRING, FORCE_FOLLOW)
        return edge, height, kind, (alone > 0.0) & (height - felt > CARRIED * self.blister.radius)
