"""Traces of a batch: sums of each row for the metrics, without histories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..engine.state import Rows
from ..metrics.finger_path import CellSums
from ..metrics.summary import compute_metrics_from_sums
from ..model.layout import Grid
from ..model.set_point import SetPoint
from ..scene.recorder import Recorder
from .beds import Beds, Gathered
from .broadcasting import Floats
from .fingers import Way

__all__ = ["StackTrace", "StackTraces", "summary"]

#: A plain number: numpy compares with it ten times as fast.
FORCE_FOLLOW = np.int8(Mode.FORCE_FOLLOW)


@dataclass(frozen=True, eq=False)
class StackTrace(CellSums):
    """The trace of a run of a stack, and when its rows are.

    Attributes
    ----------
    period : ndarray of int (t,)
        Control periods done.
    """

    period: NDArray[np.intp]


class StackTraces:
    """The traces of many sessions.

    Parameters
    ----------
    recorder, rows, state, runs
        See `recording.StackRecording`.
    periods : int
        Control periods of the longest session.
    """

    def __init__(
        self, recorder: Recorder, rows: Rows, state: Beds, runs: tuple[int, ...], periods: int
    ) -> None:
        count = recorder.rows(periods)
        self._every, self._rows, self._runs = recorder.every, rows, runs
        self._first = state.row(0)
        self._felt = np.zeros((count, 5, len(runs)))
        self._following = np.zeros((count, len(runs)), np.intp)
        self._present, self._columns = runs, list(range(len(runs)))

    def observe(self, state: Beds, runs: tuple[int, ...]) -> None:
        """Take in the beds after a control period; `runs` says whose the last axis is."""
        if runs is not self._present:
            self._present, self._columns = runs, [self._runs.index(run) for run in runs]
        held, started = state.gathered, state.period - 1
        if started % self._every == 0:
            following = np.count_nonzero(held.mode == FORCE_FOLLOW, axis=0)
            self._following[started // self._every, self._columns] = following
        if state.period % self._every == 0:
            self._felt[state.period // self._every, :, self._columns] = _felt(held, self._rows).T

    def of(self, run: int, state: Beds, place: int) -> StackTrace:
        """Return the trace of a run.

        Parameters
        ----------
        run : int
        state : Beds
            In which the run ended.
        place : int
            Where on the last axis the run is.
        """
        end, column = state.period, self._runs.index(run)
        count = 1 - (-end // self._every)
        felt, following = self._felt[:count, :, column], self._following[:count, column]
        if count > 1:
            felt[-1], following[-1] = _felt(state.gathered, self._rows)[:, place], following[-2]
        period = np.minimum(np.arange(count) * self._every, end)
        # In one piece each: they are gone through many times.
        total, x, y, height, strongest = np.ascontiguousarray(felt.T)
        last, held = state.rows[0, :, place].copy(), state.gathered
        last[held.cells[:, place]] = held.block[0, :, place]
        first = self._first[:, column]
        return StackTrace(total, x, y, height, strongest, following.copy(), first, last, period)


def _felt(held: Gathered, rows: Rows) -> Floats:
    """Return the numbers of a row of `CellSums`, total to strongest, shape (5, b)."""
    force = held.block[rows.force, : held.near]
    felt = np.empty((5, force.shape[1]))
    np.add.reduce(force, out=felt[0])
    for values, found in zip((*held.place[1:3], held.block[0]), felt[1:4], strict=True):
        np.einsum("kb,kb->b", values[: held.near], force, out=found)
    np.maximum.reduce(force, out=felt[4], initial=0.0)
    return felt


def summary(trace: CellSums, way: Way, grid: Grid, set_point: SetPoint | None) -> dict[str, float | None]:
    """Return what `compute_metrics` makes of the history that a trace is of.

    Parameters
    ----------
    trace : CellSums
    way : Way
        The finger's, at the times of the trace's rows.
    grid : Grid
    set_point : SetPoint or None
        Force asked for.
    """
    return compute_metrics_from_sums(trace, way.time, way.fingertip, grid.positions, set_point, way.cells)
