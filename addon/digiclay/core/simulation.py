"""One control period after another: the line from fingertip to pins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .delay import Queue
from .errors import DivergenceError
from .layout import Grid
from .modes import Mode
from .physics import Cell
from .places import Controller, Measurement, Segment, Sensors, Stepper
from .state import Rows, State, at_rest
from .touch import force, window
from .trajectory import Trajectory

__all__ = ["System", "advance", "begin", "outlines", "periods", "segments", "step"]

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]

#: Control periods whose finger poses are worked out at a time.
CHUNK = 128
#: Numbers a finger outline has.
OUTLINE = 10


@dataclass(frozen=True, eq=False)
class System:
    """All that does not change in a session.

    Attributes
    ----------
    grid : Grid
    cell : Cell
    sensors : Sensors
    controller : Controller or None
        None: every valve stays shut.
    stepper : Stepper
    period : float
        Control period, s.
    plan : object
        What the stepper works out once for all periods.
    longest_rise : float
        No pin rises farther in a control period, m.
    instants : ndarray (p,)
        Times into the period at which the finger's pose is needed, first 0, last `period`, s.
    rows : Rows
    """

    grid: Grid
    cell: Cell
    sensors: Sensors
    controller: Controller | None
    stepper: Stepper
    period: float
    plan: Any
    longest_rise: float
    instants: Floats
    rows: Rows


def segments(stepper: Stepper, queue: Queue, period: float, step: float) -> tuple[tuple[Segment, ...], Floats]:
    """Cut a control period into physics steps, also where the valve goes over to the next command.

    Returns
    -------
    segments : tuple of Segment
    instants : ndarray (p,)
        When the stepper needs the finger's pose, s.
    """
    count = max(1, round(period / step))
    times = {round(i * period / count, 15) for i in range(count + 1)}
    if queue.cut:
        times = {t for t in times if abs(t - queue.cut) > 1e-9 * period} | {queue.cut}
    edges = sorted(times)
    pairs = list(zip(edges[:-1], edges[1:], strict=True))
    instants = sorted({a + node * (b - a) if node < 1.0 else b for a, b in pairs for node in stepper.nodes})
    cut = tuple(
        Segment(a, b - a, tuple(instants.index(a + n * (b - a) if n < 1.0 else b) for n in stepper.nodes))
        for a, b in pairs
    )
    return cut, np.array(instants)


def begin(system: System) -> State:
    """Return the state before a session."""
    memory = system.controller.begin() if system.controller else None
    return at_rest(system.rows, system.grid.count, system.cell.actuator.rest_height, memory)


def outlines(system: System, poses: Floats) -> Floats:
    """Return the finger's outlines (k, 10) for poses (k, 7), or none at all without a finger."""
    if system.cell.touch is None:
        return np.empty((0, 10))
    return system.cell.touch.fingertip.outline(poses)


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
    return advance(system, state.copy(), outlines(system, poses))


def advance(system: System, state: State, outline: Floats) -> State:
    """Simulate one control period in the arrays of `state`, which is used up.

    Parameters
    ----------
    system : System
    state : State
        Not to be used again; keep a `State.copy` to come back to it.
    outline : ndarray (p, 10)
        From `outlines`.
    """
    near, under = _near(system, state, outline)
    memory, disc = _attend(system, state)
    cells = _gathered(state, near, disc)
    if not cells.size:
        return replace(state, period=state.period + 1, memory=memory)
    block = state.rows.take(cells, axis=1)
    memory = _command(system, state, memory, cells, block)
    _integrate(system, state, near, under, block)
    return _handed_back(system, state, memory, cells, near, under, block)


def _near(system: System, state: State, outline: Floats) -> tuple[Cells, Floats]:
    """Return the cells the finger may touch in this period, and its underside over them (p, k)."""
    if not outline.size:
        return np.empty(0, np.intp), np.empty((system.instants.size, 0))
    highest = min(state.peak + system.longest_rise, system.cell.actuator.stroke)
    cells, under = window(system.grid, outline, highest)
    touchable = state.rows[0].take(cells) + system.longest_rise > under.min(axis=0)
    return cells[touchable], under[:, touchable]


def _attend(system: System, state: State) -> tuple[Any, Cells]:
    """Let the controller take in the touched cells; return its memory and the cells it will control."""
    if system.controller is None:
        return state.memory, np.empty(0, np.intp)
    pressed = state.moving[state.rows[system.rows.force].take(state.moving) > 0.0]
    seen = _measured(system, state, pressed, state.rows.take(pressed, axis=1))
    memory, disc = system.controller.attend(state.memory, seen)
    return memory, system.grid.box(*disc) if disc else np.empty(0, np.intp)


def _gathered(state: State, near: Cells, disc: Cells) -> Cells:
    """Return near cells first, then the moving and the controlled ones that are not among them."""
    flags = state.flags
    flags[near] = True
    moving = state.moving[~flags[state.moving]]
    flags[moving] = True
    disc = disc[~flags[disc]]
    flags[near] = flags[moving] = False
    return np.concatenate([near, moving, disc])


def _measured(system: System, state: State, cells: Cells, block: Floats) -> Measurement:
    """Measure some cells; `block` holds their rows."""
    rows = system.rows
    sensed_force, sensed_height = system.sensors.measure(block[rows.force], block[0])
    x, y = system.grid.x.take(cells), system.grid.y.take(cells)
    return Measurement(x, y, sensed_height, sensed_force, block[rows.target], state.mode.take(cells))


def _command(system: System, state: State, memory: Any, cells: Cells, block: Floats) -> Any:
    """Let the controller command the gathered cells, and queue the commands; return its memory."""
    if system.controller is None:
        return memory
    rows = system.rows
    memory, orders = system.controller.command(memory, _measured(system, state, cells, block))
    block[rows.target] = orders.target
    state.mode[cells] = orders.mode
    commands = block[rows.commands]
    commands[:-1] = commands[1:].copy()
    commands[-1] = orders.command
    return memory


def _integrate(system: System, state: State, near: Cells, under: Floats, block: Floats) -> None:
    """Move the gathered cells on by one control period, in place."""
    y = block[: system.rows.physics]
    now = state.period * system.period
    if near.size and system.cell.touch:
        waited = now - state.left.take(near)
        if waited.any():
            filters = y[system.cell.pulp_rows, : near.size]
            system.cell.touch.pulp.age(filters, waited)
        state.left[near] = now + system.period
    system.stepper.advance(system.plan, y, block[system.rows.commands], under)


def _handed_back(
    system: System, state: State, memory: Any, cells: Cells, near: Cells, under: Floats, block: Floats
) -> State:
    """Work out the forces, check all is finite, and put the gathered cells back."""
    rows, k = system.rows, near.size
    block[rows.force] = 0.0
    if system.cell.touch and k:
        block[rows.force, :k] = force(system.cell.touch, block[0, :k], under[-1], block[system.cell.pulp_rows, :k])
    if not np.isfinite(block.sum()):
        _diverged(system, state, cells, block)
    state.rows[:, cells] = block
    busy = block[system.cell.lag_rows.start : rows.target].any(axis=0) | (block[rows.force] > 0.0)
    busy |= state.mode.take(cells) > Mode.HOLD
    peak = max(state.peak, float(block[0].max()))
    return State(state.period + 1, state.rows, state.mode, cells[busy], state.left, state.flags, peak, memory)


def _diverged(system: System, state: State, cells: Cells, block: Floats) -> None:
    """Say which number left the finite ones."""
    bad = np.argwhere(~np.isfinite(block))
    if not bad.size:
        return
    row, column = bad[0]
    names = {0: "height", system.rows.force: "force", system.rows.target: "commanded height"}
    remedy = f"Use a shorter physics step than now, or the stepper 'bernoulli'."
    value = float(block[row, column])
    raise DivergenceError(state.period * system.period, int(cells[column]), names.get(row, "state"), value, remedy)


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
        drawn = outlines(system, trajectory.poses(times)).reshape(chunk, -1, OUTLINE)
        for outline in drawn:
            state = advance(system, state, outline)
            yield state
        done += chunk
