"""Active set of cells, of a run or a batch: selection, and transfer of rows out of the bed and back.

A cell is active if the fingertip may touch it, the controller commands it, or it still moves:
its valve is not shut, a command is queued, or a force acts on it. Other cells cannot change, so
that skipping them is exact, and the cost of a period does not depend on the size of the bed. A
set serves for several periods, with a margin around it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from ..base.modes import HOLD, LOCKED
from ..model.fingertip import Window, compute_reach
from ..model.layout import Disc, Discs, Grid, encloses, widen_disc
from ..model.physics import Cell
from ..model.touch import FingerPeriod
from .state import ActiveSet, Rows, State

#: A set is renewed, without the cells at rest by then, after this number of control periods, or
#: this time, s, if that is longer.
LASTING_PERIODS, LASTING_TIME = 32, 0.16


@dataclass(frozen=True, eq=False)
class Selection:
    """Selection of the active cells of a session."""

    grid: Grid
    rows: Rows
    cell: Cell
    period: Any
    """Control period, s; a number or (b,)."""
    fastest: Any
    """Largest speed of a rising pin, m/s; a number or (b,)."""

    #: The margin of a set, in pitches.
    margin_pitches: ClassVar[float] = 1.0
    #: The larger and the smaller of two numbers, of a run or (b,) of a batch.
    larger: ClassVar[Callable[..., Any]] = staticmethod(
        lambda value, other: max(value, float(other))
    )
    smaller: ClassVar[Callable[..., Any]] = staticmethod(min)

    @cached_property
    def lifetime(self) -> int:
        """Control periods for which a set serves."""
        return max(LASTING_PERIODS, int(LASTING_TIME / np.max(self.period)))

    @property
    def margin(self) -> float:
        """Extension of the set's discs, so that it serves for several periods, m."""
        return self.margin_pitches * self.grid.layout.pitch

    @property
    def rise(self) -> Any:
        """Largest rise of pins while a set serves, m; a number or (b,)."""
        return self.lifetime * self.period * self.fastest

    def update(self, state: State, finger: FingerPeriod | None, control: Any) -> State:
        """Return a state, in the same arrays, whose active cells include all that can change in a period."""
        active, window, disc = state.active, finger and finger.window, self.join(control)
        if self.serves(active, state.period, window, disc):
            return state
        return self.renew(state, active, window, disc)

    def renew(
        self, state: State, active: ActiveSet, window: Window | None, disc: Discs | None
    ) -> State:
        """Return a state, in the same arrays, with another set; `active`: the present one."""
        moving = self.release(state)
        peak = self.larger(state.peak, active.block[0].max(axis=0, initial=-np.inf))
        chosen = self.choose(active, state.period, window, disc, moving, peak)
        return state._replace(peak=peak, active=self.take(state, chosen))

    def join(self, control: Disc | None) -> Discs | None:
        """Return the controlled disc."""
        return control

    def serves(
        self, active: ActiveSet, period: int, window: Window | None, control: Discs | None
    ) -> bool:
        """Return whether a set includes all cells that can change in a period."""
        return (
            period < active.until
            and encloses(active.control, control)
            and encloses(active.reach, _reach(window, active.peak))
        )

    def choose(
        self,
        active: ActiveSet,
        period: int,
        window: Window | None,
        control: Discs | None,
        moving: Flags,
        top: Any,
    ) -> ActiveSet:
        """Return the next set, without its rows; `top`: the highest pin top, m."""
        peak = self.smaller(top + self.rise, self.cell.actuator.stroke)
        reach = widen_disc(_reach(window, peak), self.margin)
        control = widen_disc(control, self.margin)
        cells, near = self.pick(active, moving, reach, control)
        return replace(
            active,
            cells=cells,
            near=near,
            reach=reach,
            control=control,
            peak=peak,
            until=period + self.lifetime,
        )

    def pick(
        self, active: ActiveSet, moving: Flags, reach: Discs | None, control: Discs | None
    ) -> tuple[Cells, int]:
        """Return the near cells, then the moving and the controlled ones, and the number of near ones."""
        none = np.empty(0, np.intp)
        near = self.grid.disc(*reach) if reach else none
        controlled = self.grid.disc(*control) if control else none
        others = np.unique(np.concatenate([active.cells[moving], controlled]))
        if near.size:
            at = np.minimum(near.searchsorted(others), near.size - 1)
            others = others[near.take(at) != others]
        return np.concatenate([near, others]), near.size

    def release(self, state: State) -> Flags:
        """Put the active cells back into the bed, in place; return which of them still move."""
        active, rows, cell = state.active, self.rows, self.cell
        cell.lag.settle(active.block[cell.lag_rows])
        state.rows.reshape(rows.count, -1)[:, active.flat] = active.block
        state.modes.reshape(-1)[active.flat] = active.mode
        state.aged.reshape(-1)[active.flat[: active.near]] = state.period * self.period
        moving = self.find_driven(active.block)
        moving |= active.block[rows.force] > 0.0
        # Locked pins do not move.
        moving |= (active.mode > HOLD) & (active.mode != LOCKED)
        if state.addressing is not None:
            moving |= np.isin(active.cells, state.addressing.waiting)
        return moving

    def find_driven(self, block: Floats) -> Flags:
        """Return the cells whose valves are open, or will be by a queued command; of rows (r, m[, b])."""
        driven: Flags = block[self.cell.lag_rows.start : self.rows.target].any(axis=0)
        return driven

    def take(self, state: State, chosen: ActiveSet) -> ActiveSet:
        """Return the chosen set with its rows of a state whose set is released; ages the pulp over them."""
        near, flat, touch = chosen.near, chosen.flat, self.cell.touch
        block = state.rows.reshape(self.rows.count, -1).take(flat, axis=1)
        block[self.rows.force, near:] = 0.0
        if near and touch:
            waited = state.period * self.period - state.aged.take(flat[:near])
            touch.pulp.age(block[self.cell.pulp_rows, :near], waited)
        basis = self.grid.compute_basis(chosen.cells)
        return replace(chosen, block=block, mode=state.modes.take(flat), quadratic_basis=basis)


def _reach(window: Window | None, peak: Any) -> Discs | None:
    """Return the discs that the fingertips may touch while no pin is above `peak`, m."""
    return None if window is None else compute_reach(window, peak)
