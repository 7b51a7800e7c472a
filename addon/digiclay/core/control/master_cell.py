"""Cylinder and valve of the virtual master: a cell without load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.delay import Queue
from ..model.interfaces import Flow
from ..model.physics import GAUSS, Cell


@dataclass(frozen=True)
class MasterCell:
    """One unloaded cell in plain numbers: exact valve opening, averaged flow.

    Attributes
    ----------
    openings : tuple of (float, float)
        The opening at the Gauss points of a control period, then at its end, as
        ``a K + b K_com``.
    flow : Flow
        The law of valve and conduit.
    laminar : bool
        No unloaded valve is turbulent.
    up, down : float
        Pressures of the reservoirs over the area of a pin, Pa/m².
    area : float
        Of a pin, m².
    stroke : float
        Upper end stop, m.
    period : float
        Control period, s.
    """

    openings: tuple[tuple[float, float], ...]
    flow: Flow
    laminar: bool
    up: float
    down: float
    area: float
    stroke: float
    period: float

    def advance(self, height: float, opening: float, command: float) -> tuple[float, float]:
        """Return height, m, and opening after one period of a held command. `height`, m."""
        (a, b), (c, d), (e, f) = self.openings
        first, second = a * opening + b * command, c * opening + d * command
        speed = 0.5 * (self.speed(first) + self.speed(second))
        return min(max(height + self.period * speed, 0.0), self.stroke), e * opening + f * command

    def speed(self, opening: float) -> float:
        """Return the speed of the unloaded pin, m/s."""
        drive = self.up if opening > 0.0 else self.down
        if self.laminar:
            speed: float = self.flow.laminar_conductance(opening) * drive
            return speed
        return float(self.flow.conductance(np.array(opening), np.array(drive * self.area))) * drive


def make_master_cell(cell: Cell, period: float) -> MasterCell:
    """Make the master's cylinder and valve like those of the real cells. `period`: control period, s."""
    nodes = cell.lag.response(Queue(), [node * period for node in GAUSS] + [period])
    # Without a lag there is no column for the opening at the start.
    openings = tuple((row[0] if cell.lag.rows else 0.0, row[-1]) for row in nodes.tolist())
    laminar = cell.flow.knee > cell.supply.largest
    area, stroke = cell.actuator.area, cell.actuator.stroke
    up, down = cell.supply.high / area, cell.supply.low / area
    return MasterCell(openings, cell.flow, laminar, up, down, area, stroke, period)
