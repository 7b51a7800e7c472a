"""Engine of a bed under several fingertips: its active cells, and how they move.

A cell is moved once for each fingertip that may touch it, as if that one were alone: a pair. All pairs are
the cells of one large bed to the stepper. The lowest of a cell's pairs is right unless two of its fingertips
press it: then the cell is moved again under both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..base.arrays import Cells, Flags, Floats, find_copies
from ..model.fingers import HandPeriod, HandTouch
from ..model.layout import RELATIVE_TOLERANCE, Discs, join_discs
from ..model.physics import Cell
from .active_set import KEPT, Selection
from .state import ActiveSet, State
from .system import System

#: Moves cells that several fingers press: heights (g,), openings and commands (l, g), filters (r, c, g),
#: undersides at the period's instants (p, c, g), fingers (c, g); returns heights, filters, forces (c, g), N.
PressTogether = Callable[[Floats, Floats, Floats, Floats, Cells], tuple[Floats, Floats, Floats]]


@dataclass(frozen=True, eq=False)
class HandSelection(Selection):
    """Selection of the active cells of a bed under f fingertips, one disc each."""

    #: Discs are arrays (f,), the highest pin one number.
    larger: ClassVar[Callable[..., Any]] = staticmethod(lambda one, other: max(one, float(other)))

    def serves(self, active: ActiveSet, period: int, window: Any, control: Discs | None) -> bool:
        """Return whether a set has all cells that can change; orders may ask for a disc more."""
        kept = active.control
        same = kept is not None and control is not None and len(kept[0]) == len(control[0])
        return same and super().serves(active, period, window, control)

    def join(self, control: Any) -> Discs | None:
        """Return the controlled discs as arrays."""
        return join_discs(control if isinstance(control, list) else [control])

    def pick(
        self, active: ActiveSet, moving: Flags, reach: Discs | None, control: Discs | None
    ) -> tuple[Cells, int]:
        """Return the near cells, then the moving and the controlled ones, and the number of near ones."""
        near = self._cover(reach)
        others = np.union1d(active.cells[moving], self._cover(control))
        return np.concatenate([near, np.setdiff1d(others, near, assume_unique=True)]), near.size

    def _cover(self, discs: Discs | None) -> Cells:
        """Return the cells in some disc, in ascending order."""
        if discs is None:
            return np.empty(0, np.intp)
        rows = np.transpose(discs).tolist()
        cells = [self.grid.disc(*disc) for disc in rows if disc[2] >= 0.0]
        return np.unique(np.concatenate(cells)) if cells else np.empty(0, np.intp)

    def release(self, state: State) -> Flags:
        """Put the active cells back; the pulp of a fingertip out of reach has aged since they were taken."""
        active, near, touch = state.active, state.active.near, self.cell.touch
        if near and active.reach is not None and isinstance(touch, HandTouch):
            rows = [own.pulp.rows for own in touch.each]
            apart = ~find_pairs(active)
            waited = (state.period - (active.until - KEPT)) * self.period
            touch.pulp.age(active.block[self.cell.pulp_rows, :near], np.repeat(apart * waited, rows, axis=0))
        return super().release(state)

    def take(self, state: State, chosen: ActiveSet) -> ActiveSet:
        """Take chosen cells out of the bed of a state whose set is released; see `Selection`."""
        taken = super().take(state, chosen)
        taken.block[self.rows.pressing] = 0.0
        return taken


def find_pairs(active: ActiveSet) -> Flags:
    """Return which near cells each of the fingertips may touch, (f, k)."""
    assert active.reach is not None
    x, y, radius = (np.asarray(part)[:, None] for part in active.reach)
    _, at_x, at_y = active.quadratic_basis[:3, : active.near]
    inside: Flags = (at_x - x) ** 2 + (at_y - y) ** 2 <= radius * np.abs(radius) * (1.0 + RELATIVE_TOLERANCE)
    return inside


@dataclass(frozen=True, eq=False)
class HandSystem(System):
    """Constants of a session with several fingers."""

    cells: tuple[Cell, ...]
    plans: tuple[Any, ...]
    """Those of the fingers; one and the same plan where fingers are alike."""
    press_together: PressTogether | None
    """None: nothing is touched."""

    @property
    def fingers(self) -> int:
        """Number of fingers."""
        return len(self.cells)

    def move(self, active: ActiveSet, finger: Any) -> None:
        """Move active cells through a control period under their queued commands, in place."""
        movements: dict[Any, Any] = active.movements
        if self not in movements:
            movements[self] = HandMovement(self, active)
        movements[self](finger)


class Pairs:
    """The pairs of fingers that are alike, prepared to be moved as the cells of one bed."""

    def __init__(self, system: HandSystem, active: ActiveSet, fingers: list[int], others: Cells) -> None:
        cell, rows, width = system.cells[fingers[0]], system.rows, active.cells.size
        inside = find_pairs(active) if active.near else np.zeros((system.fingers, 0), np.bool_)
        self.basis = [
            (finger, active.quadratic_basis[:, : active.near][:, inside[finger]])
            for finger in fingers
            if inside[finger].any()
        ]
        finger, self.cells = (part.astype(np.intp) for part in inside[fingers].nonzero())
        self.fingers = np.array(fingers)[finger]
        self.columns = columns = np.concatenate([self.cells, others])
        filters = np.arange(cell.pulp_rows.start, cell.pulp_rows.stop)[:, None]
        common = [0, *range(system.rows.physics)[system.cell.lag_rows], *range(rows.count)[rows.commands]]
        # Where in the block the rows of a pair are: height, filters of its own finger, openings and commands.
        of_pairs = (filters + self.fingers * filters.size) * width + self.cells
        self.filters, self.forces = of_pairs, (rows.pressing.start + self.fingers) * width + self.cells
        shared = np.array(common)[:, None] * width + columns
        unused = np.zeros((filters.size, others.size), np.intp)
        self.index = np.concatenate([shared[:1], np.concatenate([of_pairs, unused], axis=1), shared[1:]])
        self.own = np.empty(self.index.shape)
        self.pulp, count = slice(1, 1 + filters.size), self.cells.size
        self.lag = slice(self.pulp.stop, self.pulp.stop + cell.lag.rows)
        self.move = system.stepper.prepare(system.plans[fingers[0]], self.own, count)

    def advance(self, block: Floats, finger: HandPeriod | None, instants: int) -> Floats:
        """Move the pairs of a block, whose filters and forces are set in place; return undersides (p, k)."""
        flat, count = block.reshape(-1), self.cells.size
        np.take(flat, self.index, out=self.own)
        under = np.empty((instants, 0))
        if self.basis and finger is not None:
            under = np.concatenate([finger.under(number, basis) for number, basis in self.basis], axis=1)
        flat[self.forces] = self.move(under)
        flat[self.filters] = self.own[self.pulp, :count]
        return under


class HandMovement:
    """Moves a set of active cells under several fingertips, period by period."""

    def __init__(self, system: HandSystem, active: ActiveSet) -> None:
        self._system, self._active = system, active
        alike: dict[int, list[int]] = {}
        for finger, plan in enumerate(system.plans):
            alike.setdefault(id(plan), []).append(finger)
        others = np.arange(active.near, active.cells.size)
        groups = list(alike.values())
        self._groups = [Pairs(system, active, groups[0], others)]
        self._groups += [Pairs(system, active, fingers, others[:0]) for fingers in groups[1:]]
        self._fingers = np.concatenate([group.fingers for group in self._groups])
        self._double, self._copies = find_copies(np.concatenate([group.cells for group in self._groups]))

    def __call__(self, finger: HandPeriod | None) -> None:
        """Move the cells on by one control period, in place."""
        system, active = self._system, self._active
        rows, block, near = system.rows, active.block, active.near
        before = block.take(self._double, axis=1) if self._double.size else None
        under = [group.advance(block, finger, system.instants.size) for group in self._groups]
        for group in self._groups:
            block[0, group.columns] = group.own[0]
            block[system.cell.lag_rows, group.columns] = group.own[group.lag]
        if before is not None:
            heights = np.concatenate([group.own[0, : group.cells.size] for group in self._groups])
            block[0, self._double] = heights[self._copies].min(axis=0)
            self._press_together(before, np.concatenate(under, axis=1))
        np.add.reduce(block[rows.pressing, :near], axis=0, out=block[rows.force, :near])

    def _press_together(self, before: Floats, under: Floats) -> None:
        """Move the cells again that several fingers press; `before` (r, g): rows of all that they may."""
        system, block = self._system, self._active.block
        assert system.press_together is not None
        rows, touch = system.rows, system.cell.touch
        pressing = block[rows.pressing].take(self._double, axis=1)
        pressed = np.count_nonzero((pressing > 0.0) | (before[rows.pressing] > 0.0), axis=0) > 1
        if not pressed.any():
            return
        cells, copies, before = self._double[pressed], self._copies[:, pressed], before[:, pressed]
        fingers, lag = self._fingers[copies], before[system.cell.lag_rows.start : rows.target]
        size = (touch.pulp.rows if touch else 0) // system.fingers
        filter_rows = 1 + fingers * size + np.arange(size)[:, None, None]
        filters = before[filter_rows, np.arange(cells.size)]
        height, filters, force = system.press_together(before[0], lag, filters, under[:, copies], fingers)
        block[0, cells] = height
        block[filter_rows, cells] = filters
        block[rows.pressing.start + fingers, cells] = force
