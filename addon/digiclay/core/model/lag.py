"""Valve lag: first-order response to the command (equation 9)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats
from ..base.quantity import Parameters, quantity
from .delay import Queue
from .interfaces import Lag

#: Opening below which a closing valve counts as shut: its flow is at most 1e-18 of a cell's free
#: speed, and a cell with a shut valve need not be integrated.
SHUT = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class ValveLag(Parameters, Lag):
    """``τ_v dK/dt + K = K_com``: exact while the command is held."""

    time_constant: float = quantity(
        2e-3, "time constant of the valve", unit="s", symbol="τ_v", above=0.0
    )

    @property
    def rows(self) -> int:
        """State rows per cell: its opening."""
        return 1

    def opening(self, rows: Floats, command: Floats) -> Floats:
        """Return the opening K, shape (n,)."""
        return rows[0]

    def rate(self, rows: Floats, command: Floats) -> Floats:
        """Return dK/dt, 1/s (equation 9), (1, n), for held commands (n,)."""
        return (command - rows) / self.time_constant

    def response(self, queue: Queue, times: Sequence[float]) -> Floats:
        """Return the exact map (t, 1 + queue.length) from opening and commands to openings at times, s."""
        response = np.zeros((len(times), 1 + queue.length))
        for row, time in zip(response, times, strict=True):
            row[0] = math.exp(-time / self.time_constant)
            row[1] = (
                math.exp(-max(time - queue.cut, 0.0) / self.time_constant) if queue.cut else 1.0
            )
            row[1] -= row[0]
            if queue.cut:
                row[2] = -math.expm1(-max(time - queue.cut, 0.0) / self.time_constant)
        return response

    def settle(self, rows: Floats) -> None:
        """Shut valves that are almost shut, in place."""
        rows[np.abs(rows) < SHUT] = 0.0
