"""What a session is at one instant, as a value: handed in to a step and handed back.

All that belongs to a cell is a row of one array, so that gathering the few cells that
move in a period is one call, and a part that is left out owns no row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .modes import Mode

__all__ = ["Rows", "State", "at_rest"]

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]


@dataclass(frozen=True)
class Rows:
    """Which row of `State.rows` holds what.

    The first `physics` rows (height first, m) are the continuous state of `physics.Cell`;
    then come the commands on their way to the valve, oldest first; the height a cell is
    commanded to, m; and the force on it at the end of the last period, N.
    """

    physics: int
    queue: int

    @property
    def target(self) -> int:
        """Row of the commanded height."""
        return self.physics + self.queue

    @property
    def force(self) -> int:
        """Row of the force."""
        return self.physics + self.queue + 1

    @property
    def commands(self) -> slice:
        """Rows of the commands on their way."""
        return slice(self.physics, self.physics + self.queue)

    @property
    def command(self) -> int:
        """Row of the newest command."""
        return self.physics + self.queue - 1

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.physics + 2 + self.queue


@dataclass(frozen=True, eq=False)
class State:
    """A session at the start of a control period.

    Attributes
    ----------
    period : int
        Number of control periods done.
    rows : ndarray (r, n)
        See `Rows`.
    mode : ndarray (n,) of int8
        Control modes, `modes.Mode`.
    moving : ndarray of int
        The cells that may change in the coming period even if nobody touches or commands
        them; all others have a shut valve, no command on its way and no force.
    left : ndarray (n,)
        Time up to which a cell's relaxation has been worked out, s: the pulp over cells
        at rest goes on relaxing, and is aged exactly when it is needed again.
    peak : float
        No pin top is higher than this, m.
    flags : ndarray (n,) of bool
        Working memory of a step; all False between steps.
    memory : object
        The controller's memory.
    """

    period: int
    rows: Floats
    mode: NDArray[np.int8]
    moving: Cells
    left: Floats
    flags: NDArray[np.bool_]
    peak: float
    memory: Any

    def copy(self) -> State:
        """Return a state that shares no array with this one."""
        arrays = {name: getattr(self, name).copy() for name in ("rows", "mode", "moving", "left", "flags")}
        return replace(self, **arrays)


def at_rest(rows: Rows, count: int, height: float, memory: Any) -> State:
    """Return the state before a session: every pin at `height`, every valve shut."""
    values = np.zeros((rows.count, count))
    values[0] = values[rows.target] = height
    mode = np.full(count, Mode.REST, np.int8)
    return State(0, values, mode, np.empty(0, np.intp), np.zeros(count), np.zeros(count, np.bool_), height, memory)
