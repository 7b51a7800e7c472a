"""Engine of a bed under several fingertips: active cells and their motion.

A cell and a fingertip that may touch it are a pair. Each pair is moved as if its fingertip were
alone; for the stepper all pairs are the cells of one large bed. The lowest pair of a cell is
correct unless two fingertips press the cell: then it is moved again under both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Cells, Flags, Floats, any_true, find_copies
from ..model.fingers import HandTouch, gather_positions, trace_hands
from ..model.layout import RELATIVE_TOLERANCE, Discs, join_discs
from ..model.physics import Cell
from .active_set import Selection
from .state import ActiveSet, State
from .system import System

#: Lifetime of a set, relative to that under one finger.
LONGER = 8
#: Largest rise of pins while a set serves, m, at least that of two periods: the smaller, the fewer
#: cells a fingertip may touch.
RISE = 3e-3
#: Largest motion of a fingertip while a set serves, m, at least a pitch: fast strokes cross a
#: narrow margin in a few periods.
ROOM = 2.25e-3
#: Moves cells that several fingers press: heights (g,), openings and commands (l, g), filters (r,
#: c, g), undersides at the period's instants (p, c, g), fingers (c, g); returns heights, filters,
#: forces (c, g), N.
PressTogether = Callable[[Floats, Floats, Floats, Floats, Cells], tuple[Floats, Floats, Floats]]


@dataclass(frozen=True, eq=False)
class HandSelection(Selection):
    """Selection of the active cells of a bed under f fingertips, one disc each: arrays (f,)."""

    @property
    def margin(self) -> float:
        """Margin of the discs of a set, m."""
        return max(ROOM, self.grid.layout.pitch)

    @cached_property
    def lifetime(self) -> int:
        """Control periods for which a set serves: its selection takes as long as a period of ten fingers."""
        return LONGER * super().lifetime

    @cached_property
    def rise(self) -> float:
        """Largest rise of pins while a set serves, m."""
        return max(RISE, 2.0 * float(self.period * self.fastest))

    def serves(self, active: ActiveSet, period: int, window: Any, control: Discs | None) -> bool:
        """Return whether a set includes all cells that can change; orders may add a disc."""
        former = active.control
        if control is not None and (former is None or len(former[0]) != len(control[0])):
            return False
        top = float(active.block[0].max(initial=0.0)) + float(self.period * self.fastest)
        low = top <= active.peak or active.peak >= self.cell.actuator.stroke
        return low and super().serves(active, period, window, control)

    def join(self, control: Any) -> Discs | None:
        """Return the controlled discs as arrays."""
        return join_discs([control] if isinstance(control, tuple) else control)

    def pick(
        self, active: ActiveSet, moving: Flags, reach: Discs | None, control: Discs | None
    ) -> tuple[Cells, int]:
        """Return the near cells, then the moving and the controlled ones, and the number of near ones."""
        near = self.grid.cover(reach)
        if active.under is not None:
            near |= active.under.any(axis=0)
        (first,) = near.nonzero()
        others = self.grid.cover(control)
        others[active.cells[moving]] = True
        others[first] = False
        return np.concatenate([first, *others.nonzero()]), first.size

    def release(self, state: State) -> Flags:
        """Put the active cells back, and age the pulp of fingertips out of reach since the set began."""
        active, near, touch = state.active, state.active.near, self.cell.touch
        # Without discs, after a change of the number of fingertips, no pulp has aged.
        timed = active.reach is not None and any_true(np.asarray(active.reach[2]) >= 0.0)
        timed |= active.under is not None
        if near and timed and isinstance(touch, HandTouch):
            rows = [finger.pulp.rows for finger in touch.each]
            apart = ~find_pairs(active)
            waited = (state.period - (active.until - self.lifetime)) * self.period
            touch.pulp.age(
                active.block[self.cell.pulp_rows, :near], np.repeat(apart * waited, rows, axis=0)
            )
        return super().release(state)

    def take(self, state: State, chosen: ActiveSet) -> ActiveSet:
        """Return the chosen set with its rows of a state whose set is released; see `Selection`."""
        taken = super().take(state, chosen)
        taken.block[self.rows.pressing] = 0.0
        return taken


def find_pairs(active: ActiveSet) -> Flags:
    """Return which near cells each of the fingertips and bodies may touch, (f, k)."""
    if active.reach is None:
        return np.zeros((active.rows.fingers, 0), np.bool_)
    x, y, radius = (np.asarray(part)[:, None] for part in active.reach)
    _, at_x, at_y = active.quadratic_basis[:3, : active.near]
    square = (at_x - x) ** 2 + (at_y - y) ** 2
    inside: Flags = square <= radius * np.abs(radius) * (1.0 + RELATIVE_TOLERANCE)
    if active.under is not None:
        inside |= active.under[:, active.cells[: active.near]]
    return inside


@dataclass(frozen=True, eq=False)
class HandSystem(System):
    """Constants of a session with several fingers."""

    cells: tuple[Cell, ...]
    plans: tuple[Any, ...]
    """Plan of each finger; equal fingers share one."""
    press_together: PressTogether | None
    """None without contact."""

    @property
    def pairs(self) -> type[Pairs]:
        """Kind of the pairs."""
        return Pairs

    @property
    def fingers(self) -> int:
        """Number of fingers."""
        return len(self.cells)

    def trace(self, poses: Floats, first: int) -> list[Any]:
        """Return the fingertip paths in each of t periods; see `System.trace`."""
        touch: Any = self.cell.touch
        return [None] * len(poses) if touch is None else list(trace_hands(touch, poses))

    def move(self, active: ActiveSet, finger: Any) -> None:
        """Move active cells through a control period under their queued commands, in place."""
        if self not in active.movements:
            active.movements[self] = HandMovement(self, active)
        active.movements[self](finger)


class Pairs:
    """Pairs of equal fingers, which the stepper moves as the cells of one bed."""

    def __init__(
        self,
        system: HandSystem,
        active: ActiveSet,
        inside: Flags,
        fingers: list[int],
        others: Cells,
    ) -> None:
        cell, rows, width = system.cells[fingers[0]], system.rows, active.cells.size
        finger, self.cells = inside[fingers].nonzero()
        self.fingers = np.array(fingers)[finger]
        self.positions = gather_positions(inside[fingers], active.quadratic_basis[:, : active.near])
        self.positions = self.positions._replace(fingers=np.array(fingers)[self.positions.fingers])
        self.columns = columns = np.concatenate([self.cells, others])
        filters = np.arange(cell.pulp_rows.start, cell.pulp_rows.stop)[:, None]
        common = [
            0,
            *range(system.rows.physics)[system.cell.lag_rows],
            *range(rows.count)[rows.commands],
        ]
        # Indices in the block of a pair's rows: height, filters of its finger, openings and
        # commands.
        of_pairs = (filters + self.fingers * filters.size) * width + self.cells
        self.filters, self.forces = (
            of_pairs,
            (rows.pressing.start + self.fingers) * width + self.cells,
        )
        shared = np.array(common)[:, None] * width + columns
        unused = np.zeros((filters.size, others.size), np.intp)
        self.index = np.concatenate(
            [shared[:1], np.concatenate([of_pairs, unused], axis=1), shared[1:]]
        )
        self.rows = np.empty(self.index.shape)
        self.pulp, count = slice(1, 1 + filters.size), self.cells.size
        self.lag = slice(self.pulp.stop, self.pulp.stop + cell.lag.rows)
        self.move = system.stepper.prepare(system.plans[fingers[0]], self.rows, count)

    def find_under(self, finger: Any) -> Floats:
        """Return the undersides over the pairs in a period, (p, k), m."""
        under: Floats = finger.under(self.positions)
        return under

    def advance(self, block: Floats, finger: Any, instants: int) -> Moved:
        """Move the pairs of a block; sets their filters and forces in place, but not the heights."""
        flat, count = block.reshape(-1), self.cells.size
        np.take(flat, self.index, out=self.rows, mode="clip")  # another mode copies
        before, forces = self.rows.copy(), flat.take(self.forces)
        under = np.empty((instants, 0))
        if self.cells.size and finger is not None:
            under = self.find_under(finger)
        after = self.move(under)
        flat[self.forces] = after
        flat[self.filters] = self.rows[self.pulp, :count]
        return Moved(
            before[:, :count], self.rows[0, :count], np.maximum(forces, after) > TIE, under
        )


class Moved(NamedTuple):
    """Pairs in a control period, (k,): rows before, heights after, whether each presses, and undersides."""

    before: Floats
    height: Floats
    presses: Flags
    under: Floats


def join_moved(moved: list[Moved]) -> Moved:
    """Return the pairs of all groups, one after the other."""
    return Moved(*(np.concatenate(part, axis=-1) for part in zip(*moved, strict=True)))


class HandMovement:
    """Moves a set of active cells under several fingertips, period by period."""

    def __init__(self, system: HandSystem, active: ActiveSet) -> None:
        self._system, self._active = system, active
        alike: dict[int, list[int]] = {}
        for finger, plan in enumerate(system.plans):
            alike.setdefault(id(plan), []).append(finger)
        others = np.arange(active.near, active.cells.size)
        groups, inside = list(alike.values()), find_pairs(active)
        self._groups = [
            system.pairs(
                system, active, inside, fingers, others if fingers is groups[0] else others[:0]
            )
            for fingers in groups
        ]
        self._fingers = np.concatenate([group.fingers for group in self._groups])
        copies = find_copies(inside[[finger for fingers in groups for finger in fingers]])
        self._double, self._copies = copies.cells, copies.number[copies.entries]
        # The first pair of a cell also makes up the number of those of others.
        self._distinct = self._copies != self._copies[0]
        self._distinct[0] = True

    def __call__(self, finger: Any) -> None:
        """Move the cells on by one control period, in place."""
        system, active = self._system, self._active
        rows, block, near = system.rows, active.block, active.near
        moved = [group.advance(block, finger, system.instants.size) for group in self._groups]
        for group in self._groups:
            block[0, group.columns] = group.rows[0]
            block[system.cell.lag_rows, group.columns] = group.rows[group.lag]
        if self._double.size:
            pairs = moved[0] if len(moved) == 1 else join_moved(moved)
            block[0, self._double] = np.minimum.reduce(pairs.height[self._copies])
            presses = pairs.presses[self._copies] & self._distinct
            if any_true(presses):
                pressed = np.add.reduce(presses, axis=0, dtype=np.intp) > 1
                if any_true(pressed):
                    self._press_together(pairs, pressed)
        np.add.reduce(block[rows.pressing, :near], axis=0, out=block[rows.force, :near])

    def _press_together(self, moved: Moved, pressed: Flags) -> None:
        """Move cells again, (g,) of those with several pairs, that several fingers press."""
        system, block, (first, *_) = self._system, self._active.block, self._groups
        assert system.press_together is not None
        cells, copies = self._double[pressed], self._copies[:, pressed]
        fingers, size = self._fingers[copies], len(first.filters)
        height, valves = moved.before[0, copies[0]], moved.before[first.pulp.stop :, copies[0]]
        filters, under = moved.before[first.pulp][:, copies], moved.under[:, copies]
        height, filters, force = system.press_together(height, valves, filters, under, fingers)
        block[0, cells] = height
        block[1 + fingers * size + np.arange(size)[:, None, None], cells] = filters
        block[system.rows.pressing.start + fingers, cells] = force
