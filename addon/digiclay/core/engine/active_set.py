"""Active set of cells: its selection, and the transfer of its rows out of the bed and back.

A cell takes part if the finger may touch it, the controller commands it, or it still moves:
its valve is not shut, a command is on its way, or a force acts on it. All others stay
exactly as they are, so leaving them out changes nothing, and a period's cost does not depend
on the size of the bed. The set is kept for some periods, with a margin around it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..model.layout import Disc, Grid
from ..model.touch import FingerPeriod, reached
from .state import Gathered, State
from .system import System

__all__ = ["taking_part"]

Cells = NDArray[np.intp]

#: Control periods after which the set is made anew, without the cells that have come to rest.
KEPT = 32


def taking_part(
    system: System, state: State, finger: FingerPeriod | None, control: tuple[float, float, float] | None
) -> State:
    """Return a state whose gathered cells are all that can change in the coming period.

    Parameters
    ----------
    system : System
    state : State
        Its arrays are used up.
    finger : FingerPeriod or None
        The finger's way through the period.
    control : (float, float, float) or None
        Disc x, y, radius that the controller will command, m.
    """
    grid, held = system.grid, state.gathered
    if (
        state.period < held.until
        and _holds(held.control, control)
        and _holds(held.reach, _reach(finger, held.peak))
    ):
        return state
    moving, top = _put_back(system, state)
    peak = min(top + KEPT * system.period * system.fastest, system.cell.actuator.stroke)
    margin = grid.layout.pitch
    wide_control, wide_reach = _wider(control, margin), _wider(_reach(finger, peak), margin)
    near = _inside(grid, wide_reach)
    cells = _together(near, moving, _inside(grid, wide_control))
    block = state.rows.take(cells, axis=1)
    block[system.rows.force, near.size :] = 0.0
    if near.size and system.cell.touch:
        waited = state.period * system.period - state.aged.take(near)
        system.cell.touch.pulp.age(block[system.cell.pulp_rows, : near.size], waited)
    held = Gathered(
        system.rows,
        cells,
        near.size,
        block,
        state.modes.take(cells),
        grid.place(cells),
        wide_reach,
        wide_control,
        peak,
        state.period + KEPT,
    )
    return State(state.period, state.rows, state.modes, state.aged, top, held, state.memory)


def _reach(finger: FingerPeriod | None, peak: float) -> Disc | None:
    """Return the disc the finger may touch while no pin is above `peak`, m; None without a finger."""
    return reached(finger.window, peak) if finger else None


def _wider(disc: Disc | None, margin: float) -> Disc | None:
    """Return a disc with a margin around it, m."""
    return disc and (disc[0], disc[1], disc[2] + margin)


def _holds(outer: Disc | None, inner: Disc | None) -> bool:
    """Return whether all of `inner` is in `outer`."""
    if inner is None:
        return True
    return outer is not None and math.dist(inner[:2], outer[:2]) + inner[2] <= outer[2]


def _inside(grid: Grid, disc: Disc | None) -> Cells:
    """Return the cells of a disc, ascending."""
    return grid.disc(*disc) if disc else np.empty(0, np.intp)


def _put_back(system: System, state: State) -> tuple[Cells, float]:
    """Put the gathered cells back; return those that still move, and the highest pin's height."""
    held, rows = state.gathered, system.rows
    system.cell.lag.settle(held.block[system.cell.lag_rows])
    state.rows[:, held.cells] = held.block
    state.modes[held.cells] = held.mode
    state.aged[held.cells[: held.near]] = state.period * system.period
    if not held.cells.size:
        return held.cells, state.peak
    busy = held.block[system.cell.lag_rows.start : rows.target].any(axis=0)
    busy |= held.block[rows.force] > 0.0
    busy |= held.mode > Mode.HOLD
    return held.cells[busy], max(state.peak, float(held.block[0].max()))


def _together(near: Cells, moving: Cells, controlled: Cells) -> Cells:
    """Return the near cells first, then the moving and controlled ones that are not among them, ascending."""
    others: Cells = np.unique(np.concatenate([moving, controlled]))
    if not near.size:
        return others
    at = np.minimum(near.searchsorted(others), near.size - 1)
    return np.concatenate([near, others[near.take(at) != others]])
