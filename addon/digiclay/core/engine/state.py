"""State of a session at one instant, as a value.

All quantities of a cell are rows of one array, so that an omitted part has no row. The few
active cells are stored outside that array, contiguously, as long as the active set is the
same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Flags, Floats
from ..base.modes import LOCKED, REST
from ..model.control_interface import Commands, Measurement
from ..model.layout import Discs

if TYPE_CHECKING:
    from ..model.matrix_drive import Addressing
    from ..model.yielding_hand import Deflection


@dataclass(frozen=True)
class Rows:
    """Meaning of the rows of a cell's state.

    The first `physics` rows (height first, m) are the continuous state of `physics.Cell`;
    then come the queued commands, oldest first; the commanded height, m; the force at the end
    of the last period, N; the rows of the controller and the sensors; and the forces of several
    fingers, N.
    """

    physics: int
    queue: int
    control: int = 0
    sensors: int = 0
    fingers: int = 0

    @cached_property
    def driven(self) -> slice:
        """Rows of a stepper: the physics and the queued commands."""
        return slice(0, self.target)

    @cached_property
    def commands(self) -> slice:
        """Rows of the queued commands."""
        return slice(self.physics, self.target)

    @cached_property
    def command(self) -> int:
        """Row of the newest command."""
        return self.target - 1

    @cached_property
    def target(self) -> int:
        """Row of the commanded height."""
        return self.physics + self.queue

    @cached_property
    def force(self) -> int:
        """Row of the force."""
        return self.target + 1

    @cached_property
    def count(self) -> int:
        """Number of rows."""
        return self.force + 1 + self.control + self.sensors + self.fingers

    @cached_property
    def controlled(self) -> slice:
        """Rows of the controller."""
        return slice(self.force + 1, self.force + 1 + self.control)

    @cached_property
    def sensed(self) -> slice:
        """Rows of the sensors."""
        return slice(self.controlled.stop, self.pressing.start)

    @cached_property
    def pressing(self) -> slice:
        """Rows of the forces of several fingers; a single one has only the force."""
        return slice(self.count - self.fingers, self.count)


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Active cells, with their rows outside the bed's array: m of one run, or m of each of b runs."""

    rows: Rows
    """Meaning of the rows of the block."""
    cells: Cells
    """(m,) or (m, b): Numbers in their beds: first those that the fingertip may touch, then the others that
    move or are controlled."""
    near: int
    """Number k of cells that the fingertip may touch."""
    block: Floats
    """(r, m) or (r, m, b): Their rows, see `Rows`."""
    mode: NDArray[np.int8]
    """(m,) or (m, b): Their control modes, `modes.Mode`."""
    quadratic_basis: Floats
    """(6, m) or (6, m, b): Rows 1, x, y, x², x y, y²: any quadratic form of the position is one product."""
    reach: Discs | None
    control: Discs | None
    """Discs whose cells are all included, the fingertip's and the controller's: center x, y, radius, m;
    arrays (b,) of b runs."""
    peak: Any
    """Bound of the pin tops near the fingertip while this set serves, m; a number or (b,)."""
    until: int
    """Control period by which the set is to be renewed."""
    runs: tuple[ActiveSet, ...] = ()
    """In a batch whose runs keep the sets they have alone: these sets, without block, modes and basis. Their
    cells are the first of each run; others fill the columns."""
    under: Flags | None = None
    """(f, n): Cells of the bed that bodies may touch while this set serves, in the rows behind those of the
    fingertips; None without bodies."""

    # Parts of the block, all of them views, made once, since a set serves for many periods.

    @cached_property
    def all(self) -> Measurement:
        """All cells."""
        return self._part(len(self.cells), [len(run.cells) for run in self.runs])

    @cached_property
    def touched(self) -> Measurement:
        """The cells that the fingertip may touch."""
        return self._part(self.near, [run.near for run in self.runs])

    def _part(self, count: int, present: list[int]) -> Measurement:
        """Return the rows of the first `count` cells, of which the first `present` are those of the runs."""
        rows, block = self.rows, self.block[:, :count]
        return Measurement(
            self.quadratic_basis[:, :count],
            block[0],
            block[rows.force],
            block[rows.target],
            self.mode[:count],
            (self.block if rows.fingers else block)[rows.controlled],
            self.cells[:count],
            block[rows.command],
            block[rows.sensed],
            tuple(present),
            *((self.control, block[rows.pressing]) if rows.fingers else (None, None)),
        )

    @cached_property
    def driven(self) -> Floats:
        """The rows of a stepper."""
        return self.block[self.rows.driven]

    @cached_property
    def movements(self) -> dict[Any, Any]:
        """Steppers prepared for these cells, by their plans; of several fingers by their system."""
        return {}

    @cached_property
    def queue(self) -> tuple[Floats, ...]:
        """The queued commands, oldest first."""
        return tuple(self.block[self.rows.commands])

    def queue_command(self, newest: Floats) -> None:
        """Queue a command of each cell, (m,) or (m, b), 1, in place."""
        for older, newer in pairwise(self.queue):
            older[:] = newer
        self.queue[-1][:] = newest

    def follow(self, orders: Commands) -> None:
        """Set targets, modes and valve commands, in place."""
        self.all.target[:] = orders.target
        self.all.mode[:] = orders.mode
        for command in orders.queued:
            self.queue_command(command)

    @cached_property
    def flat(self) -> Cells:
        """Numbers of the cells among all cells of all beds, shape (m,) or (m, b)."""
        if self.cells.ndim == 1:
            return self.cells
        runs = self.cells.shape[1]
        return self.cells * runs + np.arange(runs)

    @cached_property
    def numbers(self) -> Floats:
        """Numbers of the physics, commands, targets and forces, in a row."""
        return self.block[: self.rows.force + 1].reshape(-1)


class State(NamedTuple):
    """State of a session, or of b sessions, at the start of a control period."""

    period: int
    """Number of control periods so far."""
    rows: Floats
    """(r, n) or (r, n, b): See `Rows`; out of date for the cells in `active`: read it with `row`."""
    modes: NDArray[np.int8]
    """(n,) or (n, b): Control modes; out of date for the cells in `active`: read them with `mode`."""
    aged: Floats
    """(n,) or (n, b): Time up to which a cell's relaxation is computed, s: the pulp over cells out of reach
    relaxes further, and is aged exactly when it is needed again."""
    peak: Any
    """Bound of the pin tops outside `active`, m; a number or (b,)."""
    active: ActiveSet
    memory: Any
    """The controller's memory."""
    locks: Floats | None = None
    """(n,): Shares below 1 by which pins are locked in part, 0 of all others; None: no pin is."""
    deflection: Deflection | None = None
    """Of the hands that hold the fingertips; None: the paths are prescribed."""
    addressing: Addressing | None = None
    """Of the drive; None: a valve per cell."""

    def end_period(
        self, memory: Any, deflection: Deflection | None, addressing: Addressing | None
    ) -> State:
        """Return the state one control period later, with the memory of the controller."""
        return State(
            self.period + 1,
            self.rows,
            self.modes,
            self.aged,
            self.peak,
            self.active,
            memory,
            self.locks,
            deflection,
            addressing,
        )

    def row(self, index: int) -> Floats:
        """Return a row of all cells, (n,) or (n, b), as a new array; see `Rows`."""
        values: Floats = self.rows[index].copy()
        values.reshape(-1)[self.active.flat] = self.active.block[index]
        return values

    def finger_forces(self) -> Floats:
        """Return the total force of each finger, (f,), N."""
        rows = self.active.rows
        pressing = rows.pressing if rows.fingers else slice(rows.force, rows.force + 1)
        return self.active.block[pressing].sum(axis=1)

    def mode(self) -> NDArray[np.int8]:
        """Return the control modes of all cells, shape (n,) or (n, b), as a new array."""
        values = self.modes.copy()
        values.reshape(-1)[self.active.flat] = self.active.mode
        return values

    def waiting(self) -> Flags:
        """Return which cells wait for their drive, (n,)."""
        flags = np.zeros(self.rows.shape[1], np.bool_)
        if self.addressing:
            flags[self.addressing.waiting] = True
        return flags

    def shares(self) -> Floats:
        """Return the shares by which pins are locked, (n,), from 0 to 1."""
        locks = 0.0 if self.locks is None else self.locks
        return np.where(self.mode() == LOCKED, 1.0, locks)

    def copy(self) -> State:
        """Return a state that shares with this one no array that a step changes."""
        active = replace(self.active, block=self.active.block.copy(), mode=self.active.mode.copy())
        return self._replace(
            rows=self.rows.copy(), modes=self.modes.copy(), aged=self.aged.copy(), active=active
        )


def make_initial_state(rows: Rows, count: int, height: Any, memory: Any) -> State:
    """Return the state before a session, or before b sessions, of n pins at a height, m: every valve shut."""
    runs = np.shape(height)
    values = np.zeros((rows.count, count, *runs))
    values[0] = values[rows.target] = height
    none = ActiveSet(
        rows,
        np.empty((0, *runs), np.intp),
        0,
        np.empty((rows.count, 0, *runs)),
        np.empty((0, *runs), np.int8),
        np.empty((6, 0, *runs)),
        None,
        None,
        height,
        0,
    )
    modes, aged = np.full((count, *runs), REST, np.int8), np.zeros((count, *runs))
    return State(0, values, modes, aged, height, none, memory)
