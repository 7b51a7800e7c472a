"""Histories of a batch, or the few sums of each row that all metrics need."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.modes import Mode
from ..engine.state import ActiveSet
from ..metrics.finger_path import CellSums
from ..metrics.summary import compute_metrics_from_sums
from ..scene.recorder import HistoryWriter, Recorder, Recording, Stretch
from ..scene.schema import Scene
from ..session.run_result import Result, evaluate, report
from .finger_paths import SampledPath, make_path
from .play import Instant, Play

#: A plain number: numpy compares with it ten times as fast.
FORCE_FOLLOW = np.int8(Mode.FORCE_FOLLOW)


class Histories:
    """Histories of runs: stretches are kept, and written into a history when it is asked for.

    A history of all cells of all runs would fill the memory long before the batch is large enough.

    Parameters
    ----------
    scenes : mapping of int to Scene
        By the numbers of their runs.
    recorder : Recorder or None
        Theirs; None: there are no histories.
    play : Play
        Before the sessions.
    """

    def __init__(self, scenes: Mapping[int, Scene], recorder: Recorder | None, play: Play) -> None:
        self._scenes, self._runs, self._present = scenes, play.runs, play.runs
        self._first, self._mode = play.state.row(0), play.state.mode()
        self._stretches: dict[int, list[Stretch]] = {run: [] for run in play.runs}
        self._recording = Recording(recorder, play.batch.rows, self._store) if recorder else None
        self._history: HistoryWriter | None = None

    def _store(self, stretch: Stretch) -> None:
        """Keep a stretch of the runs that are present."""
        for run, own in zip(self._present, stretch.split(), strict=True):
            self._stretches[run].append(own)

    def observe(self, now: Instant) -> None:
        """Record a control period."""
        if self._recording is None:
            return
        if now.play.runs is not self._present:
            self._recording.flush()
            self._present = now.play.runs
        self._recording.observe(now.play.state)

    def finish(self, now: Instant, index: int) -> Result:
        """Return the result of a run; its history is valid until that of another run is requested.

        New memory for every run would take longer than all that is written into it.

        `now`: in which it has come to its end; `index`: where on the last axis the run is.
        """
        run = now.play.runs[index]
        rows = self._write(self._recording, run, now.play.state.period) if self._recording else {}
        return evaluate(self._scenes[run], now.play.systems[run], rows, now.ended(index))

    def _write(self, recording: Recording, run: int, period: int) -> dict[str, NDArray[Any]]:
        """Write the history of a run up to a period; return its rows."""
        recording.flush()
        count, column = 1 - (-period // recording.every), self._runs.index(run)
        if self._history is None or self._history.count < count:
            self._history = HistoryWriter(count, len(self._first))
        self._history.begin(self._first[:, column], self._mode[:, column])
        for stretch in self._stretches.pop(run):
            self._history.write(stretch)
        return self._history.finish(period, recording.every)


class Sums:
    """Sums what the metrics of runs need over their cells, row by row; there are no histories.

    Parameters
    ----------
    scenes : mapping of int to Scene
        By the numbers of their runs.
    recorder : Recorder or None
        Theirs; None: one row a control period.
    play : Play
        Before the sessions.
    """

    def __init__(self, scenes: Mapping[int, Scene], recorder: Recorder | None, play: Play) -> None:
        recorder = recorder or Recorder()
        count = recorder.rows(max(scene.periods for scene in scenes.values()))
        self._scenes, self._every, self._force = scenes, recorder.every, play.batch.rows.force
        self._runs, self._present, self._columns = play.runs, play.runs, list(range(len(play.runs)))
        self._first = play.state.row(0)
        self._sums = np.zeros((count, 5, len(play.runs)))
        self._following = np.zeros((count, len(play.runs)), np.intp)
        self._ways: dict[Any, SampledPath] = {}

    def observe(self, now: Instant) -> None:
        """Sum a control period up."""
        if now.play.runs is not self._present:
            self._present = now.play.runs
            self._columns = [self._runs.index(run) for run in self._present]
        held, period = now.play.state.active, now.play.state.period
        if (period - 1) % self._every == 0:
            self._following[(period - 1) // self._every, self._columns] = _count_following(held)
        if period % self._every == 0:
            self._sums[period // self._every, :, self._columns] = self._sum(held).T

    def finish(self, now: Instant, index: int) -> Result:
        """Return the result of a run, without a history.

        `now`: in which it has come to its end; `index`: where on the last axis the run is.
        """
        play, run, period = now.play, now.play.runs[index], now.play.state.period
        scene, column, held = self._scenes[run], self._runs.index(run), play.state.active
        count = 1 - (-period // self._every)
        rows, following = self._sums[:count, :, column], self._following[:count, column].copy()
        if count > 1:
            rows[-1], following[-1] = self._sum(held)[:, index], _count_following(held)[index]
        # In one piece each: they are gone through many times.
        total, x, y, height, strongest = np.ascontiguousarray(rows.T)
        first, last = self._first[:, column], play.state.row(0)[:, index]
        sums = CellSums(total, x, y, height, strongest, following, first, last)
        grid, time = play.systems[run].grid, scene.simulation.control_period
        same = tuple(finger.trajectory for finger in scene.fingers), time, count, period
        if same not in self._ways:
            moments = np.minimum(np.arange(count) * self._every, period) * time
            self._ways[same] = make_path(grid, play.ways[run], moments)
        way = self._ways[same]
        found = compute_metrics_from_sums(
            sums, way.time, way.fingertip, grid.positions, scene.set_point, way.cells
        )
        return report(scene, now.ended(index), found)

    def _sum(self, held: ActiveSet) -> Floats:
        """Return the numbers of a row of `CellSums`, total to strongest, shape (5, b)."""
        force = held.block[self._force, : held.near]
        sums = np.empty((5, force.shape[1]))
        np.add.reduce(force, out=sums[0])
        for values, found in zip((*held.quadratic_basis[1:3], held.block[0]), sums[1:4], strict=True):
            np.einsum("kb,kb->b", values[: held.near], force, out=found)
        np.maximum.reduce(force, out=sums[4], initial=0.0)
        return sums


def _count_following(held: ActiveSet) -> NDArray[np.intp]:
    """Return how many cells of each run follow the force, shape (b,)."""
    count: NDArray[np.intp] = np.count_nonzero(held.mode == FORCE_FOLLOW, axis=0)
    return count
