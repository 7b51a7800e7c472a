"""Beds whose cells have gates of their lines and columns: commands, active set, creep of idle cells.

A gate of a line has the same opening in all its cells, and so has one of a column in a set of lines.
Idle cells, on which nothing presses, therefore move as the sum of what a cell does whose line alone,
and one whose column alone, has opened: a cell without load stands for each line and each column.
Their motion is added to idle cells whenever the active set is renewed. Lines without active cells
stay shut, and cells where an open line meets an open column are active.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Cells, Flags, Floats, Modes
from ..model.control_interface import Commands, Measurement
from ..model.fingertip import Window
from ..model.gates import Gates
from ..model.interfaces import Movement, Stepper
from ..model.layout import Discs
from ..model.matrix_drive import Addressing, MatrixAddressing
from ..model.physics import Cell
from .active_set import Selection
from .state import ActiveSet, Rows, State


class GatedCommands(NamedTuple):
    """Output of the drive; see `Commands`, with column gates for valves, and commands of the line gates."""

    target: Floats
    mode: Modes
    command: Floats
    gate: Floats
    others: Floats
    """Commands of the column gates while other lines are addressed."""

    @property
    def queued(self) -> tuple[Floats, ...]:
        """What is queued of it in a control period."""
        return self.gate, self.others, self.command


class GatedAddressing(NamedTuple):
    """State of the drive; see `Addressing` for the first three."""

    served: Flags
    last: Cells
    waiting: Cells
    cells: Floats
    """(r, n + k m + 1): Rows of a cell for each line, for each column, and of one whose gates stay shut."""
    aged: int
    """Control period up to which idle cells are as of now."""


@dataclass(frozen=True, eq=False)
class GatedDrive:
    """Drive whose lines and columns have gates in series."""

    lines: MatrixAddressing
    cell: Cell
    """With `Gates` as its lag."""
    rows: Rows
    stepper: Stepper
    plan: Any
    instants: int
    creep: float
    """Motion of an idle cell in a period while both gates are shut, m."""
    lift: float
    """Rise of an idle cell by the volume between its gates, V / (β A), m/Pa."""

    @property
    def gates(self) -> Gates:
        """Gates of a cell."""
        gates: Any = self.cell.lag
        return gates

    @property
    def sets(self) -> list[str | int]:
        """Axis and number of sets."""
        return self.lines.sets

    @property
    def filled(self) -> slice[int, int, None]:
        """Row of the volumes between gates, none without them."""
        return slice(self.cell.lag_rows.start + 2, self.cell.lag_rows.stop)

    @property
    def columns(self) -> int:
        """Number m of cells in a line."""
        layout = self.lines.layout
        return layout.rows * layout.columns // self.lines.lines

    @cached_property
    def workspace(self) -> tuple[Floats, Movement]:
        """Rows of the cells of lines and columns, and their movement."""
        count = self.lines.lines + self.lines.parameters.sections * self.columns + 1
        rows = np.zeros((self.rows.target, count))
        return rows, self.stepper.prepare(self.plan, rows, 0)

    def begin(self) -> GatedAddressing:
        """Return the state before a session: all gates are shut."""
        cells = np.zeros_like(self.workspace[0])
        self.restart(cells)
        return GatedAddressing(*self.lines.begin(), cells, 0)

    def restart(self, cells: Floats) -> None:
        """Put the cells of lines and columns at half the stroke, those of lines with full volumes."""
        cells[0] = 0.5 * self.cell.actuator.stroke
        cells[self.filled] = np.arange(cells.shape[1]) < self.lines.lines

    def find_gates(self, cells: Cells) -> tuple[Cells, Cells]:
        """Return the numbers of the lines and of the columns of cells in `GatedAddressing.cells`."""
        line, place = self.lines.parameters.locate(self.lines.layout, cells)
        section = line % self.lines.parameters.sections
        return line, self.lines.lines + section * self.columns + place

    def serve(
        self, state: GatedAddressing, period: int, seen: Measurement, orders: Commands
    ) -> tuple[GatedAddressing, Commands]:
        """Return the commands of both gates of cells in a control period: also where the line is shut."""
        addressing, orders = self.lines.serve(Addressing(*state[:3]), period, seen, orders)
        line, column = self.find_gates(seen.cells)
        block, move = self.workspace
        block[:] = state.cells
        queue = block[self.rows.commands]
        queue[:-3], queue[-3:] = queue[3:].copy(), 0.0
        addressed = addressing.served[line]
        queue[-3, line[addressed]] = 1.0
        command = self.gates.command(orders.command)
        queue[-2, column[addressed]] = command[addressed]
        others = np.where(addressed, 0.0, queue[-2, column])
        commands: Any = GatedCommands(orders.target, orders.mode, command, queue[-3, line], others)
        move(np.empty((self.instants, 0)))
        return GatedAddressing(*addressing, block.copy(), state.aged), commands

    def age(self, rows: Floats, state: GatedAddressing, period: int) -> GatedAddressing:
        """Move idle cells, of rows (r, n), in place, up to a control period."""
        height, filled = rows[0], rows[self.filled]
        line, column = self.find_gates(np.arange(height.size))
        risen = state.cells[0] - state.cells[0, -1]
        height += risen[line] + risen[column] + (period - state.aged) * self.creep
        left, new = (state.cells[self.filled, gates] for gates in (line, column))
        supply = self.cell.supply
        excess = np.abs(filled) * supply.pressure(filled) - supply.high
        height += self.lift * (excess * (1.0 - left)).sum(axis=0)
        # One of the gates of an idle cell has stayed shut.
        filled[:] = filled * left * (1.0 - np.abs(new)) + new
        np.clip(height, 0.0, self.cell.actuator.stroke, out=height)
        cells = state.cells.copy()
        self.restart(cells)
        return state._replace(cells=cells, aged=period)


@dataclass(frozen=True, eq=False)
class GatedSelection(Selection):
    """Selection of the active cells where cells have two gates."""

    drive: GatedDrive

    #: Control periods for which a set serves, and by which idle cells may be out of date.
    lifetime = 8

    def renew(
        self, state: State, active: ActiveSet, window: Window | None, disc: Discs | None
    ) -> State:
        """Return a state, in the same arrays, with another set, and idle cells as of now."""
        addressing: Any = state.addressing
        addressing = self.drive.age(state.rows, addressing, state.period)
        peak = max(state.peak, float(state.rows[0].max()))
        return super().renew(state._replace(addressing=addressing, peak=peak), active, window, disc)

    @cached_property
    def of_gates(self) -> tuple[list[int], list[int]]:
        """Rows of the lines' gates and of the columns', with their commands."""
        first, queue = self.cell.lag_rows.start, range(self.rows.physics, self.rows.target)
        return [first, *queue[::3]], [first + 1, *queue[1::3], *queue[2::3]]

    def find_driven(self, block: Floats) -> Flags:
        """Return the cells whose two gates are open, or will be by queued commands."""
        lines, columns = (block[rows].any(axis=0) for rows in self.of_gates)
        driven: Flags = lines & columns
        return driven

    def pick(
        self, active: ActiveSet, moving: Flags, reach: Discs | None, control: Discs | None
    ) -> tuple[Cells, int]:
        """Return the active cells, with all where their lines and columns cross; see `Selection`."""
        cells, near = super().pick(active, moving, reach, control)
        lines = self.drive.lines
        line, place = lines.parameters.locate(lines.layout, np.arange(self.grid.count))
        still_open = active.cells[active.block[self.of_gates[0]].any(axis=0)]
        crossing = np.isin(line, line[np.append(cells, still_open)]) & np.isin(place, place[cells])
        crossing[cells] = False
        return np.concatenate([cells, np.flatnonzero(crossing)]), near

    def take(self, state: State, chosen: ActiveSet) -> ActiveSet:
        """Return the chosen set with its rows; gates of new cells are those of lines and columns."""
        active, addressing = super().take(state, chosen), state.addressing
        new = np.flatnonzero(np.isin(active.cells, state.active.cells, invert=True))
        line, column = self.drive.find_gates(active.cells[new])
        gates: Floats = addressing.cells  # type: ignore[union-attr]
        for rows, owner in zip(self.of_gates, (line, column), strict=True):
            active.block[np.array(rows)[:, None], new] = gates[rows][:, owner]
        return active
