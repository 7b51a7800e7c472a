"""Simulation of control periods: from fingertip to pins."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
from ..model.fingertip import require_one
from ..model.interfaces import Measurement, Movement, Truth
from ..model.touch import FingerPeriod, trace_finger
from ..model.trajectory import Trajectory, sample_poses
from .active_set import taking_part
from .state import Gathered, Part, State, at_rest
from .system import System

__all__ = ["advance", "begin", "periods", "step", "trace_fingers"]

Floats = NDArray[np.float64]

#: Control periods whose finger poses are worked out at a time.
CHUNK = 256


def begin(system: System) -> State:
    """Return the state before a session."""
    memory = system.controller.begin() if system.controller else None
    return at_rest(system.rows, system.grid.count, system.cell.actuator.rest_height, memory)


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
    """
    memory, control = _locate(system, state)
    state = taking_part(system, state, finger, control)
    held = state.gathered
    if not held.cells.size:
        return State(state.period + 1, state.rows, state.modes, state.aged, state.peak, held, memory)
    ready = _ready(system, held)
    memory = _command(system, state, ready, memory)
    held.touched.force[:] = ready.movement(_underside(system, finger, held))
    if system.sensors:
        system.sensors.update(held.all.sensed, _truth(held.all, state.period + 1))
    _check_finite(system, state)
    return State(state.period + 1, state.rows, state.modes, state.aged, state.peak, held, memory)


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


def _ready(system: System, held: Gathered) -> _Ready:
    """Return what this system needs of a gathered set."""
    known: _Ready | None = held.ready.get(system.plan)
    if known is None:
        touched, everything = (
            Measurement(
                part.place, part.height, part.force, part.target, part.mode, part.controlled, part.cells
            )
            for part in (held.touched, held.all)
        )
        movement = system.stepper.prepare(system.plan, held.driven, held.near)
        known = held.ready[system.plan] = _Ready(touched, everything, movement)
    return known


def _locate(system: System, state: State) -> tuple[Any, tuple[float, float, float] | None]:
    """Let the controller take in the touched cells; return its memory and the disc it will control."""
    if system.controller is None:
        return state.memory, None
    held = state.gathered
    seen = _measured(system, _ready(system, held).touched, held.touched, state.period)
    return system.controller.locate(state.memory, seen)


def _truth(part: Part, period: int) -> Truth:
    """Return what there is to be measured of some gathered cells."""
    return Truth(part.cells, period, part.force, part.height, part.command)


def _measured(system: System, true: Measurement, part: Part, period: int) -> Measurement:
    """Measure some gathered cells."""
    if system.sensors is None:
        return true
    force, height = system.sensors.measure(part.sensed, _truth(part, period))
    return true._replace(force=force, height=height)


def _underside(system: System, finger: FingerPeriod | None, held: Gathered) -> Floats:
    """Return the finger's underside over the near cells at the period's instants, shape (p, k), m."""
    if finger is None or not held.near:
        return np.empty((system.instants.size, 0))
    return finger.under(held.touched.place)


def _command(system: System, state: State, ready: _Ready, memory: Any) -> Any:
    """Let the controller command the gathered cells, and queue the commands; return its memory."""
    if system.controller is None:
        return memory
    part, queue = state.gathered.all, state.gathered.queue
    seen = _measured(system, ready.all, part, state.period)
    memory, orders = system.controller.command(memory, seen)
    part.target[:] = orders.target
    part.mode[:] = orders.mode
    for older, newer in pairwise(queue):
        older[:] = newer
    queue[-1][:] = orders.command
    return memory


def _check_finite(system: System, state: State) -> None:
    """Refuse numbers that are not finite, with their position."""
    rows, held = system.rows, state.gathered
    # One product tells: what is not finite makes no finite square.
    if math.isfinite(held.flat.dot(held.flat)):
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
