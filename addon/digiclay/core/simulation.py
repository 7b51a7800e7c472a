"""One control period after another: the line from fingertip to pins."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DivergenceError
from .fingertip import underside
from .gathering import taking_part
from .places import Measurement, Truth
from .state import Gathered, State, at_rest
from .system import System
from .touch import Approach, approach, force
from .trajectory import Trajectory

__all__ = ["advance", "approaches", "begin", "periods", "step"]

Floats = NDArray[np.float64]

#: Control periods whose finger poses are worked out at a time.
CHUNK = 128


def begin(system: System) -> State:
    """Return the state before a session."""
    memory = system.controller.begin() if system.controller else None
    return at_rest(system.rows, system.grid.count, system.cell.actuator.rest_height, memory)


def approaches(system: System, poses: Floats) -> list[Approach | None]:
    """Work out the finger's way through some periods from its poses (t, p, 7); None without a finger."""
    if system.cell.touch is None:
        return [None] * len(poses)
    return list(approach(system.cell.touch.fingertip, poses))


def step(system: System, state: State, poses: Floats) -> State:
    """Simulate one control period; the state handed in stays as it is.

    Parameters
    ----------
    system : System
    state : State
    poses : ndarray (p, 7)
        Poses of the fingertip at `System.instants`: position of its lowest point, m, and
        unit quaternion w, x, y, z.

    Raises
    ------
    DivergenceError
        When a height, force or opening is no longer finite.
    """
    return advance(system, state.copy(), approaches(system, poses[None])[0])


def advance(system: System, state: State, finger: Approach | None) -> State:
    """Simulate one control period in the arrays of `state`, which is used up.

    Parameters
    ----------
    system : System
    state : State
        Not to be used again; keep a `State.copy` to come back to it.
    finger : Approach or None
        From `approaches`.
    """
    memory, control = _attend(system, state)
    state = taking_part(system, state, finger, control)
    held = state.gathered
    if not held.cells.size:
        return State(state.period + 1, state.rows, state.modes, state.aged, state.peak, held, memory)
    under = _underside(system, finger, held)
    memory = _command(system, state, memory)
    system.stepper.advance(system.plan, held.block[system.rows.driven], under)
    _feel(system, held, under)
    system.sensors.update(
        held.block[system.rows.sensed], _truth(system, held, state.period + 1, held.cells.size)
    )
    _check_finite(system, state)
    return State(state.period + 1, state.rows, state.modes, state.aged, state.peak, held, memory)


def _attend(system: System, state: State) -> tuple[Any, tuple[float, float, float] | None]:
    """Let the controller take in the touched cells; return its memory and the disc it will control."""
    if system.controller is None:
        return state.memory, None
    return system.controller.attend(state.memory, _measured(system, state, state.gathered.near))


def _truth(system: System, held: Gathered, period: int, count: int) -> Truth:
    """Return what there is to be measured of the first `count` gathered cells."""
    rows, block = system.rows, held.block
    return Truth(
        held.cells[:count], period, block[rows.force, :count], block[0, :count], block[rows.command, :count]
    )


def _measured(system: System, state: State, count: int) -> Measurement:
    """Measure the first `count` of the gathered cells."""
    rows, held = system.rows, state.gathered
    block = held.block[:, :count]
    force, height = system.sensors.measure(block[rows.sensed], _truth(system, held, state.period, count))
    return Measurement(
        held.place[:, :count], height, force, block[rows.target], held.mode[:count], block[rows.controlled]
    )


def _underside(system: System, finger: Approach | None, held: Gathered) -> Floats:
    """Return the finger's underside over the near cells at the period's instants, shape (p, k), m."""
    if finger is None or not held.near:
        return np.empty((system.instants.size, 0))
    return underside(finger.inward, finger.middle, finger.half, held.place[:, : held.near])


def _command(system: System, state: State, memory: Any) -> Any:
    """Let the controller command the gathered cells, and queue the commands; return its memory."""
    if system.controller is None:
        return memory
    rows, held = system.rows, state.gathered
    memory, orders = system.controller.command(memory, _measured(system, state, held.cells.size))
    held.block[rows.target] = orders.target
    held.mode[:] = orders.mode
    commands = held.block[rows.commands]
    for older, newer in pairwise(commands):
        older[:] = newer
    commands[-1] = orders.command
    return memory


def _feel(system: System, held: Gathered, under: Floats) -> None:
    """Work out the forces at the end of the period."""
    touch, k, block = system.cell.touch, held.near, held.block
    if touch and k:
        block[system.rows.force, :k] = force(touch, block[0, :k], under[-1], block[system.cell.pulp_rows, :k])


def _check_finite(system: System, state: State) -> None:
    """Refuse to go on with numbers that are not finite, and say which."""
    rows, held = system.rows, state.gathered
    if math.isfinite(held.block.sum()):
        return
    bad = np.argwhere(~np.isfinite(held.block))
    if not bad.size:
        return
    row, column = bad[0].tolist()
    names = {0: "height", rows.force: "force", rows.target: "commanded height"}
    raise DivergenceError(
        state.period * system.period,
        int(held.cells[column]),
        names.get(row, "valve opening" if row in range(rows.physics)[system.cell.lag_rows] else "relaxation"),
        float(held.block[row, column]),
        "Use a shorter physics step, or the stepper 'bernoulli'.",
    )


def periods(system: System, trajectory: Trajectory, state: State, count: int) -> Iterator[State]:
    """Simulate control periods along a trajectory; the arrays of `state` are used up.

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
        for finger in approaches(system, trajectory.poses(times).reshape(chunk, -1, 7)):
            state = advance(system, state, finger)
            yield state
        done += chunk
