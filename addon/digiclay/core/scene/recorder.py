"""Recorder of a session: the arrays of ``history.npz``."""

from __future__ import annotations

import os
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..engine.state import Rows, State

__all__ = ["Recorder", "Recording", "available_memory", "bytes_needed", "refuse_what_cannot_fit", "write"]

Floats = NDArray[np.float64]

#: Bytes one row takes for one cell: height, force and command as float64, mode as int8; and one while the
#: metrics are computed, of which rows a cell follows the force in.
BYTES_A_CELL = 3 * 8 + 1 + 1
#: Bytes a cell takes besides its state's rows: position (2 float64), age (float64), mode (int8).
BYTES_BESIDE = 2 * 8 + 8 + 1
#: Bytes a cell of a recorded session takes while the metrics are computed, however many rows there are; and
#: those a cell that takes part takes in a control period, and for its rows that wait (measured: about three
#: times what they are, `CHUNK` rows of 25 bytes).
BYTES_JUDGED, BYTES_BUSY, BYTES_WAITING = 100, 850, 3 * 25 * 64
#: Bytes of memory assumed where the system does not tell.
ASSUMED_MEMORY = 8 * 2**30
#: Most rows that wait to be written together.
CHUNK = 64


@dataclass(frozen=True)
class Recorder(Parameters):
    """Recording interval, in control periods."""

    every: int = quantity(1, "control periods per row of the history", at_least=1)

    def rows(self, periods: int) -> int:
        """Return the number of rows of a session of so many control periods."""
        return 1 + -(-periods // self.every)


class Recording:
    """Rows of one session, preallocated.

    Row i is the state at ``time[i]``; ``command[i]`` and ``mode[i]`` are those given in the
    control period that starts then. Nothing is commanded after the last row: its command is
    0, and its mode that of the period before.

    Parameters
    ----------
    recorder : Recorder
    rows : Rows
        Which row of the state holds what.
    state : State
        Before the session.
    periods : int
        Control periods the session may have.
    """

    def __init__(self, recorder: Recorder, rows: Rows, state: State, periods: int) -> None:
        count, cells = recorder.rows(periods), state.rows.shape[1]
        self._every, self._rows, self._last = recorder.every, rows, periods
        # Not filled: numpy gives memory that is to be filled later in large pages, of which the first
        # touch costs a quarter.
        self._period = np.empty(count, np.int64)
        self._height, self._force, self._command = np.empty((3, count, cells))
        self._mode = np.empty((count, cells), np.int8)
        self._done, self._begun = 0, 0
        self._state = state
        self._felt: list[Floats] = []
        self._given: list[tuple[Floats, NDArray[np.int8]]] = []
        self._keep(0, state)

    def observe(self, state: State) -> None:
        """Take in the state after a control period."""
        held, last = state.gathered, self._state
        if held.cells is not last.gathered.cells or state.rows is not last.rows or len(self._given) >= CHUNK:
            self._flush()
        self._state = state
        if (state.period - 1) % self._every == 0:
            self._given.append((held.block[self._rows.command].copy(), held.mode.copy()))
        if state.period % self._every == 0 or state.period == self._last:
            self._felt.append(held.block.take((0, self._rows.force), axis=0))
            self._period[self._done + len(self._felt)] = state.period

    def finish(self, state: State) -> None:
        """Keep the state the session ended in; one that was cut short ends between two rows."""
        self._flush()
        if self._period[self._done] != state.period:
            self._keep(self._done + 1, state)
        self._mode[self._done] = state.mode()

    def _keep(self, row: int, state: State) -> None:
        """Copy what belongs to an instant into a row."""
        self._height[row], self._force[row] = state.row(0), state.row(self._rows.force)
        self._command[row], self._mode[row] = 0.0, state.mode()
        self._period[row], self._done = state.period, row

    def _flush(self) -> None:
        """Write the rows that wait: all of the same gathered cells, so they are written together.

        The cells that are not gathered have not changed meanwhile. Those that were may have been put
        back since, but of them there are rows.
        """
        state, cells = self._state, self._state.gathered.cells
        if self._felt:
            rows = slice(self._done + 1, self._done + 1 + len(self._felt))
            felt = np.array(self._felt)
            for array, index, values in (
                (self._height, 0, felt[:, 0]),
                (self._force, self._rows.force, felt[:, 1]),
            ):
                array[rows] = state.rows[index]
                array[rows, cells] = values
            self._done += len(self._felt)
            self._command[self._done], self._mode[self._done] = 0.0, 0
        if self._given:
            rows = slice(self._begun, self._begun + len(self._given))
            commands, modes = zip(*self._given, strict=True)
            self._command[rows], self._mode[rows] = state.rows[self._rows.command], state.modes
            self._command[rows, cells], self._mode[rows, cells] = np.array(commands), np.array(modes)
            self._begun += len(self._given)
        self._felt, self._given = [], []

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the rows so far, without the finger: period (t,), height, force, command, mode (t, n)."""
        self._flush()
        rows = slice(0, self._done + 1)
        names = ("period", "height", "force", "command", "mode")
        return {name: getattr(self, f"_{name}")[rows] for name in names}


def bytes_needed(recorder: Recorder | None, rows: Rows, cells: int, periods: int, busy: int = 0) -> int:
    """Return about how much memory a session takes; tests/unit/test_memory.py compares what it does take.

    Parameters
    ----------
    recorder : Recorder or None
    rows : Rows
        Of the state.
    cells, periods : int
    busy : int, optional
        Cells that may take part at once, where they are more than those under a finger.
    """
    held = 8 * rows.count + BYTES_BESIDE
    at_work = BYTES_BUSY
    if recorder is not None:
        held += recorder.rows(periods) * BYTES_A_CELL + BYTES_JUDGED
        at_work += BYTES_WAITING
    return cells * held + busy * at_work


def available_memory() -> int:
    """Return how many bytes this machine can still give."""
    linux = Path("/proc/meminfo")
    told = (
        re.search(r"MemAvailable:\s+(\d+) kB", linux.read_text(encoding="ascii")) if linux.exists() else None
    )
    if told:
        return int(told[1]) * 1024
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return ASSUMED_MEMORY


def refuse_what_cannot_fit(
    recorder: Recorder | None, rows: Rows, cells: int, periods: int, available: int, busy: int = 0
) -> None:
    """Refuse, before it starts, a session that `available` bytes cannot hold; see `bytes_needed`.

    Raises
    ------
    ParameterError
        With the numbers, and what to change.
    """
    needed = bytes_needed(recorder, rows, cells, periods, busy)
    if needed <= available:
        return
    memory = f"{available / 1e9:.3g} GB of free memory"
    alone = bytes_needed(None, rows, cells, periods, busy)
    begun = needed - (recorder.rows(periods) * BYTES_A_CELL * cells if recorder else 0)
    spare = (available - begun) // (cells * BYTES_A_CELL)
    if recorder is None or spare < 2:
        rule = f"must be few enough for {memory}"
        raise ParameterError("layout", "rows * columns", rule, f"{cells} cells, {alone / 1e9:.3g} GB")
    rule = f"must be at least {-(-periods // (spare - 1))} for the history to fit into {memory}"
    value = f"{recorder.every}: {recorder.rows(periods)} rows of {cells} cells are {needed / 1e9:.3g} GB"
    raise ParameterError("recorder", "every", rule, value)


def write(history: dict[str, NDArray[Any]], path: Path) -> None:
    """Write a history as an npz file that ``numpy.load`` reads.

    Deflated at the quickest level, because a row repeats most of the one before. The paper's
    session, 83 MB: 0.08 s and 83 MB plain, 0.26 s and 10 MB so, 0.48 s and 9.6 MB at the
    default level.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in history.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.ascontiguousarray(array), allow_pickle=False)  # type: ignore[no-untyped-call]
