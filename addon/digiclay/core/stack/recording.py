"""What many sessions leave behind: histories, or only what the metrics take of them.

A history of all cells of all runs would fill the memory long before the stack is large enough: only the
cells that take part are kept, until a history is asked for. The metrics need a few sums a row.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..layout import Grid
from ..metrics import BAND, cell_area, contact_loss_share, first_touch, in_contact, rfd
from ..metrics_path import ridge_errors
from ..metrics_signal import deviation, mean, overshoot, settling_time, weights
from ..modes import Mode
from ..recorder import Recorder
from ..state import Rows
from .beds import Beds, Gathered
from .columns import Floats
from .fingers import Way
from .gathering import KEPT

__all__ = ["StackRecording", "StackTraces", "Trace", "summary"]

#: A plain number: numpy compares with it ten times as fast.
FORCE_FOLLOW = np.int8(Mode.FORCE_FOLLOW)


@dataclass(eq=False)
class _Stretch:
    """The rows of the periods in which the same cells take part.

    Attributes
    ----------
    runs : tuple of int
        Whose the first axis is.
    held : Gathered
        Of which only cells and number of the near ones are still true later on.
    height, command, mode : ndarray (b, t, w)
    force : ndarray (b, t, k)
    instants, starts : list of int
        Which rows of a history height and force, and command and mode, are.
    """

    runs: tuple[int, ...]
    held: Gathered
    height: Floats
    command: Floats
    mode: NDArray[np.int8]
    force: Floats
    instants: list[int] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)


class StackRecording:
    """The rows of many sessions; see `recorder.Recording` for what they mean.

    Parameters
    ----------
    recorder : Recorder
    rows : Rows
        Which row of the state holds what.
    state : Beds
        Before the sessions.
    runs : tuple of int
        Whose its last axis is.
    """

    def __init__(self, recorder: Recorder, rows: Rows, state: Beds, runs: tuple[int, ...]) -> None:
        self._every, self._rows = recorder.every, rows
        self._first, self._mode, self._runs = state.row(0), state.mode(), runs
        self._stretches: list[_Stretch] = []
        self._room: dict[str, NDArray[Any]] = {}

    def observe(self, state: Beds, runs: tuple[int, ...]) -> None:
        """Take in the beds after a control period; `runs` says whose the last axis is."""
        held, started = state.gathered, state.period - 1
        if not self._stretches or self._stretches[-1].held is not held:
            self._stretches.append(_stretch(held, runs))
        now = self._stretches[-1]
        if started % self._every == 0:
            now.command[:, len(now.starts)] = held.block[self._rows.command].T
            now.mode[:, len(now.starts)] = held.mode.T
            now.starts.append(started // self._every)
        if state.period % self._every == 0:
            now.height[:, len(now.instants)] = held.block[0].T
            now.force[:, len(now.instants)] = held.block[self._rows.force, : held.near].T
            now.instants.append(state.period // self._every)

    def arrays(self, run: int, state: Beds, place: int) -> dict[str, NDArray[Any]]:
        """Return the rows of a run: period (t,), height, force, command, mode (t, n).

        They are valid until those of another run are asked for: new memory for every run would take
        longer than all that is written into it.

        Parameters
        ----------
        run : int
        state : Beds
            In which the run ended.
        place : int
            Where on the last axis the run is.
        """
        end, force = state.period, self._rows.force
        count, cells = 1 - (-end // self._every), len(self._first)
        if not self._room or len(self._room["mode"]) < count:
            self._room = {name: np.empty((count, cells)) for name in ("height", "force", "command")}
            self._room["mode"] = np.empty((count, cells), np.int8)
        rows = {name: room[:count] for name, room in self._room.items()}
        rows["force"][:] = rows["command"][:] = 0.0
        rows["period"] = np.minimum(np.arange(count) * self._every, end)
        column = self._runs.index(run)
        rows["height"][0], rows["mode"][0] = self._first[:, column], self._mode[:, column]
        for part in self._stretches:
            if run in part.runs:
                _unfold(part, part.runs.index(run), rows)
        rows["height"][-1], rows["force"][-1] = state.row(0)[:, place], state.row(force)[:, place]
        if count > 1:
            rows["mode"][-1] = rows["mode"][-2]
        return rows


def _stretch(held: Gathered, runs: tuple[int, ...]) -> _Stretch:
    """Make room for as many rows as a set of cells is used for."""
    cells, several = held.cells.shape
    wide, narrow = (several, KEPT, cells), (several, KEPT, held.near)
    return _Stretch(runs, held, np.empty(wide), np.empty(wide), np.empty(wide, np.int8), np.empty(narrow))


def _unfold(part: _Stretch, place: int, rows: dict[str, NDArray[Any]]) -> None:
    """Write the rows of a stretch into a history; a cell that takes no part stays as it was."""
    cells, near = part.held.cells[:, place], part.held.near
    for names, numbers in ((("height", "force"), part.instants), (("mode", "command"), part.starts)):
        if not numbers:
            continue
        first, last = numbers[0], numbers[-1] + 1
        kept, loose = names
        rows[kept][first:last] = rows[kept][max(first - 1, 0)]
        for name, chosen in ((kept, cells), (loose, cells[:near] if loose == "force" else cells)):
            rows[name][first:last, chosen] = getattr(part, name)[place, : last - first]


@dataclass(frozen=True, eq=False)
class Trace:
    """What the metrics take of a run's t rows of n cells.

    Attributes
    ----------
    period : ndarray of int (t,)
    total : ndarray (t,)
        Total force, N.
    x, y, height : ndarray (t,)
        Sums over the cells of the force times place, and times height, N m.
    strongest : ndarray (t,)
        Largest force on a cell, N.
    following : ndarray of bool (t,)
        Whether some cell follows the force.
    first, last : ndarray (n,)
        Heights in the first and in the last row, m.
    """

    period: NDArray[np.intp]
    total: Floats
    x: Floats
    y: Floats
    height: Floats
    strongest: Floats
    following: NDArray[np.bool_]
    first: Floats
    last: Floats


class StackTraces:
    """The traces of many sessions.

    Parameters
    ----------
    recorder, rows, state, runs
        See `StackRecording`.
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
        self._following = np.zeros((count, len(runs)), np.bool_)
        self._present, self._columns = runs, list(range(len(runs)))

    def observe(self, state: Beds, runs: tuple[int, ...]) -> None:
        """Take in the beds after a control period; `runs` says whose the last axis is."""
        if runs is not self._present:
            self._present, self._columns = runs, [self._runs.index(run) for run in runs]
        held, started = state.gathered, state.period - 1
        if started % self._every == 0:
            self._following[started // self._every, self._columns] = (held.mode == FORCE_FOLLOW).any(axis=0)
        if state.period % self._every == 0:
            self._felt[state.period // self._every, :, self._columns] = _felt(held, self._rows).T

    def of(self, run: int, state: Beds, place: int) -> Trace:
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
        return Trace(period, total, x, y, height, strongest, following.copy(), first, last)


def _felt(held: Gathered, rows: Rows) -> Floats:
    """Return the numbers of a row of `Trace`, total to strongest, shape (5, b)."""
    force = held.block[rows.force, : held.near]
    felt = np.empty((5, force.shape[1]))
    np.add.reduce(force, out=felt[0])
    for values, found in zip((*held.place[1:3], held.block[0]), felt[1:4], strict=True):
        np.einsum("kb,kb->b", values[: held.near], force, out=found)
    np.maximum.reduce(force, out=felt[4], initial=0.0)
    return felt


def summary(trace: Trace, way: Way, grid: Grid, set_point: float) -> dict[str, float | None]:
    """Return what `metrics.summary` makes of the history that a trace is of.

    Parameters
    ----------
    trace : Trace
    way : Way
        The finger's, at the times of the trace's rows.
    grid : Grid
    set_point : float
        Force the finger should feel, N.
    """
    time, total, weight = way.time, trace.total, weights(way.time)
    felt, formed, area = in_contact(total), trace.last - trace.first, cell_area(grid.positions)
    place = np.column_stack([trace.x, trace.y])[felt] / total[felt, None]
    behind = np.round(np.hypot(*(way.fingertip[felt, :2] - place).T), 12)
    above = trace.height[felt] / total[felt] - way.fingertip[felt, 2]
    rows, first = felt & trace.following, first_touch(total)
    ridge = ridge_errors(grid.positions[way.cells], trace.last[way.cells], way.fingertip, rows)
    each = np.ones(len(ridge))
    beyond = settled = None
    if first.stop > first.start:
        beyond = overshoot(np.concatenate([[0.0], total[first]]), set_point)
        settled = settling_time(time[first], total[first], set_point, BAND * set_point)
    found: dict[str, float | None] = {
        "duration": float(time[-1] - time[0]),
        "set_point": set_point,
        "rfd": rfd(time, total, set_point),
        "rfd_shaping": rfd(time, total, set_point, rows),
        "rfd_session": rfd(time, total, set_point, np.ones(len(time), dtype=bool)),
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
    return {
        name: value if value is not None and np.isfinite(value) else None for name, value in found.items()
    }
