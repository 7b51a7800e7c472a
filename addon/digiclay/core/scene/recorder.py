"""Recorder of a session or of many at once: the arrays of ``history.npz``."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Array, Flags, Floats, Modes
from ..base.quantity import Parameters, quantity
from ..engine.state import ActiveSet, Rows, State

#: Most rows that are written together.
CHUNK = 64


@dataclass(frozen=True, eq=False, repr=False)
class Recorder(Parameters):
    """Recording interval, in control periods."""

    every: int = quantity(1, "control periods per row of the history", at_least=1)

    def rows(self, periods: int) -> int:
        """Return the number of rows of a session of a number of control periods."""
        return 1 + -(-periods // self.every)


class Stretch(NamedTuple):
    """Rows of periods with the same w active cells, of one run or, in another last axis, of b runs."""

    cells: NDArray[np.intp]
    """(w,)."""
    felt: Floats
    """(t, r, w): Heights, forces and those of each body in t rows."""
    command: Floats
    mode: Modes
    """(s, w): Commands and modes of the periods that begin with s rows."""
    last: Floats
    last_mode: Modes
    """(r, w) and (w,): Heights and forces, and modes, after the last period."""

    def split(self) -> list[Stretch]:
        """Return the stretches of b runs, each in its own memory."""
        by_run = [np.ascontiguousarray(np.moveaxis(array, -1, 0)) for array in self]
        return [Stretch(*arrays) for arrays in zip(*by_run, strict=True)]


class Recording:
    """Collects rows from states, and passes them to `keep` in stretches, in their order."""

    def __init__(
        self, recorder: Recorder, rows: Rows, keep: Callable[[Stretch], None], bodies: int = 0
    ) -> None:
        self.every = recorder.every
        self._command = rows.command
        self._felt_rows = (0, rows.force, *range(rows.count - bodies, rows.count))
        self._keep = keep
        self._active: ActiveSet | None = None
        self._felt: list[Floats] = []
        self._given: list[tuple[Floats, Modes]] = []

    def observe(self, state: State) -> None:
        """Record the state after a control period."""
        active = state.active
        if active is not self._active or len(self._given) >= CHUNK:
            self.flush()
        self._active = active
        if (state.period - 1) % self.every == 0:
            self._given.append((active.block[self._command].copy(), active.mode.copy()))
        if state.period % self.every == 0:
            self._felt.append(active.block.take(self._felt_rows, axis=0))

    def flush(self) -> None:
        """Pass on the collected rows; a former set of cells is still as its last period left it."""
        active = self._active
        if active is None:
            return
        shape, given = active.cells.shape, self._given
        felt = np.array(self._felt).reshape(len(self._felt), len(self._felt_rows), *shape)
        command = np.array([command for command, _ in given]).reshape(len(given), *shape)
        mode = np.array([mode for _, mode in given], np.int8).reshape(len(given), *shape)
        last = active.block.take(self._felt_rows, axis=0)
        self._keep(Stretch(active.cells, felt, command, mode, last, active.mode.copy()))
        self._active, self._felt, self._given = None, [], []


class HistoryWriter:
    """Rows of one session, with forces of `bodies`, preallocated for at most `count` of them.

    Row i is the state at its time; its command and mode are those of the control period that
    begins then. No period follows the last row: its command is 0, and its mode that of the
    previous period.
    """

    def __init__(self, count: int, cells: int, bodies: int = 0) -> None:
        self.count = count
        # Uninitialized: numpy then gets memory in large pages, which cost a quarter at their first
        # use.
        self._felt = np.empty((2 + bodies, count, cells))
        self._command = np.empty((count, cells))
        self._mode = np.empty((count, cells), np.int8)
        self._now, self._mode_now = np.zeros((2 + bodies, cells)), np.empty(cells, np.int8)
        self._done = self._given = 0

    def begin(self, height: Floats, mode: Modes) -> None:
        """Begin again with heights and modes (n,) before a session, without forces."""
        self._now[0], self._now[1:], self._mode_now[:] = height, 0.0, mode
        self._felt[:, 0] = self._now
        self._done, self._given = 1, 0

    def write(self, stretch: Stretch) -> None:
        """Write the next stretch of the session; an idle cell keeps its values."""
        cells, felt = stretch.cells, slice(self._done, self._done + len(stretch.felt))
        self._felt[:, felt] = self._now[:, None]
        self._felt[:, felt, cells] = stretch.felt.swapaxes(0, 1)
        given = slice(self._given, self._given + len(stretch.mode))
        self._command[given], self._mode[given] = 0.0, self._mode_now
        self._command[given, cells], self._mode[given, cells] = stretch.command, stretch.mode
        self._now[:, cells], self._mode_now[cells] = stretch.last, stretch.last_mode
        self._done, self._given = felt.stop, given.stop

    def age(self, height: Floats) -> None:
        """Replace the heights of idle cells by those of all, (n,), m."""
        self._now[0] = height

    def finish(self, period: int, every: int) -> dict[str, Array]:
        """Return the rows, valid until `begin`: period (t,), height, force, command, mode (t, n).

        Of bodies also their force, (t, b, n). A session that ends between two rows, of `every`
        periods each, gets another one.
        """
        count = 1 - (-period // every)
        self._felt[:, count - 1] = self._now
        self._command[count - 1], self._mode[count - 1] = 0.0, self._mode_now
        height, force, *bodies = self._felt[:, :count]
        rows = {
            "period": np.minimum(np.arange(count) * every, period),
            "height": height,
            "force": force,
            "command": self._command[:count],
            "mode": self._mode[:count],
        }
        if bodies:
            rows["body_force"] = np.stack(bodies, axis=1)
        return rows


class RunRecording(Recording):
    """Recording of one run of at most `periods`, which writes its history at the same time."""

    def __init__(
        self, recorder: Recorder, rows: Rows, state: State, periods: int, bodies: int = 0
    ) -> None:
        self._history = HistoryWriter(recorder.rows(periods), state.rows.shape[1], bodies)
        self._history.begin(state.row(0), state.mode())
        super().__init__(recorder, rows, self._history.write, bodies)
        self._fingers = [_read_fingers(state)]
        self._addressed: list[dict[str, Flags]] = []
        self._last = state

    def observe(self, state: State) -> None:
        """Record the state after a control period."""
        renewed = state.active is not self._last.active
        super().observe(state)
        if renewed and state.addressing is not None:
            self._history.age(state.row(0))
        self._last = state
        if state.addressing and (state.period - 1) % self.every == 0:
            served, waiting = state.addressing.served, state.waiting()
            self._addressed.append({"served": served, "waiting": waiting})
        if state.period % self.every == 0:
            self._fingers.append(_read_fingers(state))

    def finish(self, period: int) -> dict[str, Array]:
        """Return the rows up to the last period of the session, see `HistoryWriter.finish`."""
        self.flush()
        rows = self._history.finish(period, self.every)
        last = _read_fingers(self._last)
        each = [*self._fingers, last][: len(rows["period"])]
        for name, flags in self._addressed[0].items() if self._addressed else ():
            # No period follows the last row.
            each_period = [addressed[name] for addressed in self._addressed]
            rows[name] = np.array([*each_period, np.zeros_like(flags)])
        return rows | {name: np.array([values[name] for values in each]) for name in last}


def _read_fingers(state: State) -> dict[str, Floats]:
    """Return what a state has of each finger: of several the force, and how far hands give way, m."""
    values = {}
    if state.active.rows.fingers:
        values["finger_force"] = state.finger_forces()
    if state.deflection:
        values["deflection"] = state.deflection.rise
    return values


def write(history: dict[str, Array], path: Path) -> None:
    """Write a history as an npz file that ``numpy.load`` reads.

    Deflated at the fastest level, because a row repeats most of the previous one. The paper's
    session, 83 MB: 0.08 s and 83 MB stored, 0.26 s and 10 MB at this level, 0.48 s and 9.6 MB
    at the default level.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in history.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.ascontiguousarray(array), allow_pickle=False)  # type: ignore[no-untyped-call]
