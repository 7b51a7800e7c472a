"""Two gates in series per cell, one of its line and one of its column, which act as one valve.

Their drops add: of conductances a and b, as shares of an open gate, the pair has ``2 a b / (a + b)``
of both open. A shut gate leaks the share ε. What leaks past a shut column gate comes from the low
reservoir. Each gate has a first-order lag, so that both are known in closed form. A full
volume V between them gives as much to the cell as both, open, for the time V / (β G) at any load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import TINY, Floats
from .delay import Queue
from .lag import ValveLag

#: Lags after a command between which the opening is integrated by Gauss points of its own.
LAGS = (0.0, 1.0, 3.0, 8.0)


@dataclass(frozen=True, eq=False)
class Gates:
    """Openings of the gates of a cell: that of its line, 0 to 1, and that of its column, -1 to 1.

    Three commands of a control period are queued: of the line, of the column if other lines are
    addressed, and of the column for this cell; the sum of the last two acts.
    """

    line: ValveLag
    column: ValveLag
    queue: Queue
    """Commands of the line."""
    leak: float
    """Conductance of a shut gate as a share of an open one, ε."""
    power: int
    """Exponent of the opening in the laminar branch of the valve."""
    packet: float
    """Time V / (β G), s; 0 without a volume between the gates."""

    @property
    def rows(self) -> int:
        """State rows per cell: both gates; how full the volume is, -1 (low pressure) to 1 (high)."""
        return 3 if self.packet else 2

    def response(self, queue: Queue, times: Sequence[float]) -> Floats:
        """Return the map from the gates and their commands to the gates at times, line and column in turn."""
        length = max(self.queue.length, queue.length)
        response = np.zeros((2 * len(times) + self.rows - 2, self.rows + 3 * length))
        response[2 * len(times) :, 2 : self.rows] = 1.0
        gates = (
            (0, 0, self.line, self.queue),
            (1, 1, self.column, queue),
            (1, 2, self.column, queue),
        )
        for gate, command, lag, commands in gates:
            openings = lag.response(commands, times)
            rows = slice(gate, 2 * len(times), 2)
            response[rows, gate] = openings[:, 0]
            response[rows, self.rows + 3 * (length - commands.length) + command :: 3] = openings[
                :, 1:
            ]
        return response

    def list_cuts(self, queue: Queue) -> tuple[float, ...]:
        """Return when a gate changes to its next command in a period, and times of its lag after that, s."""
        gates = (self.queue, self.line), (queue, self.column)
        cuts = {commands.cut + n * lag.time_constant for commands, lag in gates for n in LAGS}
        return tuple(sorted(cuts))

    def join(self, raw: Floats, steps: Floats) -> Floats:
        """Return the openings of the equivalent valve in steps, s; fills and empties the volume in `raw`."""
        count = 2 * len(steps)
        line, column = raw[:count:2], raw[1:count:2]
        line_gate = self.leak + (1.0 - self.leak) * np.abs(line) ** self.power
        column_gate = (1.0 - self.leak) * np.abs(column) ** self.power
        driven = _connect(line_gate, column_gate)
        leaked = _connect(line_gate, column_gate + self.leak) - driven
        lift = np.copysign(driven, column) - leaked
        if self.packet:
            both = line_gate + column_gate + TINY
            source = np.copysign(column_gate / both, column)
            change = -np.expm1(-2.0 / self.packet * steps[:, None] * both)
            share = self.packet / steps[:, None] * line_gate / both
            for i in range(len(steps)):
                lost = change[i] * (raw[-1] - source[i])
                raw[-1] -= lost
                lift[i] += share[i] * lost
        return np.copysign(np.abs(lift) ** (1.0 / self.power), lift)

    def command(self, opening: Floats) -> Floats:
        """Return the column gates' commands for openings of the pair, while the line gate is open."""
        lift = np.abs(opening) ** self.power
        return np.copysign((lift / (2.0 - lift)) ** (1.0 / self.power), opening)

    def settle(self, rows: Floats) -> None:
        """Shut gates that are almost shut, in place."""
        self.column.settle(rows)


def _connect(first: Floats, second: Floats) -> Floats:
    """Return the conductance of two gates in series, as a share of two open ones."""
    return 2.0 * first * second / (first + second + TINY)
