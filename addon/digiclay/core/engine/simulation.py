"""Simulation of control periods: from fingertip to pins."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import DivergenceError
from ..model.touch import FingerPeriod
from ..model.trajectory import Trajectory, sample_poses
from .hand_steps import lower_reach, move_hands, rest_hands
from .state import State, make_initial_state
from .system import System

if TYPE_CHECKING:
    from ..model.yielding_hand import Deflection

#: Called after each control period, or piece of work, with the number done and the number of all.
Progress = Callable[[int, int], None] | None
#: Called then too; True ends the work.
Stopped = Callable[[], bool] | None

#: Control periods whose finger poses are computed at a time.
CHUNK = 256
#: Most numbers of a dot product for which numpy's library uses one thread: several cost more time
#: than they save.
THREADED = 10_000


def begin(system: System) -> State:
    """Return the state before a session."""
    rest = system.cell.actuator.rest_height
    state = make_initial_state(system.rows, system.grid.count, rest, system.controller.begin())
    return state._replace(addressing=system.drive.begin(), deflection=rest_hands(system.hands))


def step(system: System, state: State, poses: Floats) -> State:
    """Simulate one control period with poses (p, f, 7) at `System.instants`; `state` does not change.

    Raises DivergenceError when a height, force or opening is no longer finite.
    """
    return advance(system, state.copy(), system.trace(poses[None], state.period)[0])


def advance(system: System, state: State, finger: FingerPeriod | None) -> State:
    """Simulate one control period in the arrays of `state`; a `State.copy` preserves it.

    Raises DivergenceError when a height, force or opening is no longer finite.
    """
    after = simulate_period(system, state, finger)
    if not _are_finite(after.active.numbers):
        error = find_divergence(system, after.active.cells, after.active.block, state.period)
        if error:
            raise error
    return after


def _are_finite(numbers: Floats) -> bool:
    """Return whether numbers (k,) are certainly finite: NaN and infinity remain in a dot product."""
    if numbers.size <= THREADED:
        return math.isfinite(numbers.dot(numbers))
    parts = (numbers[start : start + THREADED] for start in range(0, numbers.size, THREADED))
    return all(map(_are_finite, parts))


def simulate_period(
    system: System,
    state: State,
    finger: FingerPeriod | None,
) -> State:
    """Simulate a control period of a run or batch in the arrays of `state`."""
    sensors, controller = system.sensors, system.controller
    touched = sensors.read(state.active.touched, state.period)
    memory, disc = controller.locate(state.memory, touched)
    finger = lower_reach(system.hands, state, finger)
    state = system.selection.update(state, finger, disc)
    active, addressing = state.active, state.addressing
    if active.cells.size:
        measured = sensors.read(active.all, state.period)
        memory, orders = controller.command(memory, measured)
        addressing, orders = system.drive.serve(addressing, state.period, measured, orders)
        active.follow(orders)
    deflection = move(system, state, finger)
    if active.cells.size:
        sensors.note(active.all, state.period + 1)
    return state.end_period(memory, deflection, addressing)


def move(system: System, state: State, finger: FingerPeriod | None) -> Deflection | None:
    """Move the active cells through a control period, in place; return the deflection of the hands."""
    if system.hands:
        return move_hands(system.hands, state, finger)
    if state.active.cells.size:
        system.move(state.active, finger)
    return None


def repeat_period(
    system: System, state: State, finger: FingerPeriod | None, leader: State
) -> State:
    """Simulate the last control period of a run, or a batch, again, under its commands.

    `state`, before the period, is overwritten; `leader` is the run's state after it, of the same
    bed and rows. Its active cells are used here too: the two differ only by errors of the
    integration, far less than the margin of a set.
    """
    if state.active.cells is not leader.active.cells:
        system.selection.release(state)
        state = state._replace(active=system.selection.take(state, leader.active))
    if state.active.cells.size:
        state.active.queue_command(leader.active.all.command)
    return state.end_period(state.memory, move(system, state, finger), state.addressing)


def find_divergence(
    system: System, cells: NDArray[np.intp], block: Floats, period: int
) -> DivergenceError | None:
    """Return the error of the first number in rows (r, m) that is not finite, or None."""
    bad, rows = np.argwhere(~np.isfinite(block)), system.rows
    if not bad.size:
        return None
    row, column = bad[0].tolist()
    names = {0: "height", rows.force: "force", rows.target: "commanded height"}
    lag = range(rows.physics)[system.cell.lag_rows]
    return DivergenceError(
        period * system.period,
        int(cells[column]),
        names.get(row, "valve opening" if row in lag else "relaxation"),
        float(block[row, column]),
        "Use a shorter physics step, or the stepper 'bernoulli'.",
    )


def periods(
    system: System, trajectories: Sequence[Trajectory], state: State, count: int
) -> Iterator[State]:
    """Yield the state after each control period along the fingers' trajectories, valid until the next one."""
    done = 0
    while done < count:
        chunk = min(CHUNK, count - done)
        starts = (state.period + np.arange(chunk)) * system.period
        times = (starts[:, None] + system.instants).ravel()
        poses = sample_poses(trajectories, times).reshape(chunk, -1, len(trajectories), 7)
        for finger in system.trace(poses, state.period):
            state = advance(system, state, finger)
            yield state
        done += chunk
