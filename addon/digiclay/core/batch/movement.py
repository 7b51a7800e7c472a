"""Movement of the cells of a batch by a stepper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Floats
from ..model.interfaces import Movement, Stepper

#: Cells moved at a time: as many as stay in a core's cache, and few enough for the matrix products to stay
#: on one core (waking a second one takes longer than the product).
PIECE = 2048
#: Cells of a run out of the finger's reach are moved by so many at a time, or a multiple: workspaces of few
#: sizes serve for any number of them.
GROUP = 8


@dataclass(frozen=True, eq=False)
class BatchStepper:
    """The runs' own stepper, for the cells of many runs; see `interfaces.Stepper`.

    Attributes
    ----------
    stepper : Stepper
    alike : bool
        The cells of all runs are alike, so they are moved as those of one large bed.
    valve : int
        From this row on there is what moves a pin without a finger: its opening and its commands.
    """

    stepper: Stepper
    alike: bool
    valve: int

    def prepare(self, plan: Any, rows: Floats, near: int) -> BatchMovement:
        """Prepare to move one set of cells of all runs; see `interfaces.Stepper`."""
        return BatchMovement(self, plan, rows, near)


class BatchMovement:
    """Moves one set of cells of b runs, period by period.

    Parameters
    ----------
    batch : BatchStepper
    plan, rows, near
        See `interfaces.Stepper.prepare`.
    """

    def __init__(self, batch: BatchStepper, plan: Any, rows: Floats, near: int) -> None:
        self._stepper, self._plan, self._alike = stepper, plan, alike = batch.stepper, plan, batch.alike
        self._rows, self._near, self._valves = rows, near, rows[batch.valve :, near:]
        own = self._beds(rows)
        count = near * rows.shape[2] if alike else near
        parts = _pieces(count, 1 if alike else rows.shape[2])
        self._touched = [
            (part, stepper.prepare(plan, own[:, part], part.stop - part.start)) for part in parts
        ]
        self._others: dict[int, tuple[Floats, Movement]] = {}

    def _beds(self, values: Floats) -> Floats:
        """Return values (r, n, b) as the stepper takes them: (r, n b) where all cells are alike."""
        return values.reshape(len(values), -1) if self._alike else values

    def __call__(self, under: Floats) -> Floats:
        """Move the cells on by one control period, in place; return the force on the near ones, (k, b), N.

        `under` are the undersides of the fingers over them, (p, k, b), m.
        """
        force = np.empty((1, *under.shape[1:]))
        own, seen = self._beds(force)[0], self._beds(under)
        for part, move in self._touched:
            own[part] = move(seen[:, part])
        # Beyond the fingers nothing moves whose valve is shut, with no command on its way: squares sum to 0.
        awake = self._near + np.flatnonzero(np.einsum("rwb,rwb->w", self._valves, self._valves))
        for part in _pieces(awake.size, force.shape[2]):
            self._move_others(awake[part], under[:, :0])
        felt: Floats = force[0]
        return felt

    def _move_others(self, cells: Any, none: Floats) -> None:
        """Move some cells out of the fingers' reach, each of all runs."""
        size = -(-cells.size // GROUP) * GROUP
        if size not in self._others:
            rows = np.zeros((len(self._rows), size, self._rows.shape[2]))
            self._others[size] = rows, self._stepper.prepare(self._plan, self._beds(rows), 0)
        rows, move = self._others[size]
        rows[:, : cells.size] = self._rows[:, cells]
        move(self._beds(none))
        self._rows[:, cells] = rows[:, : cells.size]


def _pieces(count: int, runs: int) -> Iterator[slice]:
    """Cut some cells of each run into pieces of about one size, none larger than `PIECE` in all runs."""
    pieces = -(-count * runs // PIECE)
    for i in range(pieces):
        yield slice(count * i // pieces, count * (i + 1) // pieces)
