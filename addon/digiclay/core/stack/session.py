"""Sessions of many scenes in one call."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..assembly import assemble
from ..errors import DigiclayError
from ..layout import Grid
from ..metrics import BAND, METRICS, cell_area, contact_loss_share, first_touch, in_contact, rfd
from ..metrics_path import ridge_errors
from ..metrics_signal import deviation, mean, overshoot, settling_time, weights
from ..scene import Scene
from ..session import FORCE_DEVIATIONS, Result, fits, judged
from ..simulation import CHUNK
from ..system import System
from .assembly import put_together
from .beds import Beds
from .fingers import Fingers, Way, fingers, way_over
from .recording import StackRecording, StackTraces, Trace
from .simulation import Stack, advance, begin, blow_up, broken, kept

__all__ = ["judge_together", "run_together"]


@dataclass(frozen=True)
class _End:
    """What counts of the state a run ended in, see `session.Ended`."""

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
    ways = {run: scenes[run].trajectory.trajectory() for run in runs}
    ends = np.array([scenes[run].periods for run in runs])
    state = begin(stack)
    yield _Now(stack, state, runs, (), np.zeros(len(runs), np.bool_), share)
    coming: Fingers | None = None
    until = first = 0
    while runs:
        started = time.perf_counter()
        if state.period == until and stack.touch:
            first, until = until, until + CHUNK
            coming = fingers(stack.systems, [ways[run] for run in runs], first, CHUNK)
        state = advance(stack, state, coming, state.period - first)
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
                state = kept(state, stack.controller, left)
                stack = put_together([systems[run] for run in runs])
                until = state.period


def _judged(now: _Now, place: int, scene: Scene, rows: Any, versions: Mapping[str, str]) -> Result:
    """Return the result of a run that has come to its end; without a history where there are no rows."""
    memory = now.stack.controller.of(now.state.memory, place) if now.stack.controller else None
    end, way = _End(now.state.period, memory), scene.trajectory.trajectory()
    return judged(scene, now.stack.systems[place], way, rows, end, now.share, versions)


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
        Of one `assembly.structure`.
    stopped : callable, optional
        Asked after each control period; when it says True, the runs that are not done are given up.
    versions : mapping, optional
        What else to note as versions the runs were made with.

    Yields
    ------
    number : int
        Which of the scenes has come to its end.
    result : Result or DigiclayError
        As `session.run` would return or raise it. Its history is valid until the next result is
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


def judge_together(
    scenes: Sequence[Scene], *, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Result | DigiclayError]]:
    """Run scenes as `run_together` does, and judge them without ever having their histories.

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
    ways: dict[Any, Way] = {}
    for now in playing:
        traces.observe(now.state, now.runs)
        for place in now.over:
            run = now.runs[place]
            if now.failed[place]:
                yield run, blow_up(now.stack, now.state, place)
                continue
            scene, trace = scenes[run], traces.of(run, now.state, place)
            same = scene.trajectory, scene.simulation.control_period, len(trace.period), now.state.period
            if same not in ways:
                times = trace.period * scene.simulation.control_period
                ways[same] = way_over(systems[run].grid, scene.trajectory.trajectory(), times)
            found = _summary(trace, ways[same], systems[run].grid, scene.set_point)
            result = _judged(now, place, scene, None, {})
            units = {name: METRICS[name][0] for name in found}
            metrics = {**result.metrics, **found, "units": {**result.metrics["units"], **units}}
            yield run, replace(result, metrics=metrics)


def _summary(trace: Trace, way: Way, grid: Grid, set_point: float | None) -> dict[str, float | None]:
    """Return what `metrics.summary` would make of the history a trace is of; the same keys.

    Without a set point nothing was asked of the force, so nothing deviates.
    """
    time, total, target, weight = way.time, trace.total, set_point or 0.0, weights(way.time)
    felt, formed, area = in_contact(total), trace.last - trace.first, cell_area(grid.positions)
    place = np.column_stack([trace.x, trace.y])[felt] / total[felt, None]
    behind = np.round(np.hypot(*(way.fingertip[felt, :2] - place).T), 12)
    above = trace.height[felt] / total[felt] - way.fingertip[felt, 2]
    rows, first = felt & trace.following, first_touch(total)
    ridge = ridge_errors(grid.positions[way.cells], trace.last[way.cells], way.fingertip, rows)
    each = np.ones(len(ridge))
    beyond = settled = None
    if first.stop > first.start:
        beyond = overshoot(np.concatenate([[0.0], total[first]]), target)
        settled = settling_time(time[first], total[first], target, BAND * target)
    found: dict[str, float | None] = {
        "duration": float(time[-1] - time[0]),
        "set_point": target,
        "rfd": rfd(time, total, target),
        "rfd_shaping": rfd(time, total, target, rows),
        "rfd_session": rfd(time, total, target, np.ones(len(time), dtype=bool)),
        "contact_share": mean(felt.astype(np.float64), weight),
        "contact_loss_share": contact_loss_share(time, total),
        "lag_mean": mean(behind, weight[felt]),
        "lag_max": float(behind.max()) if len(behind) else None,
        "force_deviation": deviation(total[rows], weight[rows]),
        "force_overshoot": beyond,
        "settling_time": settled,
        "height_deviation": deviation(above[rows[felt]], weight[rows]),
        "ridge_offset": mean(ridge, each),
        "ridge_error": float(np.sqrt(np.mean(ridge**2))) if len(ridge) else None,
        "ridge_unevenness": deviation(ridge, each),
        "max_cell_force": float(trace.strongest.max()),
        "max_total_force": float(total.max()),
        "lowest": float(trace.last.min()),
        "highest": float(trace.last.max()),
        "height_range": float(np.ptp(trace.last)),
        "raised_volume": None if area is None else area * float(np.sum(np.maximum(formed, 0.0))),
        "sunk_volume": None if area is None else area * float(np.sum(np.maximum(-formed, 0.0))),
    }
    void = FORCE_DEVIATIONS if set_point is None else ()
    return {
        name: value if value is not None and name not in void and np.isfinite(value) else None
        for name, value in found.items()
    }
