"""Runs of many scenes in one call: simulated together, recorded, evaluated."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Floats
from ..base.errors import DigiclayError, ParameterError
from ..base.modes import FORCE_FOLLOW
from ..engine.simulation import repeat_period
from ..engine.state import ActiveSet
from ..engine.system import System
from ..metrics.summary import CellSums, compute_metrics_from_sums, sum_row
from ..scene.assembly import assemble
from ..scene.recorder import HistoryWriter, Recorder, Recording, Stretch
from ..scene.schema import Scene
from ..session.accuracy import Errors, compare, explain_absence, make_reference
from ..session.memory_limit import check_memory
from ..session.run_scene import Result, evaluate, measure_losses, report
from .play import (
    Instant,
    Play,
    begin_play,
    keep_runs,
    locate_fingers,
    make_divergence_error,
    play_all,
)
from .structure import describe_structure


class Histories:
    """Histories of runs, stored as stretches of active cells, and written out one run at a time.

    Histories of all cells of all runs would not fit into memory. `scenes`: by the numbers of the
    runs; `play`: the batch before its first period; without a recorder there are no histories.
    """

    def __init__(self, scenes: Mapping[int, Scene], recorder: Recorder | None, play: Play) -> None:
        self._scenes, self._runs, self._present = scenes, play.runs, play.runs
        self._first, self._mode = play.state.row(0), play.state.mode()
        self._stretches: dict[int, list[Stretch]] = {run: [] for run in play.runs}
        self._rises: dict[int, list[Floats]] = {run: [np.zeros(1)] for run in play.runs}
        self._recording = Recording(recorder, play.batch.rows, self._store) if recorder else None

    def _store(self, stretch: Stretch) -> None:
        """Store a stretch of the present runs."""
        for run, part in zip(self._present, stretch.split(), strict=True):
            self._stretches[run].append(part)

    def observe(self, now: Instant) -> None:
        """Record a control period."""
        if self._recording is None:
            return
        if now.play.runs is not self._present:
            self._recording.flush()
            self._present = now.play.runs
        state = now.play.state
        self._recording.observe(state)
        if state.deflection and state.period % self._recording.every == 0:
            for run, rise in zip(self._present, state.deflection.rise[:, None], strict=True):
                self._rises[run].append(rise)

    def finish(self, now: Instant, index: int) -> Result:
        """Return the result of a run at its end."""
        run, state = now.play.runs[index], now.play.state
        rows = self._write(self._recording, run, state.period) if self._recording else {}
        if state.deflection and rows:
            rises = [*self._rises.pop(run), state.deflection.rise[index, None]]
            rows["deflection"] = np.array(rises[: len(rows["period"])])
        return evaluate(self._scenes[run], now.play.batch.systems[index], rows, now.ended(index))

    def _write(self, recording: Recording, run: int, period: int) -> dict[str, Array]:
        """Write the history of a run up to a period; return its rows."""
        recording.flush()
        count, column = 1 - (-period // recording.every), self._runs.index(run)
        history = HistoryWriter(count, len(self._first))
        history.begin(self._first[:, column], self._mode[:, column])
        for stretch in self._stretches.pop(run):
            history.write(stretch)
        return history.finish(period, recording.every)


class Sums:
    """Sums over cells that the metrics need, row by row; parameters as of `Histories`."""

    def __init__(self, scenes: Mapping[int, Scene], recorder: Recorder | None, play: Play) -> None:
        recorder = recorder or Recorder()
        count = recorder.rows(max(scene.periods for scene in scenes.values()))
        self._scenes, self._every, self._force = scenes, recorder.every, play.batch.rows.force
        self._runs, self._present, self._columns = play.runs, play.runs, list(range(len(play.runs)))
        self._first = play.state.row(0)
        self._sums = np.zeros((count, 5, len(play.runs)))
        self._following = np.zeros((count, len(play.runs)), np.intp)
        self._rises = np.zeros((count, len(play.runs)))
        # Times, poses and nearest cells by path, which most runs of a batch share.
        self._ways: dict[Any, tuple[Floats, Floats, NDArray[np.intp]]] = {}

    def observe(self, now: Instant) -> None:
        """Add a control period."""
        if now.play.runs is not self._present:
            self._present = now.play.runs
            self._columns = [self._runs.index(run) for run in self._present]
        active, period = now.play.state.active, now.play.state.period
        if (period - 1) % self._every == 0:
            self._following[(period - 1) // self._every, self._columns] = _count_following(active)
        if period % self._every == 0:
            self._sums[period // self._every, :, self._columns] = self._sum(active).T
            if deflection := now.play.state.deflection:
                self._rises[period // self._every, self._columns] = deflection.rise

    def finish(self, now: Instant, index: int) -> Result:
        """Return the result of a run at its end, without a history."""
        play, run, period = now.play, now.play.runs[index], now.play.state.period
        scene, column, active = self._scenes[run], self._runs.index(run), play.state.active
        count = 1 - (-period // self._every)
        rows, following = self._sums[:count, :, column], self._following[:count, column].copy()
        if count > 1:
            rows[-1], following[-1] = self._sum(active)[:, index], _count_following(active)[index]
            if deflection := play.state.deflection:
                self._rises[count - 1, column] = deflection.rise[index]
        # Contiguous, since they are read many times.
        total, x, y, height, strongest = np.ascontiguousarray(rows.T)
        first, last = self._first[:, column], play.state.row(0)[:, index]
        sums = CellSums(total, x, y, height, strongest, following, first, last)
        grid, time = play.batch.grid, scene.simulation.control_period
        same = tuple(finger.trajectory for finger in scene.fingers), time, count, period
        if same not in self._ways:
            moments = np.minimum(np.arange(count) * self._every, period) * time
            tip = play.trajectories[run].poses(moments)
            points = np.unique(tip[:, :2], axis=0)
            near = [np.argmin((grid.x - x) ** 2 + (grid.y - y) ** 2) for x, y in points]
            self._ways[same] = moments, tip, np.unique(near)
        moments, tip, cells = self._ways[same]
        if play.state.deflection:
            tip = tip.copy()
            tip[:, 2] += self._rises[:count, column]
        metrics = {
            **compute_metrics_from_sums(sums, moments, tip, grid.positions, scene.set_point, cells),
            **measure_losses(
                scene, play.batch.systems[index].fastest, moments, [(total, tip[:, 2])]
            ),
        }
        return report(scene, now.ended(index), metrics)

    def _sum(self, active: ActiveSet) -> Floats:
        """Return the numbers of a row of `CellSums`, total to strongest, shape (5, b)."""
        near = slice(active.near)
        x, y = (along[near] for along in active.quadratic_basis[1:3])
        return sum_row(active.block[self._force, near], x, y, active.block[0, near])


def _count_following(active: ActiveSet) -> NDArray[np.intp]:
    """Return how many cells of each run follow the force, shape (b,)."""
    return np.count_nonzero(active.mode == FORCE_FOLLOW, axis=0)


Outcome = Result | DigiclayError


@dataclass(frozen=True, eq=False)
class Monitor:
    """References that follow the runs through every control period; see `accuracy.ErrorMonitor`."""

    play: Play
    """The references."""
    largest: Floats
    """(3, b): From `accuracy.compare`, so far."""


def _start(scenes: Mapping[int, Scene]) -> Monitor:
    """Return the monitor of runs before their first control period."""
    references = {run: make_reference(scene) for run, scene in scenes.items()}
    systems = {run: assemble(scene) for run, scene in references.items()}
    return Monitor(begin_play(references, systems), np.zeros((3, len(scenes))))


def _follow(monitor: Monitor, leader: Play) -> Monitor:
    """Integrate the last control period of the runs again."""
    play, largest = monitor.play, monitor.largest
    if leader.runs != play.runs:
        largest = largest[:, [play.runs.index(run) for run in leader.runs]]
        play = keep_runs(play, leader.runs)
    play = locate_fingers(play)
    play = replace(play, state=repeat_period(play.batch, play.state, play.finger, leader.state))
    force, blocks = play.batch.rows.force, (play.state.active.block, leader.state.active.block)
    near = slice(play.state.active.near)
    differences = compare(*(rows for block in blocks for rows in (block[0], block[force, near])))
    return Monitor(play, np.maximum(largest, differences))


def _refuse_unlike(scenes: Mapping[int, Scene], systems: Mapping[int, System]) -> None:
    """Refuse scenes that are not of one structure."""
    structures = {run: describe_structure(scene, systems[run]) for run, scene in scenes.items()}
    first, wanted = next(iter(structures.items()))
    for run, structure in structures.items():
        if structure != wanted:
            rule = "must have the bed, the parts and the steps of each other (structure.describe_structure)"
            raise ParameterError("Batch", "scenes", rule, f"number {run} unlike number {first}")


def _run(
    scenes: Sequence[Scene],
    observer: type[Histories | Sums],
    stopped: Callable[[], bool] | None,
    *,
    errors: bool = False,
) -> Iterator[tuple[int, Outcome]]:
    """Yield the number of each scene at its end, and its result by an observer."""
    systems: dict[int, System] = {}
    for number, scene in enumerate(scenes):
        try:
            system = assemble(scene)
            check_memory(scene, system.rows)
            systems[number] = system
        except DigiclayError as error:
            yield number, error
    if not systems:
        return
    running = {run: scenes[run] for run in systems}
    _refuse_unlike(running, systems)
    play = begin_play(running, systems)
    watching = observer(running, scenes[0].recorder, play)
    absent = explain_absence(scenes[0])
    monitor = _start(running) if errors and not absent else None
    for now in play_all(play, {run: scene.periods for run, scene in running.items()}, stopped):
        watching.observe(now)
        monitor = monitor and _follow(monitor, now.play)
        for index in np.flatnonzero(now.over).tolist():
            run = now.play.runs[index]
            if now.failed[index]:
                yield run, make_divergence_error(now.play.batch, now.play.state, index)
                continue
            result = watching.finish(now, index)
            if monitor:
                result = result.with_errors(Errors.estimate(monitor.largest[:, index]))
            elif errors:
                result = result.without_errors(absent)
            yield run, result


def run_together(
    scenes: Sequence[Scene], *, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Run scenes from rest to their ends, all together.

    Each scene has one finger, and all have one structure, see `structure.describe_structure`.
    `stopped` is called after each control period; if it returns True, unfinished runs are dropped.
    Yields the number of a scene at its end, and the result or error of `run_scene.run`, whose run
    time is a share, see `play.Instant`.
    """
    return _run(scenes, Histories, stopped)


def measure_together(
    scenes: Sequence[Scene], *, errors: bool = False, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Run scenes as `run_together`, and measure them without storing their histories.

    The metrics are the same as with a history. `errors`: whether errors are estimated; the
    references, see `accuracy.make_reference`, must then have one structure as well.
    """
    return _run(scenes, Sums, stopped, errors=errors)
