"""State of a batch at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.modes import Mode
from ..engine.state import Rows
from .broadcasting import Floats

__all__ = ["NO_DISC", "Beds", "Cells", "Disc", "Gathered", "at_rest"]

Cells = NDArray[np.intp]
#: A disc of every bed: x, y and radius, (b,) each, m; a radius below 0 means no cells.
Disc = tuple[Floats, Floats, Floats]
NO_DISC: Disc = (np.zeros(1), np.zeros(1), np.full(1, -1.0))


@dataclass(frozen=True, eq=False)
class Gathered:
    """The cells that take part, w in each run.

    Where fewer take part than in another run, others make up the number. They could as well be
    left out, so it does no harm that they are not.

    Attributes
    ----------
    cells : ndarray of int (w, b)
        Numbers in their own beds.
    near : int
        The first k of every run are those the finger may touch.
    block : ndarray (r, w, b)
        Their rows, see `state.Rows`.
    mode : ndarray (w, b) of int8
    place : ndarray (6, w, b)
        1, x, y, x², x y, y², see `state.Gathered`.
    reach, control : Disc
        Cells of these parts of the beds are in: the fingers', and the controllers'.
    peak : ndarray (b,)
        No pin top is higher while this set is in use, m.
    until : int
        Control period by which the set is to be made anew.
    """

    cells: Cells
    near: int
    block: Floats
    mode: NDArray[np.int8]
    place: Floats
    reach: Disc
    control: Disc
    peak: Floats
    until: int

    @property
    def flat(self) -> Cells:
        """Numbers of the cells among all cells of all beds, shape (w, b)."""
        runs = self.cells.shape[1]
        return self.cells * runs + np.arange(runs)

    @cached_property
    def ready(self) -> dict[Any, Any]:
        """What moves just these cells, by the stepper's plan; made when first needed."""
        return {}


@dataclass(frozen=True, eq=False)
class Beds:
    """The sessions at the start of a control period; the fields are those of `state.State`.

    Attributes
    ----------
    period : int
    rows : ndarray (r, n, b)
    modes : ndarray (n, b) of int8
    aged : ndarray (n, b)
        s.
    gathered : Gathered
    memory : object
        The controllers' memories.
    """

    period: int
    rows: Floats
    modes: NDArray[np.int8]
    aged: Floats
    gathered: Gathered
    memory: Any

    def row(self, index: int) -> Floats:
        """Return one row of all cells, shape (n, b), as a new array."""
        values: Floats = self.rows[index].copy()
        values.reshape(-1)[self.gathered.flat] = self.gathered.block[index]
        return values

    def mode(self) -> NDArray[np.int8]:
        """Return the control modes of all cells, shape (n, b), as a new array."""
        values = self.modes.copy()
        values.reshape(-1)[self.gathered.flat] = self.gathered.mode
        return values


def at_rest(rows: Rows, count: int, heights: Floats, memory: Any) -> Beds:
    """Return the beds before the sessions: every valve shut, every pin of a run at one height (b,), m.

    Parameters
    ----------
    rows : Rows
    count : int
        Cells of a bed.
    heights : ndarray (b,)
        m.
    memory : object
        Of the controllers.
    """
    runs = heights.size
    values = np.zeros((rows.count, count, runs))
    values[0] = values[rows.target] = heights
    none = Gathered(
        np.empty((0, runs), np.intp),
        0,
        np.empty((rows.count, 0, runs)),
        np.empty((0, runs), np.int8),
        np.empty((6, 0, runs)),
        NO_DISC,
        NO_DISC,
        heights,
        0,
    )
    return Beds(0, values, np.full((count, runs), Mode.REST, np.int8), np.zeros((count, runs)), none, memory)
