"""Histories of a batch.

A history of all cells of all runs would fill the memory long before the stack is large enough: only the
cells that take part are kept, until a history is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..engine.state import Rows
from ..scene.recorder import Recorder
from .beds import Beds, Gathered
from .broadcasting import Floats
from .padding import KEPT

__all__ = ["StackRecording"]


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
