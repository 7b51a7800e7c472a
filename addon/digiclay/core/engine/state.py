"""State of a session at one instant, as a value.

All that belongs to a cell is a row of one array, so that a part that is left out owns no
row. The few cells that take part in a period are taken out of that array and kept out,
side by side, for as long as the same cells take part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells, Floats
from ..base.modes import Mode
from ..model.control_interface import Commands, Measurement
from ..model.layout import Discs


@dataclass(frozen=True)
class Rows:
    """Meaning of the rows of a cell's state.

    The first `physics` rows (height first, m) are the continuous state of `physics.Cell`;
    then come the commands on their way to the valve, oldest first; the height a cell is
    commanded to, m; the force on it at the end of the last period, N; what the
    controller and the sensors remember of each cell; and the forces of several fingers, N.
    """

    physics: int
    queue: int
    control: int = 0
    sensors: int = 0
    fingers: int = 0

    @cached_property
    def driven(self) -> slice:
        """Rows a stepper works on: the physics and the commands on their way."""
        return slice(0, self.physics + self.queue)

    @cached_property
    def commands(self) -> slice:
        """Rows of the commands on their way."""
        return slice(self.physics, self.physics + self.queue)

    @cached_property
    def command(self) -> int:
        """Row of the newest command."""
        return self.physics + self.queue - 1

    @cached_property
    def target(self) -> int:
        """Row of the commanded height."""
        return self.physics + self.queue

    @cached_property
    def force(self) -> int:
        """Row of the force."""
        return self.physics + self.queue + 1

    @cached_property
    def count(self) -> int:
        """Number of rows."""
        return self.force + 1 + self.control + self.sensors + self.fingers

    @cached_property
    def controlled(self) -> slice:
        """Rows the controller owns."""
        return slice(self.force + 1, self.force + 1 + self.control)

    @cached_property
    def sensed(self) -> slice:
        """Rows the sensors own."""
        return slice(self.force + 1 + self.control, self.count - self.fingers)

    @cached_property
    def pressing(self) -> slice:
        """Rows of the forces of several fingers; of a single one it is the force."""
        return slice(self.count - self.fingers, self.count)


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Active cells, with their rows outside the bed's array: m of one run, or m of each of b runs."""

    rows: Rows
    """Which row of the block holds what."""
    cells: Cells
    """(m,) or (m, b): Numbers in their own beds: first those the fingertip may touch, then the others that
    move or are controlled."""
    near: int
    """Number k of those the fingertip may touch."""
    block: Floats
    """(r, m) or (r, m, b): Their rows, see `Rows`."""
    mode: NDArray[np.int8]
    """(m,) or (m, b): Their control modes, `modes.Mode`."""
    quadratic_basis: Floats
    """(6, m) or (6, m, b): Rows 1, x, y, x², x y, y²: any quadratic form of the position is one product."""
    reach: Discs | None
    control: Discs | None
    """Discs of which every cell is in, the fingertip's and the controller's: center x, y, radius, m; arrays
    (b,) of b runs."""
    peak: Any
    """No pin top in the fingertip's part is higher while this set is in use, m; a number or (b,)."""
    until: int
    """Control period by which the set is to be made anew."""
    own: tuple[ActiveSet, ...] = ()
    """In a batch whose runs have the sets they have alone: these, of which block, modes and basis are not
    looked at. Their cells are the first of each run's; others make up the number."""

    # Parts of the block, all of them views. Each is made once: a set lives for many periods.

    @cached_property
    def all(self) -> Measurement:
        """All cells."""
        return self._part(len(self.cells), [len(one.cells) for one in self.own])

    @cached_property
    def touched(self) -> Measurement:
        """The cells the fingertip may touch."""
        return self._part(self.near, [one.near for one in self.own])

    def _part(self, count: int, present: list[int]) -> Measurement:
        """Return the rows of the first `count` cells; the first `present` of them are the runs' own."""
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
        """What a stepper works on."""
        return self.block[self.rows.driven]

    @cached_property
    def movements(self) -> dict[Any, Any]:
        """Steppers prepared for these cells, by their plans; of several fingers by their system."""
        return {}

    @cached_property
    def queue(self) -> tuple[Floats, ...]:
        """The commands on their way, oldest first."""
        return tuple(self.block[self.rows.commands])

    def queue_commands(self, newest: Floats) -> None:
        """Put valve commands (m,) or (m, b), 1, behind those on their way, in place."""
        for older, newer in pairwise(self.queue):
            older[:] = newer
        self.queue[-1][:] = newest

    def follow(self, orders: Commands) -> None:
        """Take over targets, modes and valve commands, in place."""
        self.all.target[:] = orders.target
        self.all.mode[:] = orders.mode
        self.queue_commands(orders.command)

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
    """Number of control periods done."""
    rows: Floats
    """(r, n) or (r, n, b): See `Rows`; out of date for the cells in `active`: read it with `row`."""
    modes: NDArray[np.int8]
    """(n,) or (n, b): Control modes; out of date for the cells in `active`: read them with `mode`."""
    aged: Floats
    """(n,) or (n, b): Time up to which a cell's relaxation has been worked out, s: the pulp over cells out of
    reach goes on relaxing, and is aged exactly when it is needed again."""
    peak: Any
    """No pin top outside `active` is higher than this, m; a number or (b,)."""
    active: ActiveSet
    memory: Any
    """The controller's memory."""

    def end_period(self, memory: Any) -> State:
        """Return the state one control period later, with the controller's memory."""
        return State(self.period + 1, self.rows, self.modes, self.aged, self.peak, self.active, memory)

    def row(self, index: int) -> Floats:
        """Return one row of all cells, shape (n,) or (n, b), as a new array; `Rows` names them."""
        values: Floats = self.rows[index].copy()
        values.reshape(-1)[self.active.flat] = self.active.block[index]
        return values

    def finger_forces(self) -> Floats:
        """Return the total force of each finger, (f,), N."""
        rows = self.active.rows
        own = slice(rows.force, rows.force + 1) if not rows.fingers else rows.pressing
        forces: Floats = self.active.block[own].sum(axis=1)
        return forces

    def mode(self) -> NDArray[np.int8]:
        """Return the control modes of all cells, shape (n,) or (n, b), as a new array."""
        values = self.modes.copy()
        values.reshape(-1)[self.active.flat] = self.active.mode
        return values

    def copy(self) -> State:
        """Return a state that shares no array with this one that a step would change."""
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
    modes, aged = np.full((count, *runs), Mode.REST, np.int8), np.zeros((count, *runs))
    return State(0, values, modes, aged, height, none, memory)
