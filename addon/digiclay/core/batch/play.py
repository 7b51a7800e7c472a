"""Simulation of a batch, control period by control period, until all its runs have come to their ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..engine.state import State
from ..engine.system import System
from ..model.fingertip import require_one
from ..model.trajectory import Trajectory
from ..scene.schema import Scene
from ..session.run_result import Ended, count_losses
from .advance import Batch, advance, begin, find_diverged, select_runs
from .finger_paths import Fingers, extend_fingers
from .packing import make_batch


@dataclass(frozen=True, eq=False)
class Play:
    """Sessions under way, and all it takes to go on.

    Attributes
    ----------
    systems : mapping of int to System
        By the numbers of their runs.
    ways : mapping of int to Trajectory
    runs : tuple of int
        Whose the last axis is.
    batch : Batch
    state : State
    coming : Fingers or None
        How the fingers come, as far as that is worked out.
    """

    systems: Mapping[int, System]
    ways: Mapping[int, Trajectory]
    runs: tuple[int, ...]
    batch: Batch
    state: State
    coming: Fingers | None = None


def begin_play(scenes: Mapping[int, Scene], systems: Mapping[int, System]) -> Play:
    """Return sessions before their first control period. `scenes`: by the numbers of their runs."""
    batch = make_batch([systems[run] for run in scenes])
    ways = {run: require_one(scene.trajectories()) for run, scene in scenes.items()}
    return Play(systems, ways, tuple(scenes), batch, begin(batch))


def locate_fingers(play: Play) -> Play:
    """Return the sessions with the way of their fingers through the coming control period."""
    ways = [play.ways[run] for run in play.runs]
    return replace(play, coming=extend_fingers(play.coming, play.batch.systems, ways, play.state.period))


def keep_runs(play: Play, runs: tuple[int, ...]) -> Play:
    """Return some of the sessions. `runs`: those that go on."""
    state = select_runs(play.state, [play.runs.index(run) for run in runs])
    batch = make_batch([play.systems[run] for run in runs])
    return replace(play, runs=runs, batch=batch, state=state, coming=None)


@dataclass(frozen=True, eq=False)
class Instant:
    """The sessions after a control period.

    Attributes
    ----------
    play : Play
    over, failed : ndarray of bool (b,)
        Which have come to their end, and which of them in an error.
    share : float
        The time each has taken, s: every period's, divided by the runs that were in the batch.
    """

    play: Play
    over: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    share: float

    def ended(self, index: int) -> Ended:
        """Return how far the run at an index of the last axis has come."""
        state = self.play.state
        return Ended(state.period, self.share, count_losses(state.memory[index]))


def play_all(play: Play, ends: Mapping[int, int], stopped: Callable[[], bool] | None) -> Iterator[Instant]:
    """Play all sessions to their ends; what is over leaves the batch before the next control period.

    `ends`: each run's last control period; `stopped`: asked after each control period; when it says True, the
    sessions are given up. Yields after each control period.
    """
    share = 0.0
    while play.runs:
        started = time.perf_counter()
        play = locate_fingers(play)
        play = replace(play, state=advance(play.batch, play.state, play.coming))
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
