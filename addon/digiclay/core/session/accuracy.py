"""Error estimate of a session: second, finer integration under the same commands.

The commands are those of the session, so that only the integration differs. The reference uses the
closed form, which cannot diverge, or a more accurate stepper. A whole run is evaluated from its
history; a live session has an `ErrorMonitor`, which follows it for a short stretch at intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.arrays import Array, Floats
from ..base.errors import DigiclayError, ParameterError
from ..engine.simulation import Progress, Stopped, begin, periods, repeat_period
from ..engine.state import State
from ..engine.system import System
from ..model.control_interface import Commands, Measurement
from ..model.layout import Disc, Grid
from ..model.null_parts import DirectDrive
from ..model.trajectory import Path, interpolate_poses, sample_poses
from ..scene.assembly import assemble
from ..scene.schema import MOST_CUT, MOST_STEPS, Scene, Simulation

if TYPE_CHECKING:
    from ..engine.bodies import Knot

#: Control periods of a session: the state after each, the fingertip at both ends of it, (2, f, 7), and
#: bodies at times before and after it.
Noted = tuple[tuple[State, Floats, "Sequence[Knot]"], ...]

#: Error of a run per difference from its reference. The reference's own error is taken as a quarter
#: of that of the run: with a quarter of the step, that remains of an error of first order, as
#: across a kink. The estimate covers the true error in 95 of 100 runs: it is no bound, and is
#: printed as "about".
SHARE = 4.0 / 3.0
#: Parts of a step in the reference of steppers that are more accurate than the closed form at a
#: quarter of the step; the steps of the adaptive one are not known beforehand.
FINER = {"richardson": 4, "adaptive": 8}
#: Longest physics step of a reference, s: longer ones do not resolve the shortest time constants.
LONGEST = 1.25e-3
#: Control periods of a live session's stretch, of the pause between two stretches, and per period
#: of the reference, which takes twice as long: so no tick is slow.
STRETCH, PAUSE, SPREAD = 20, 180, 4
#: Largest deviation of the fingertip from a straight path within a step at which the estimate
#: holds, m.
BENT = 0.1e-3
#: Heights that are compared together, those of several control periods.
TOGETHER = 20_000
#: Points of a path per physics step, and steps that are evaluated together.
PARTS, BLOCK = 16, 4096


class Errors(NamedTuple):
    """Largest errors of height, m, force on a cell, N, and total force, N: of a run, or so far."""

    height: float
    force: float
    total_force: float

    @classmethod
    def estimate(cls, largest: Floats) -> Errors:
        """Return the errors for the largest differences from a reference, (3,)."""
        return cls(*(SHARE * largest).tolist())


class ErrorMonitor(NamedTuple):
    """Reference solution of a live session, over a stretch at intervals; it lags behind the session."""

    system: System
    """The session's, with the `reference_settings`."""
    state: State | None = None
    """The reference's; None between two stretches."""
    age: int = 0
    """Control periods of the session since the stretch began."""
    done: int = 0
    """Control periods of the reference since then."""
    before: int = 0
    """Control periods of the session in the tick before."""
    waiting: Noted = ()
    """Periods of the stretch still to be integrated: the session's state after each, of which only the active
    cells are as of then, the fingertip at both ends of it, and bodies."""
    reached: Floats | None = None
    """(n,): Heights of the session at the end of the stretch, m."""
    carried: Floats | None = None
    """(n,): Heights of the reference less those of the session there, m, for the next stretch."""
    largest: Floats | None = None
    """(3,): From `compare`, in the stretches so far."""


class Replay:
    """Replay of recorded valve commands, (t, n), one row per control period; zero afterwards."""

    rows = 0

    def __init__(self, grid: Grid, commands: Floats) -> None:
        self.commands = commands
        # The disc around all cells that are ever commanded: x, y, radius, m.
        self.disc: Disc | None = grid.enclose(np.flatnonzero(commands.any(axis=0)))

    def begin(self) -> int:
        """Return the number of periods played."""
        return 0

    def locate(self, memory: int, touched: Measurement) -> tuple[int, Disc | None]:
        """Return the disc around every commanded cell."""
        return memory, self.disc

    def command(self, memory: int, seen: Measurement) -> tuple[int, Commands]:
        """Return the commands of the period."""
        command = np.zeros(seen.height.shape)
        if memory < len(self.commands):
            command = self.commands[memory, seen.cells]
        return memory + 1, Commands(seen.target, seen.mode, command)


def explain_absence(scene: Scene) -> str:
    """Return why errors of a run of this scene cannot be estimated, or ``""``."""
    if scene.recorder is None:
        return "recorder = 'absent' keeps no command"
    if scene.drive and scene.drive.line_lag:
        return "commands of the lines' gates are not recorded"
    try:
        reference_settings(scene.simulation)
    except ParameterError:
        return "simulation.physics_step is too short to be halved"
    every = scene.recorder.every
    return (
        "" if every == 1 else f"recorder.every = {every} leaves out commands, with 1 all are there"
    )


def reference_settings(simulation: Simulation) -> Simulation:
    """Return the integration of a reference: closed form, at least 4 parts per step; or see `FINER`."""
    if simulation.stepper in FINER:
        parts = max(2, min(FINER[simulation.stepper], MOST_CUT["richardson"] // simulation.steps))
        return replace(simulation, stepper="richardson").refined(parts)
    parts = max(4, math.ceil(simulation.control_period / simulation.steps / LONGEST * (1.0 - 1e-9)))
    parts = max(2, min(parts, MOST_STEPS // simulation.steps))
    return replace(simulation.refined(parts), stepper="bernoulli")


def make_reference(scene: Scene) -> Scene:
    """Return the reference of a run: its parts and `reference_settings`, without a controller.

    The undersides of its bodies are computed in every control period.
    """
    bodies = tuple(replace(each, body=replace(each.body, travel=0.0)) for each in scene.bodies)
    settings = reference_settings(scene.simulation)
    return replace(scene, control=None, shape=None, simulation=settings, bodies=bodies)


def compare(height: Floats, force: Floats, other_height: Floats, other_force: Floats) -> Floats:
    """Return the largest differences (3[, b]) of heights (n[, b]), m, forces (k[, b]) and total forces, N."""
    heights, forces = np.abs(height - other_height), force - other_force
    largest = (np.maximum.reduce(part, initial=0.0) for part in (heights, np.abs(forces)))
    return np.stack([*largest, np.abs(np.add.reduce(forces))])


def estimate_errors(
    scene: Scene,
    history: dict[str, Array],
    *,
    progress: Progress = None,
    stopped: Stopped = None,
) -> Errors | None:
    """Estimate the errors of a run with every command; None when `stopped`; see `run_scene.run`."""
    system = assemble(make_reference(scene))
    replay = Replay(system.grid, history["command"])
    system = replace(system, controller=replay, drive=DirectDrive())
    done, largest = len(history["time"]) - 1, np.zeros(3)
    most = max(1, TOGETHER // system.grid.count)
    reference = np.empty((2, most, system.grid.count))
    for row, state in enumerate(periods(system, scene.trajectories(), begin(system), done), 1):
        last = (row - 1) % most
        reference[:, last] = state.row(0), state.row(system.rows.force)
        if last == most - 1 or row == done:
            rows = slice(row - last, row + 1)
            height, force = reference[:, : last + 1].transpose(0, 2, 1)
            differences = compare(
                height, force, history["height"][rows].T, history["force"][rows].T
            )
            largest = np.maximum(largest, differences.max(axis=1))
        if progress:
            progress(row, done)
        if stopped and stopped():
            return None
    return Errors.estimate(largest)


def describe_bends(scene: Scene) -> str:
    """Return the reason to doubt the estimated errors of a run, or ``""``.

    The run misses a contact that begins and ends within a step, and its reference resolves it only
    in part.
    """
    paths, simulation = tuple(finger.trajectory for finger in scene.fingers), scene.simulation
    bend = _measure_bends(paths, simulation.physics_step, simulation.duration)
    reason = f"within a step the path of the fingertip bends by {bend * 1e3:.2g} mm"
    return f"{reason}: use a shorter simulation.physics_step" if bend > BENT else ""


@lru_cache(maxsize=1)  # points of a sweep have one path
def _measure_bends(paths: tuple[Path, ...], step: float, duration: float) -> float:
    """Return the largest deviation of fingertips from a straight path within a physics step, m."""
    trajectories, largest = [path.trajectory() for path in paths], 0.0
    # A fingertip rests after its last waypoint, however long the session is.
    moved = min(duration, max((trajectory.duration for trajectory in trajectories), default=0.0))
    count = math.ceil(moved / step)
    for first in range(0, count, BLOCK):
        steps = min(BLOCK, count - first)
        times = (first + np.arange(steps * PARTS + 1) / PARTS) * step
        position = sample_poses(trajectories, times)[..., :3]
        inside = np.stack([position[part : part + steps * PARTS : PARTS] for part in range(PARTS)])
        part = np.arange(PARTS)[:, None, None, None] / PARTS
        straight = inside[0] + part * (position[PARTS::PARTS] - inside[0])
        largest = max(largest, float(np.linalg.norm(inside - straight, axis=-1).max()))
    return largest


def start(scene: Scene) -> ErrorMonitor | None:
    """Return the monitor of a live session that begins; None if its errors cannot be estimated."""
    if scene.drive and scene.drive.line_lag:
        return None
    try:
        # With the controller: a stretch begins with a copy of the session's state, which has its
        # rows.
        return ErrorMonitor(
            assemble(replace(scene, simulation=reference_settings(scene.simulation)))
        )
    except DigiclayError:
        return None


def restart(monitor: ErrorMonitor | None, scene: Scene) -> ErrorMonitor | None:
    """Return the monitor of a session whose fingertips have changed, which interrupts a stretch."""
    begun = start(scene) if monitor else None
    return begun._replace(age=monitor.age) if monitor and begun and monitor.state is None else begun


def reset(monitor: ErrorMonitor) -> ErrorMonitor:
    """Return the monitor of a session that continues from another state."""
    return ErrorMonitor(monitor.system)


def begin_stretch(monitor: ErrorMonitor, state: State, pause: int = PAUSE) -> ErrorMonitor:
    """Return the monitor with a copy of a session's state if a stretch is due, else unchanged."""
    if monitor.state is not None or 0 < monitor.age < STRETCH + pause:
        return monitor
    begun = state.copy()
    if monitor.carried is not None:
        begun.rows[0] += monitor.carried
        begun.active.block[0] += monitor.carried[begun.active.cells]
    return ErrorMonitor(
        monitor.system,
        begun,
        before=monitor.before,
        carried=monitor.carried,
        largest=monitor.largest,
    )


def note(
    monitor: ErrorMonitor,
    after: State,
    path: Floats,
    pause: int = PAUSE,
    knots: Sequence[Knot] = (),
) -> ErrorMonitor:
    """Return the monitor with a session's last period; `path` (2, f, 7), `knots`: its fingertips, bodies."""
    monitor = monitor._replace(age=monitor.age + 1)
    if monitor.state is None:
        return begin_stretch(monitor, after, pause)
    if monitor.age > STRETCH:
        return monitor
    state = after._replace(active=replace(after.active, block=after.active.block.copy()))
    reached = after.row(0) if monitor.age == STRETCH else None
    return monitor._replace(waiting=(*monitor.waiting, (state, path, knots)), reached=reached)


def catch_up(monitor: ErrorMonitor, after: State, count: int) -> tuple[ErrorMonitor, Errors | None]:
    """Integrate noted periods after a tick of `count`; return the errors so far if a stretch has ended."""
    # A tick of more periods than the one before is already slow.
    longer, monitor = count > monitor.before, monitor._replace(before=count)
    due = 0 if longer else min(monitor.age // SPREAD - monitor.done, max(1, count // SPREAD))
    state, system = monitor.state, monitor.system
    while state is not None and due > 0:
        due -= 1
        with np.errstate(over="ignore", invalid="ignore"):
            (leader, path, knots), *waiting = monitor.waiting
            if knots:
                from ..engine.bodies import give_bodies

                give_bodies(system, knots)
            poses = interpolate_poses(path, system.instants / system.period)
            (finger,) = system.trace(poses, state.period)
            state = repeat_period(system, state, finger, leader)
        if not np.isfinite(state.active.block).all():
            return begin_stretch(reset(monitor), after), None
        compared = [0, system.rows.force]
        largest = compare(*state.active.block[compared], *leader.active.block[compared])
        if monitor.largest is not None:
            largest = np.maximum(largest, monitor.largest)
        if not waiting and monitor.reached is not None:
            carried = state.row(0) - monitor.reached
            monitor = ErrorMonitor(
                system, None, monitor.age, before=count, carried=carried, largest=largest
            )
            return monitor, Errors.estimate(largest)
        monitor = monitor._replace(
            state=state, largest=largest, done=monitor.done + 1, waiting=tuple(waiting)
        )
    return monitor, None
