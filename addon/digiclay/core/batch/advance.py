"""Simulation of a batch's control periods: `core.engine.simulation` with an axis for the runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
from ..engine.state import Rows
from ..engine.system import System
from ..model.interfaces import Measurement
from . import beds
from .beds import NO_DISC, Beds, Disc, Gathered
from .broadcasting import Floats, numbers
from .fingers import Fingers, undersides
from .movement import BatchMovement
from .padding import Gathering, taken_along, taking_part
from .run_by_run import join_discs

__all__ = ["Stack", "advance", "begin", "blow_up", "broken", "follow", "kept"]


@dataclass(frozen=True, eq=False)
class Stack:
    """All that does not change in b sessions on one layout.

    Attributes
    ----------
    systems : tuple of System
        Those of the runs.
    rows : Rows
    controller : StackedController or None
        None: every valve stays shut.
    plan : object
        Of the steppers; the first run's own where the cells of all runs are alike.
    gathering : Gathering
    """

    systems: tuple[System, ...]
    rows: Rows
    controller: Any
    plan: Any
    gathering: Gathering


def begin(stack: Stack) -> Beds:
    """Return the beds before the sessions."""
    memory = [system.controller.begin() if system.controller else None for system in stack.systems]
    heights = numbers([system.cell.actuator.rest_height for system in stack.systems])
    return beds.at_rest(stack.rows, stack.systems[0].grid.count, heights, memory)


def advance(stack: Stack, state: Beds, coming: Fingers | None) -> Beds:
    """Simulate one control period of all runs in the arrays of `state`, which is used up.

    Parameters
    ----------
    stack : Stack
    state : Beds
    coming : Fingers or None
        How the fingers come in some periods, this one among them.
    """
    memory, control = _locate(stack, state)
    window = coming.window[state.period - coming.first] if coming else None
    held = taking_part(stack.gathering, state, window, control)
    if held.cells.size:
        memory = _command(stack, held, memory)
        _move(stack, held, coming, state.period)
    return Beds(state.period + 1, state.rows, state.modes, state.aged, held, memory)


def _move(stack: Stack, held: Gathered, coming: Fingers | None, period: int) -> None:
    """Move the gathered cells on by a control period, and work out the forces at its end."""
    count = held.near
    none = np.empty((stack.systems[0].instants.size, 0, held.cells.shape[1]))
    under = undersides(coming, period, held.place[:, :count]) if coming and count else none
    held.block[stack.rows.force, :count] = _movement(stack, held)(under)


def _movement(stack: Stack, held: Gathered) -> BatchMovement:
    """Return what moves the gathered cells: prepared once for each set."""
    known: BatchMovement | None = held.ready.get(stack.plan)
    if known is None:
        first, driven = stack.systems[0], held.block[stack.rows.driven]
        alike, valve = stack.plan is first.plan, first.cell.lag_rows.start
        known = BatchMovement(first.stepper, stack.plan, alike, driven, held.near, valve)
        held.ready[stack.plan] = known
    return known


def follow(stack: Stack, state: Beds, coming: Fingers | None, leader: Beds) -> Beds:
    """Simulate the control period that other beds of the same runs have just done, under their commands.

    Parameters
    ----------
    stack : Stack
        Without a controller.
    state : Beds
        Used up.
    coming : Fingers or None
    leader : Beds
        After the period. The cells that took part there do so here: the two differ by errors of the
        integration, and a set of cells has room for far more.
    """
    held, rows = state.gathered, stack.rows
    if held.cells is not leader.gathered.cells:
        held = taken_along(stack.gathering, state, leader.gathered)
    if held.cells.size:
        _queue(held.block[rows.commands], leader.gathered.block[rows.command])
        _move(stack, held, coming, state.period)
    return Beds(state.period + 1, state.rows, state.modes, state.aged, held, state.memory)


def _locate(stack: Stack, state: Beds) -> tuple[Any, Disc]:
    """Let the controllers take in the touched cells; return their memory and the discs they will control."""
    if stack.controller is None:
        return state.memory, NO_DISC
    touched = _measured(stack, state.gathered, state.gathered.near)
    memory, discs = stack.controller.locate(state.memory, touched)
    return memory, join_discs(discs)


def _measured(stack: Stack, held: Gathered, count: int) -> Measurement:
    """Measure the first `count` of the gathered cells of every run."""
    rows, block = stack.rows, held.block[:, :count]
    mode, place, own = held.mode[:count], held.place[:, :count], block[rows.controlled]
    seen = block[0], block[rows.force], block[rows.target]
    return Measurement(place, *seen, mode, own, held.cells[:count])


def _command(stack: Stack, held: Gathered, memory: Any) -> Any:
    """Let the controllers command the gathered cells, and queue the commands; return their memory."""
    if stack.controller is None:
        return memory
    rows = stack.rows
    memory, orders = stack.controller.command(memory, _measured(stack, held, len(held.cells)))
    held.block[rows.target] = orders.target
    held.mode[:] = orders.mode
    _queue(held.block[rows.commands], orders.command)
    return memory


def _queue(commands: Floats, newest: Floats) -> None:
    """Put the newest commands behind those on their way, (q, w, b), in place."""
    for older, newer in pairwise(commands):
        older[:] = newer
    commands[-1] = newest


def broken(state: Beds) -> NDArray[np.bool_]:
    """Return the runs, (b,), with numbers that are not finite."""
    block = state.gathered.block
    # One sum tells that all is well, as it nearly always is.
    if math.isfinite(np.add.reduce(block, axis=None)):
        return np.zeros(block.shape[2], np.bool_)
    finite: NDArray[np.bool_] = np.isfinite(block.sum(axis=(0, 1)))
    return ~finite


def blow_up(stack: Stack, state: Beds, run: int) -> DivergenceError:
    """Return the error a run with a number that is not finite ends in; see `core.engine.simulation`.

    Parameters
    ----------
    stack : Stack
    state : Beds
    run : int
        Which of them.
    """
    system, held, rows = stack.systems[run], state.gathered, stack.rows
    row, place = np.argwhere(~np.isfinite(held.block[..., run]))[0].tolist()
    names = {0: "height", rows.force: "force", rows.target: "commanded height"}
    lag = range(rows.physics)[system.cell.lag_rows]
    return DivergenceError(
        (state.period - 1) * system.period,
        int(held.cells[place, run]),
        names.get(row, "valve opening" if row in lag else "relaxation"),
        float(held.block[row, place, run]),
        "Use a shorter physics step, or the stepper 'bernoulli'.",
    )


def kept(state: Beds, runs: Sequence[int]) -> Beds:
    """Return the beds of some of the runs.

    Parameters
    ----------
    state : Beds
    runs : sequence of int
    """
    chosen, held = np.array(runs, np.intp), state.gathered
    # The discs are not worth keeping: the set is made anew.
    gathered = Gathered(
        held.cells[:, chosen],
        held.near,
        held.block[..., chosen],
        held.mode[:, chosen],
        held.place[..., chosen],
        NO_DISC,
        NO_DISC,
        held.peak[chosen],
        until=0,
    )
    memory = [state.memory[run] for run in runs]
    several = (state.rows, state.modes, state.aged)
    rows, modes, aged = (np.ascontiguousarray(one[..., chosen]) for one in several)
    return Beds(state.period, rows, modes, aged, gathered, memory)
