"""Active set of cells: its selection, and the transfer of its rows out of the bed and back.

A cell is active if the fingertip may touch it, the controller commands it, or it still moves:
its valve is not shut, a command is on its way, or a force acts on it. Other cells cannot
change, so skipping them is exact, and a period's cost does not depend on the size of the bed.
The set is kept for some periods, with a margin around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Cells
from ..base.modes import Mode
from ..model.layout import RELATIVE_TOLERANCE, Disc, Grid
from ..model.physics import Cell
from ..model.touch import FingerPeriod, Window, find_reached_disc
from .state import ActiveSet, Rows, State

#: Control periods after which the set is made anew, without the cells that have come to rest.
KEPT = 32


@dataclass(frozen=True, eq=False)
class Selection:
    """Selection of the active cells of a session; `batch.padding` has that of many.

    Attributes
    ----------
    period : float or ndarray (b,)
        Control period, s.
    fastest : float or ndarray (b,)
        No pin rises faster, m/s.
    """

    grid: Grid
    rows: Rows
    cell: Cell
    period: Any
    fastest: Any

    def update(self, state: State, finger: FingerPeriod | None, control: Any) -> State:
        """Return a state whose active cells are all that can change in the coming period.

        `state`: its arrays are used up; `finger`: the finger's way through the period; `control` (float,
        float, float), disc x, y, radius that the controller will command, m.
        """
        held, window = state.active, finger.window if finger else None
        if self.holds(held, state.period, window, control):
            return state
        moving, top = held.cells[self.release(state)], state.peak
        if held.cells.size:
            top = max(top, float(held.block[0].max()))
        chosen = self.choose(held, state.period, window, control, moving, top)
        chosen = replace(chosen, quadratic_basis=self.grid.compute_basis(chosen.cells))
        return state._replace(peak=top, active=self.take(state, chosen))

    def holds(self, held: ActiveSet, period: int, window: Window | None, control: Disc | None) -> bool:
        """Return whether a set still has all cells that can change.

        `period`: number of control periods done; `window`: where the finger may touch in the coming period;
        `control` (float, float, float), see `update`.
        """
        return (
            period < held.until
            and _holds(held.control, control)
            and _holds(held.reach, _reach(window, held.peak))
        )

    def choose(
        self,
        held: ActiveSet,
        period: int,
        window: Window | None,
        control: Disc | None,
        moving: Cells,
        top: float,
    ) -> ActiveSet:
        """Return the set that comes after another one: its cells, and for how long it serves.

        `held`: the set before; its block, modes and basis stay; `period`, `window`, `control`: see `holds`;
        `moving` int (m,), cells that still move; `top`: no pin top is higher than this, m.
        """
        grid = self.grid
        peak = min(top + KEPT * self.period * self.fastest, self.cell.actuator.stroke)
        margin = grid.layout.pitch
        wide_control, wide_reach = _wider(control, margin), _wider(_reach(window, peak), margin)
        near = _inside(grid, wide_reach)
        return replace(
            held,
            cells=_together(near, moving, _inside(grid, wide_control)),
            near=near.size,
            reach=wide_reach,
            control=wide_control,
            peak=peak,
            until=period + KEPT,
        )

    def release(self, state: State) -> NDArray[np.bool_]:
        """Put the active cells back into the bed, in place; return which of them still move."""
        held, rows, cell = state.active, self.rows, self.cell
        cell.lag.settle(held.block[cell.lag_rows])
        state.rows.reshape(rows.count, -1)[:, held.flat] = held.block
        state.modes.reshape(-1)[held.flat] = held.mode
        state.aged.reshape(-1)[held.flat[: held.near]] = state.period * self.period
        busy: NDArray[np.bool_] = held.block[cell.lag_rows.start : rows.target].any(axis=0)
        busy |= held.block[rows.force] > 0.0
        busy |= held.mode > Mode.HOLD
        return busy

    def take(self, state: State, chosen: ActiveSet) -> ActiveSet:
        """Take cells out of the bed, the pulp over them aged.

        `state`: whose active cells have been released; `chosen`: the cells; its block and modes are not
        looked at.
        """
        near, flat, touch = chosen.near, chosen.flat, self.cell.touch
        block = state.rows.reshape(self.rows.count, -1).take(flat, axis=1)
        block[self.rows.force, near:] = 0.0
        if near and touch:
            waited = state.period * self.period - state.aged.take(flat[:near])
            touch.pulp.age(block[self.cell.pulp_rows, :near], waited)
        return replace(chosen, block=block, mode=state.modes.take(flat))


def _reach(window: Window | None, peak: float) -> Disc | None:
    """Return the disc the finger may touch while no pin is above `peak`, m; None without a finger."""
    return find_reached_disc(window, peak) if window else None


def _wider(disc: Disc | None, margin: float) -> Disc | None:
    """Return a disc with a margin around it, m."""
    return disc and (disc[0], disc[1], disc[2] + margin)


def _holds(outer: Disc | None, inner: Disc | None) -> bool:
    """Return whether all of `inner` is in `outer`."""
    if inner is None:
        return True
    if outer is None:
        return False
    # One that touches the limit from inside is in: a last bit, other in a batch than alone, decides nothing.
    return math.dist(inner[:2], outer[:2]) + inner[2] <= outer[2] * (1.0 + RELATIVE_TOLERANCE)


def _inside(grid: Grid, disc: Disc | None) -> Cells:
    """Return the cells of a disc, ascending."""
    return grid.disc(*disc) if disc else np.empty(0, np.intp)


def _together(near: Cells, moving: Cells, controlled: Cells) -> Cells:
    """Return the near cells first, then the moving and controlled ones that are not among them, ascending."""
    others: Cells = np.unique(np.concatenate([moving, controlled]))
    if not near.size:
        return others
    at = np.minimum(near.searchsorted(others), near.size - 1)
    return np.concatenate([near, others[near.take(at) != others]])
