"""Runs of a batch played in step: paths of their fingertips, periods, and which runs go on."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DivergenceError
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
    path: FingerPath | None, systems: Sequence[System], ways: Sequence[Trajectory], period: int
) -> FingerPath | None:
    """Return the fingertip path of a batch in a period and some more; None where nothing touches."""
    if systems[0].cell.touch is None or (path and period < path.first + len(path.forms)):
        return path
    runs = {_list_causes(*run): run for run in zip(systems, ways, strict=True)}
    alone = runs.values() if len(runs) == 1 else zip(systems, ways, strict=True)
    return join_paths([_trace_run(system, way, period) for system, way in alone])


def _list_causes(system: System, way: Trajectory) -> tuple[Any, ...]:
    """Return what a run's fingertip path depends on."""
    arrays = (system.instants, way.times, way.positions, way.orientations)
    touch = system.cell.touch
    return touch and touch.fingertip, way.interpolation, system.period, *(one.tobytes() for one in arrays)


def _trace_run(system: System, way: Trajectory, first: int) -> FingerPath:
    """Compute the fingertip path of one run in some periods."""
    assert system.cell.touch is not None
    starts = (first + np.arange(CHUNK)) * system.period
    poses = way.poses((starts[:, None] + system.instants).ravel()).reshape(CHUNK, -1, 7)
    return trace_finger(system.cell.touch.fingertip, poses, first)


def find_diverged(state: State) -> NDArray[np.bool_]:
    """Return which runs, (b,), hold numbers that are not finite."""
    block = state.active.block
    # One sum tells that all is well, as it nearly always is.
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
    """Return the state of some of the runs. `runs`: their indices on the last axis."""
    chosen, former = np.array(runs, np.intp), state.active
    # The discs are not worth keeping: the set is made anew.
    active = replace(
        former,
        cells=former.cells[:, chosen],
        block=former.block[..., chosen],
        mode=former.mode[:, chosen],
        quadratic_basis=former.quadratic_basis[..., chosen],
        peak=former.peak[chosen],
        until=0,
        own=tuple(former.own[run] for run in runs) if former.own else (),
    )
    several = (state.rows, state.modes, state.aged)
    rows, modes, aged = (np.ascontiguousarray(one[..., chosen]) for one in several)
    memory = [state.memory[run] for run in runs]
    return State(state.period, rows, modes, aged, state.peak[chosen], active, memory)


@dataclass(frozen=True, eq=False)
class Play:
    """Sessions under way, and all it takes to go on."""

    ways: Mapping[int, Trajectory]
    """By the numbers of their runs."""
    runs: tuple[int, ...]
    """Whose the last axis is."""
    batch: Batch
    state: State
    path: FingerPath | None = None
    """Of the fingertips, in the coming periods as far as it is computed."""

    @property
    def finger(self) -> FingerPeriod | None:
        """Fingertip path in the coming control period."""
        return self.path.at(self.state.period) if self.path else None


def begin_play(scenes: Mapping[int, Scene], systems: Mapping[int, System]) -> Play:
    """Return sessions before their first control period. `scenes`: by the numbers of their runs."""
    batch = make_batch([systems[run] for run in scenes])
    ways = {run: require_one(scene.trajectories()) for run, scene in scenes.items()}
    return Play(ways, tuple(scenes), batch, begin(batch))


def locate_fingers(play: Play) -> Play:
    """Return the sessions with the way of their fingers through the coming control period."""
    ways = [play.ways[run] for run in play.runs]
    return replace(play, path=extend_path(play.path, play.batch.systems, ways, play.state.period))


def keep_runs(play: Play, runs: tuple[int, ...]) -> Play:
    """Return some of the sessions. `runs`: those that go on."""
    places = [play.runs.index(run) for run in runs]
    batch = make_batch([play.batch.systems[place] for place in places])
    return replace(play, runs=runs, batch=batch, state=select_runs(play.state, places), path=None)


@dataclass(frozen=True, eq=False)
class Instant:
    """The sessions after a control period."""

    play: Play
    over: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    """(b,): Which have come to their end, and which of them in an error."""
    share: float
    """The time each has taken, s: every period's, divided by the runs that were in the batch."""

    def ended(self, index: int) -> Ended:
        """Return how far the run at an index of the last axis has come."""
        state = self.play.state
        return Ended(state.period, self.share, count_losses(state.memory[index]))


def play_all(play: Play, ends: Mapping[int, int], stopped: Callable[[], bool] | None) -> Iterator[Instant]:
    """Yield the sessions after each control period; what is at its end leaves before the next one."""
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
            play = keep_runs(play, tuple(run for run, gone in zip(play.runs, over, strict=True) if not gone))
