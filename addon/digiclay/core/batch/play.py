"""Simulation of a batch, period by period: fingertip paths, and runs that end and leave."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError, ParameterError
from ..engine.simulation import CHUNK, find_divergence, simulate_period
from ..engine.state import State
from ..engine.system import System
from ..model.control_interface import count_losses
from ..model.fingertip import require_one
from ..model.touch import FingerPath, FingerPeriod, join_paths, trace_finger
from ..model.trajectory import Trajectory
from ..scene.schema import Scene
from ..session.run_scene import Ended
from .columns import Batch, begin, make_batch


def extend_path(
    path: FingerPath | None,
    systems: Sequence[System],
    trajectories: Sequence[Trajectory],
    period: int,
) -> FingerPath | None:
    """Return the fingertip path of a batch in a period and later ones; None without contact."""
    if systems[0].cell.touch is None or (path and period < path.first + len(path.forms)):
        return path
    runs = {_list_causes(*run): run for run in zip(systems, trajectories, strict=True)}
    alone = runs.values() if len(runs) == 1 else zip(systems, trajectories, strict=True)
    return join_paths([_trace_run(system, trajectory, period) for system, trajectory in alone])


def _list_causes(system: System, trajectory: Trajectory) -> tuple[Any, ...]:
    """Return the data that determine the fingertip path of a run."""
    arrays = (system.instants, trajectory.times, trajectory.positions, trajectory.orientations)
    touch = system.cell.touch
    return (
        touch and touch.fingertip,
        trajectory.interpolation,
        system.period,
        *(values.tobytes() for values in arrays),
    )


def _trace_run(system: System, trajectory: Trajectory, first: int) -> FingerPath:
    """Return the fingertip path of one run from period `first` on."""
    assert system.cell.touch is not None
    starts = (first + np.arange(CHUNK)) * system.period
    poses = trajectory.poses((starts[:, None] + system.instants).ravel()).reshape(CHUNK, -1, 7)
    return trace_finger(system.cell.touch.fingertip, poses, first)


def find_diverged(state: State) -> NDArray[np.bool_]:
    """Return which runs, (b,), have numbers that are not finite."""
    block = state.active.block
    # A finite sum, the usual case, shows that all numbers are finite.
    if math.isfinite(np.add.reduce(block, axis=None)):
        return np.zeros(block.shape[2], np.bool_)
    finite: NDArray[np.bool_] = np.isfinite(block.sum(axis=(0, 1)))
    return ~finite


def make_divergence_error(batch: Batch, state: State, run: int) -> DivergenceError:
    """Return the error of a run, by its index, with a number that is not finite after a control period."""
    former = state.active
    error = find_divergence(
        batch.systems[run], former.cells[:, run], former.block[..., run], state.period - 1
    )
    assert error is not None
    return error


def select_runs(state: State, runs: Sequence[int]) -> State:
    """Return the state of some runs; `runs`: their indices on the last axis."""
    chosen, former = np.array(runs, np.intp), state.active
    # The set is renewed at once: its discs are not needed.
    active = replace(
        former,
        cells=former.cells[:, chosen],
        block=former.block[..., chosen],
        mode=former.mode[:, chosen],
        quadratic_basis=former.quadratic_basis[..., chosen],
        peak=former.peak[chosen],
        until=0,
        runs=tuple(former.runs[run] for run in runs) if former.runs else (),
    )
    several = (state.rows, state.modes, state.aged)
    rows, modes, aged = (np.ascontiguousarray(rows[..., chosen]) for rows in several)
    memory = [state.memory[run] for run in runs]
    chosen_state = State(state.period, rows, modes, aged, state.peak[chosen], active, memory)
    if state.deflection is None:
        return chosen_state
    deflection = type(state.deflection)(*(row[chosen] for row in state.deflection))
    return chosen_state._replace(deflection=deflection)


@dataclass(frozen=True, eq=False)
class Play:
    """Batch at one instant, with all that the next period needs."""

    trajectories: Mapping[int, Trajectory]
    """By the numbers of the runs."""
    runs: tuple[int, ...]
    """Numbers of the runs, in the order of the last axis."""
    batch: Batch
    state: State
    path: FingerPath | None = None
    """Fingertip paths in the coming periods, as far as computed."""

    @property
    def finger(self) -> FingerPeriod | None:
        """Fingertip path in the coming control period."""
        return self.path.at(self.state.period) if self.path else None


def begin_play(scenes: Mapping[int, Scene], systems: Mapping[int, System]) -> Play:
    """Return a batch before its first control period; `scenes`: by the numbers of the runs."""
    for part in ("bodies", "drive"):
        if any(getattr(scene, part) for scene in scenes.values()):
            rule = f"must have no {part}: run them alone"
            raise ParameterError("Batch", "scenes", rule, "some")
    batch = make_batch([systems[run] for run in scenes])
    trajectories = {run: require_one(scene.trajectories()) for run, scene in scenes.items()}
    return Play(trajectories, tuple(scenes), batch, begin(batch))


def locate_fingers(play: Play) -> Play:
    """Return the batch with the fingertip paths in the coming control period."""
    trajectories = [play.trajectories[run] for run in play.runs]
    return replace(
        play, path=extend_path(play.path, play.batch.systems, trajectories, play.state.period)
    )


def keep_runs(play: Play, runs: tuple[int, ...]) -> Play:
    """Return the batch with only the runs that continue."""
    columns = [play.runs.index(run) for run in runs]
    batch = make_batch([play.batch.systems[column] for column in columns])
    return replace(play, runs=runs, batch=batch, state=select_runs(play.state, columns), path=None)


@dataclass(frozen=True, eq=False)
class Instant:
    """Batch after a control period."""

    play: Play
    over: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    """(b,): Which runs have ended, and which of them by an error."""
    share: float
    """Computing time per run, s: that of each period, divided by the runs then in the batch."""

    def ended(self, index: int) -> Ended:
        """Return the end of the run at an index of the last axis."""
        state = self.play.state
        return Ended(state.period, self.share, count_losses(state.memory[index]))


def play_all(
    play: Play, ends: Mapping[int, int], stopped: Callable[[], bool] | None
) -> Iterator[Instant]:
    """Yield the batch after each control period; runs that have ended leave it before the next one."""
    share = 0.0
    while play.runs:
        started = time.perf_counter()
        play = locate_fingers(play)
        play = replace(play, state=simulate_period(play.batch, play.state, play.finger))
        failed = find_diverged(play.state)
        share += (time.perf_counter() - started) / len(play.runs)
        if stopped and stopped():
            return
        over = failed | [ends[run] == play.state.period for run in play.runs]
        yield Instant(play, over, failed, share)
        if over.all():
            return
        if over.any():
            play = keep_runs(
                play, tuple(run for run, gone in zip(play.runs, over, strict=True) if not gone)
            )
