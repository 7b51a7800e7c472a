"""Simulation of a batch's control periods: `core.engine.simulation` for many runs at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
from ..engine.simulation import find_divergence, simulate_period
from ..engine.state import State, make_initial_state
from ..engine.system import System
from .broadcasting import list_numbers
from .finger_paths import Fingers


@dataclass(frozen=True, eq=False)
class Batch(System):
    """All that does not change in b sessions on one layout.

    Attributes
    ----------
    systems : tuple of System
        Those of the runs.
    """

    systems: tuple[System, ...]


def begin(batch: Batch) -> State:
    """Return the state before the sessions."""
    memory = [system.controller.begin() for system in batch.systems]
    heights = list_numbers([system.cell.actuator.rest_height for system in batch.systems])
    return make_initial_state(batch.rows, batch.grid.count, heights, memory)


def advance(batch: Batch, state: State, coming: Fingers | None) -> State:
    """Simulate one control period of all runs in the arrays of `state`, which is used up.

    `coming`: how the fingers come in some periods, this one among them.
    """
    return simulate_period(batch, state, coming and coming.at(state.period))


def find_diverged(state: State) -> NDArray[np.bool_]:
    """Return which runs, (b,), hold numbers that are not finite."""
    block = state.active.block
    # One sum tells that all is well, as it nearly always is.
    if math.isfinite(np.add.reduce(block, axis=None)):
        return np.zeros(block.shape[2], np.bool_)
    finite: NDArray[np.bool_] = np.isfinite(block.sum(axis=(0, 1)))
    return ~finite


def make_divergence_error(batch: Batch, state: State, run: int) -> DivergenceError:
    """Return the error that a run with a number that is not finite ends in.

    `state`: after the control period; `run`: its index on the last axis.
    """
    held = state.active
    error = find_divergence(batch.systems[run], held.cells[:, run], held.block[..., run], state.period - 1)
    assert error is not None
    return error


def select_runs(state: State, runs: Sequence[int]) -> State:
    """Return the state of some of the runs. `runs`: their indices on the last axis."""
    chosen, held = np.array(runs, np.intp), state.active
    # The discs are not worth keeping: the set is made anew.
    active = replace(
        held,
        cells=held.cells[:, chosen],
        block=held.block[..., chosen],
        mode=held.mode[:, chosen],
        quadratic_basis=held.quadratic_basis[..., chosen],
        peak=held.peak[chosen],
        until=0,
        own=tuple(held.own[run] for run in runs) if held.own else (),
    )
    several = (state.rows, state.modes, state.aged)
    rows, modes, aged = (np.ascontiguousarray(one[..., chosen]) for one in several)
    memory = [state.memory[run] for run in runs]
    return State(state.period, rows, modes, aged, state.peak[chosen], active, memory)
