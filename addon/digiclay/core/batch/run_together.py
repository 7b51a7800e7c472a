"""Sessions of many scenes in one call."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DigiclayError
from ..engine.system import System
from ..metrics.summary import METRICS
from ..model.fingertip import require_one
from ..model.trajectory import Trajectory
from ..scene.assembly import assemble
from ..scene.schema import Scene
from ..session.accuracy import Errors, compare, has_every_command, reference_settings
from ..session.run_scene import Result, fits, judged
from .advance import Stack, advance, begin, blow_up, broken, follow, kept
from .beds import Beds
from .broadcasting import Floats
from .fingers import Fingers, Way, still_coming, way_over
from .packing import put_together
from .recording import StackRecording
from .traces import StackTraces, summary

__all__ = ["judge_of", "judge_together", "run_together"]


@dataclass(frozen=True)
class _End:
    """Summary of the final state of a run, see `run_scene.Ended`."""

    period: int
    memory: Any


@dataclass(frozen=True, eq=False)
class _Now:
    """The sessions before the first control period, or after one.

    Attributes
    ----------
    stack : Stack
    state : Beds
    runs : tuple of int
        Whose the last axis is.
    over : tuple of int
        Places on it of those that have come to their end.
    failed : ndarray of bool (b,)
        Which of them in an error.
    share : float
        The time each has taken, s: every period's, divided by the runs that were in the stack.
    """

    stack: Stack
    state: Beds
    runs: tuple[int, ...]
    over: tuple[int, ...]
    failed: NDArray[np.bool_]
    share: float


def _assembled(scenes: Sequence[Scene]) -> tuple[dict[int, System], dict[int, DigiclayError]]:
    """Return the systems of the scenes that can be run, and why the others cannot."""
    systems: dict[int, System] = {}
    refused: dict[int, DigiclayError] = {}
    for number, scene in enumerate(scenes):
        try:
            system = assemble(scene)
            fits(scene, system)
        except DigiclayError as error:
            refused[number] = error
        else:
            systems[number] = system
    return systems, refused


def _played(
    scenes: Sequence[Scene], systems: Mapping[int, System], stopped: Callable[[], bool] | None
) -> Iterator[_Now]:
    """Play all sessions to their ends; what is over leaves the stack before the next control period."""
    runs, share = tuple(systems), 0.0
    stack = put_together(list(systems.values()))
    ways = {run: _way(scenes[run]) for run in runs}
    ends = np.array([scenes[run].periods for run in runs])
    state = begin(stack)
    yield _Now(stack, state, runs, (), np.zeros(len(runs), np.bool_), share)
    coming: Fingers | None = None
    while runs:
        started = time.perf_counter()
        coming = still_coming(coming, stack.systems, [ways[run] for run in runs], state.period)
        state = advance(stack, state, coming)
        failed = broken(state)
        share += (time.perf_counter() - started) / len(runs)
        if stopped and stopped():
            return
        over = failed | (state.period == ends)
        yield _Now(stack, state, runs, tuple(np.flatnonzero(over).tolist()), failed, share)
        if over.any():
            left = np.flatnonzero(~over).tolist()
            runs, ends = tuple(runs[place] for place in left), ends[left]
            if runs:
                state = kept(state, left)
                stack, coming = put_together([systems[run] for run in runs]), None


def _way(scene: Scene) -> Trajectory:
    """Return the trajectory of the finger."""
    return require_one(scene.trajectories())


def _judged(now: _Now, place: int, scene: Scene, rows: Any, versions: Mapping[str, str]) -> Result:
    """Return the result of a run that has come to its end; without a history where there are no rows."""
    end = _End(now.state.period, now.state.memory[place])
    return judged(scene, now.stack.systems[place], rows, end, now.share, versions)


def run_together(
    scenes: Sequence[Scene],
    *,
    stopped: Callable[[], bool] | None = None,
    versions: Mapping[str, str] | None = None,
) -> Iterator[tuple[int, Result | DigiclayError]]:
    """Run scenes from rest to their ends, all at once.

    Parameters
    ----------
    scenes : sequence of Scene
        Of one `packing.structure`.
    stopped : callable, optional
        Asked after each control period; when it says True, the runs that are not done are given up.
    versions : mapping, optional
        What else to note as versions the runs were made with.

    Yields
    ------
    number : int
        Which of the scenes has come to its end.
    result : Result or DigiclayError
        As `run_scene.run` would return or raise it. Its history is valid until the next result is
        asked for. Its run time is a share, see `_Now`.
    """
    systems, refused = _assembled(scenes)
    yield from refused.items()
    if not systems:
        return
    playing, recorder = _played(scenes, systems, stopped), scenes[0].recorder
    start = next(playing)
    recording = StackRecording(recorder, start.stack.rows, start.state, start.runs) if recorder else None
    for now in playing:
        if recording:
            recording.observe(now.state, now.runs)
        for place in now.over:
            run = now.runs[place]
            if now.failed[place]:
                yield run, blow_up(now.stack, now.state, place)
                continue
            rows = recording.arrays(run, now.state, place) if recording else None
            yield run, _judged(now, place, scenes[run], rows, versions or {})


def judge_of(scene: Scene) -> Scene:
    """Return the scene that judges a run of another, see `accuracy`: its commands are the other's."""
    return replace(scene, control=None, shape=None, simulation=reference_settings(scene.simulation))


class _Judges:
    """Integrates sessions once more, side by side with them, and keeps the largest differences.

    Parameters
    ----------
    scenes : mapping of int to Scene
        By the numbers of their runs.
    """

    def __init__(self, scenes: Mapping[int, Scene]) -> None:
        self._systems = {run: assemble(judge_of(scene)) for run, scene in scenes.items()}
        self._ways = {run: _way(scene) for run, scene in scenes.items()}
        self._runs = tuple(scenes)
        self._stack = put_together(list(self._systems.values()))
        self._state = begin(self._stack)
        self._coming: Fingers | None = None
        self._largest = np.zeros((3, len(self._runs)))

    def observe(self, state: Beds, runs: tuple[int, ...]) -> None:
        """Do the control period that the sessions have just done; `runs` says whose the last axis is."""
        if runs != self._runs:
            left = [self._runs.index(run) for run in runs]
            self._runs, self._largest = runs, self._largest[:, left]
            self._state = kept(self._state, left)
            self._stack, self._coming = put_together([self._systems[run] for run in runs]), None
        ways = [self._ways[run] for run in runs]
        self._coming = still_coming(self._coming, self._stack.systems, ways, self._state.period)
        self._state = follow(self._stack, self._state, self._coming, state)
        np.maximum(self._largest, self._apart(state), out=self._largest)

    def _apart(self, state: Beds) -> Floats:
        """Return how far the beds are from those of the sessions, shape (3, b)."""
        row, (own, other) = self._stack.rows.force, (self._state.gathered, state.gathered)
        near = slice(own.near)
        return compare(own.block[0], own.block[row, near], other.block[0], other.block[row, near])

    def of(self, place: int) -> Errors:
        """Return the estimated errors so far of the run at a place on the last axis."""
        return Errors.estimate(self._largest[:, place])


def judge_together(
    scenes: Sequence[Scene], *, errors: bool = False, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Result | DigiclayError]]:
    """Run scenes as `run_together` does, and judge them without ever having their histories.

    Parameters
    ----------
    scenes : sequence of Scene
        Of one `packing.structure`, with a recorder.
    errors : bool, optional
        Estimate their errors too, where `accuracy.has_every_command`; those that judge them, see
        `judge_of`, must be of one structure as well.
    stopped : callable, optional
        See `run_together`.

    Yields
    ------
    number : int
    result : Result or DigiclayError
        Without a history; its metrics are those it would have with one.
    """
    systems, refused = _assembled(scenes)
    yield from refused.items()
    if not systems:
        return
    playing, recorder = _played(scenes, systems, stopped), scenes[0].recorder
    assert recorder is not None
    start, longest = next(playing), max(scenes[run].periods for run in systems)
    traces = StackTraces(recorder, start.stack.rows, start.state, start.runs, longest)
    judges = (
        _Judges({run: scenes[run] for run in systems}) if errors and has_every_command(scenes[0]) else None
    )
    ways: dict[Any, Way] = {}
    for now in playing:
        traces.observe(now.state, now.runs)
        if judges:
            judges.observe(now.state, now.runs)
        for place in now.over:
            run = now.runs[place]
            if now.failed[place]:
                yield run, blow_up(now.stack, now.state, place)
                continue
            scene, trace = scenes[run], traces.of(run, now.state, place)
            same = (
                tuple(finger.trajectory for finger in scene.fingers),
                scene.simulation.control_period,
                len(trace.period),
                now.state.period,
            )
            if same not in ways:
                times = trace.period * scene.simulation.control_period
                ways[same] = way_over(systems[run].grid, _way(scene), times)
            found = summary(trace, ways[same], systems[run].grid, scene.set_point)
            result = _judged(now, place, scene, None, {})
            units = {name: METRICS[name][0] for name in found}
            metrics = {**result.metrics, **found, "units": {**result.metrics["units"], **units}}
            result = replace(result, metrics=metrics)
            yield run, result.with_errors(judges.of(place)) if judges else result
