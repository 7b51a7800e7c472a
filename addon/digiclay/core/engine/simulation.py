"""Simulation of control periods: from fingertip to pins."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
from ..model.control_interface import Measurement
from ..model.fingertip import require_one
from ..model.interfaces import Movement, Truth
from ..model.touch import FingerPeriod, trace_finger
from ..model.trajectory import Trajectory, sample_poses
from .state import ActiveSet, CellGroup, State, make_initial_state
from .system import System

__all__ = ["advance", "begin", "periods", "repeat_period", "step", "trace_fingers"]

Floats = NDArray[np.float64]

#: Control periods whose finger poses are worked out at a time.
CHUNK = 256


def begin(system: System) -> State:
    """Return the state before a session."""
    memory = system.controller.begin() if system.controller else None
    return make_initial_state(system.rows, system.grid.count, system.cell.actuator.rest_height, memory)


def trace_fingers(system: System, poses: Floats) -> list[FingerPeriod | None]:
    """Work out the fingers' ways through some control periods; None where nothing touches.

    Parameters
    ----------
    system : System
    poses : ndarray (t, p, f, 7)
        Of the fingers at `System.instants` of t periods: lowest point, m, and unit quaternion.
    """
    if system.cell.touch is None:
        return [None] * len(poses)
    return list(trace_finger(system.cell.touch.fingertip, require_one(tuple(poses.transpose(2, 0, 1, 3)))))


def step(system: System, state: State, poses: Floats) -> State:
    """Simulate one control period; the state handed in stays as it is.

    Parameters
    ----------
    system : System
    state : State
    poses : ndarray (p, f, 7)
        Of the fingers at `System.instants`: position of the lowest point, m, and unit quaternion
        w, x, y, z.

    Raises
    ------
    DivergenceError
        When a height, force or opening is no longer finite.
    """
    return advance(system, state.copy(), trace_fingers(system, poses[None])[0])


def advance(system: System, state: State, finger: FingerPeriod | None) -> State:
    """Simulate one control period in the arrays of `state`, which is used up.

    Parameters
    ----------
    system : System
    state : State
        Not to be used again; keep a `State.copy` to come back to it.
    finger : FingerPeriod or None
        From `trace_fingers`.

    Raises
    ------
    DivergenceError
        When a height, force or opening is no longer finite.
    """
    after = simulate_period(system, state, finger)
    numbers = after.active.numbers
    # One product tells: what is not finite makes no finite square.
    if not math.isfinite(numbers.dot(numbers)):
        error = find_divergence(system, after.active.cells, after.active.block, state.period)
        if error:
            raise error
    return after


def simulate_period(system: System, state: State, finger: Any) -> State:
    """Simulate one control period of a session, or of many, in the arrays of `state`.

    Parameters
    ----------
    system : System
    state : State
        Used up.
    finger : FingerPeriod or fingers.FingersPeriod or None
        The finger's way through the period; the fingers' of many sessions.
    """
    memory, control = _locate(system, state)
    state = system.selection.update(state, finger, control)
    if state.active.cells.size:
        memory = _command(system, state, memory)
        move(system, state, finger)
        if system.sensors:
            part = state.active.all
            system.sensors.update(part.sensed, _truth(part, state.period + 1))
    return State(state.period + 1, state.rows, state.modes, state.aged, state.peak, state.active, memory)


def move(system: System, state: State, finger: Any) -> None:
    """Move the active cells through a control period under the commands queued, in place.

    Parameters
    ----------
    system : System
    state : State
    finger : object
        See `simulate_period`.
    """
    held = state.active
    under = _underside(system, finger, held)
    held.touched.force[:] = _ready(system, held).movement(under)


def repeat_period(system: System, state: State, finger: Any, leader: State) -> State:
    """Simulate the control period that a session, or many, has just done, under its commands.

    Parameters
    ----------
    system : System
        Of the same bed and rows; its controller is left aside.
    state : State
        Before the period; used up.
    finger : object
        See `simulate_period`.
    leader : State
        After the period. The cells that were active there are so here: the two differ by errors of the
        integration, and a set of cells has room for far more.
    """
    if state.active.cells is not leader.active.cells:
        system.selection.release(state)
        state = state._replace(active=system.selection.take(state, leader.active))
    if state.active.cells.size:
        queue_commands(state.active, leader.active.all.command)
        move(system, state, finger)
    return state._replace(period=state.period + 1)


class _Ready(NamedTuple):
    """Constants of an active set, for many periods.

    Attributes
    ----------
    touched, all : Measurement
        What is true of them, in the arrays of the set.
    movement : Movement
    """

    touched: Measurement
    all: Measurement
    movement: Movement


def _ready(system: System, held: ActiveSet) -> _Ready:
    """Return what this system needs of an active set."""
    known: _Ready | None = held.ready.get(system.plan)
    if known is None:
        movement = system.stepper.prepare(system.plan, held.driven, held.near)
        known = held.ready[system.plan] = _Ready(_read(held.touched), _read(held.all), movement)
    return known


def _read(one: CellGroup) -> Measurement:
    """Return what is true of some active cells, in the arrays of the set."""
    rows = one.height, one.force, one.target, one.mode, one.controlled
    return Measurement(one.quadratic_basis, *rows, one.cells, one.present)


def _locate(system: System, state: State) -> tuple[Any, Any]:
    """Let the controller take in the touched cells; return its memory and the disc it will control."""
    if system.controller is None:
        return state.memory, None
    held = state.active
    seen = _measured(system, _ready(system, held).touched, held.touched, state.period)
    return system.controller.locate(state.memory, seen)


def _truth(part: CellGroup, period: int) -> Truth:
    """Return what there is to be measured of some active cells."""
    return Truth(part.cells, period, part.force, part.height, part.command)


def _measured(system: System, true: Measurement, part: CellGroup, period: int) -> Measurement:
    """Measure some active cells."""
    if system.sensors is None:
        return true
    force, height = system.sensors.measure(part.sensed, _truth(part, period))
    return true._replace(force=force, height=height)


def _underside(system: System, finger: Any, held: ActiveSet) -> Floats:
    """Return the finger's underside over the near cells at the period's instants, shape (p, k[, b]), m."""
    if finger is None or not held.near:
        return np.empty((system.instants.size, 0, *held.cells.shape[1:]))
    under: Floats = finger.under(held.touched.quadratic_basis)
    return under


def _command(system: System, state: State, memory: Any) -> Any:
    """Let the controller command the active cells, and queue the commands; return its memory."""
    if system.controller is None:
        return memory
    held = state.active
    part = held.all
    seen = _measured(system, _ready(system, held).all, part, state.period)
    memory, orders = system.controller.command(memory, seen)
    part.target[:] = orders.target
    part.mode[:] = orders.mode
    queue_commands(held, orders.command)
    return memory


def queue_commands(held: ActiveSet, newest: Floats) -> None:
    """Put the newest commands of active cells behind those on their way, in place.

    Parameters
    ----------
    held : ActiveSet
    newest : ndarray (m,) or (m, b)
        Valve commands, 1.
    """
    for older, newer in pairwise(held.queue):
        older[:] = newer
    held.queue[-1][:] = newest


def find_divergence(
    system: System, cells: NDArray[np.intp], block: Floats, period: int
) -> DivergenceError | None:
    """Return the error of a session with a number that is not finite; None where all are.

    Parameters
    ----------
    system : System
        Of this session.
    cells : ndarray of int (m,)
    block : ndarray (r, m)
        Their rows.
    period : int
        The control period that has been simulated.
    """
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


def periods(system: System, trajectories: Sequence[Trajectory], state: State, count: int) -> Iterator[State]:
    """Simulate control periods along the fingers' trajectories; the arrays of `state` are used up.

    Parameters
    ----------
    system : System
    trajectories : sequence of Trajectory
        One a finger.
    state : State
    count : int
        Control periods.

    Yields
    ------
    State
        After each period; valid until the next one is asked for.
    """
    done = 0
    while done < count:
        chunk = min(CHUNK, count - done)
        starts = (state.period + np.arange(chunk)) * system.period
        times = (starts[:, None] + system.instants).ravel()
        poses = sample_poses(trajectories, times).reshape(chunk, -1, len(trajectories), 7)
        for finger in trace_fingers(system, poses):
            state = advance(system, state, finger)
            yield state
        done += chunk
