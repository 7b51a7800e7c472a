"""Which cells take part in a period, and taking them out of the bed and putting them back.

A cell takes part if the finger may touch it, the controller commands it, or it still moves:
its valve is not shut, a command is on its way, or a force acts on it. All others stay
exactly as they are, so leaving them out changes nothing, and a period's cost does not depend
on the size of the bed. The set is kept for some periods, with a margin around it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .layout import NOWHERE, inside
from .modes import Mode
from .state import Gathered, State
from .system import System
from .touch import Approach, bounds

__all__ = ["taking_part"]

Cells = NDArray[np.intp]

#: Control periods after which the set is made anew, without the cells that have come to rest.
KEPT = 16


def taking_part(
    system: System, state: State, finger: Approach | None, control: tuple[float, float, float] | None
) -> State:
    """Return a state whose gathered cells are all that can change in the coming period.

    Parameters
    ----------
    system : System
    state : State
        Its arrays are used up.
    finger : Approach or None
        The finger's way through the period.
    control : (float, float, float) or None
        Disc x, y, radius that the controller will command, m.
    """
    grid, held = system.grid, state.gathered
    disc = grid.bounds(*control) if control else NOWHERE
    reach = bounds(grid, finger.window, held.peak, 0.0) if finger else NOWHERE
    if state.period < held.until and inside(disc, held.control) and inside(reach, held.reach):
        return state
    moving, top = _put_back(system, state)
    peak = min(top + KEPT * system.period * system.fastest, system.cell.actuator.stroke)
    margin = grid.layout.pitch
    if control:
        x, y, radius = control
        disc = grid.bounds(x, y, radius + margin)
    if finger:
        reach = bounds(grid, finger.window, peak, margin)
    near = grid.within(reach)
    cells = _together(near, moving, grid.within(disc))
    block = state.rows.take(cells, axis=1)
    block[system.rows.force, near.size :] = 0.0
    if near.size and system.cell.touch:
        waited = state.period * system.period - state.aged.take(near)
        system.cell.touch.pulp.age(block[system.cell.pulp_rows, : near.size], waited)
    held = Gathered(
        cells,
        near.size,
        block,
        state.modes.take(cells),
        grid.place(cells),
        reach,
        disc,
        peak,
        state.period + KEPT,
    )
    return State(state.period, state.rows, state.modes, state.aged, top, held, state.memory)


def _put_back(system: System, state: State) -> tuple[Cells, float]:
    """Put the gathered cells back; return those that still move, and the highest pin's height."""
    held, rows = state.gathered, system.rows
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
    """Return the near cells first, then the others that are not among them, ascending."""
    others = np.union1d(moving, controlled)
    return np.concatenate([near, others[~np.isin(others, near, assume_unique=True)]])
