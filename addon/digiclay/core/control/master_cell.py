"""Cylinder and valve of the virtual master: a cell without load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.actuator import Actuator
from ..model.delay import Queue
from ..model.interfaces import Flow
from ..model.physics import GAUSS, Cell
from ..model.supply import Supply

__all__ = ["MasterCell", "make_master_cell"]


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
    supply : Supply
    actuator : Actuator
    period : float
        Control period, s.
    """

    openings: tuple[tuple[float, float], ...]
    flow: Flow
    laminar: bool
    supply: Supply
    actuator: Actuator
    period: float

    def advance(self, height: float, opening: float, command: float) -> tuple[float, float]:
        """Return height, m, and opening after one period of a held command.

        Parameters
        ----------
        height : float
            m.
        opening, command : float
        """
        (a, b), (c, d), (e, f) = self.openings
        speed = 0.5 * (self.speed(a * opening + b * command) + self.speed(c * opening + d * command))
        stroke = self.actuator.stroke
        return min(max(height + self.period * speed, 0.0), stroke), e * opening + f * command

    def speed(self, opening: float) -> float:
        """Return the speed of the unloaded pin, m/s."""
        pressure = self.supply.high if opening > 0.0 else self.supply.low
        if self.laminar:
            speed: float = self.flow.laminar_conductance(opening) * pressure / self.actuator.area
            return speed
        return float(self.flow.flow(np.array(opening), np.array(pressure))) / self.actuator.area


def make_master_cell(cell: Cell, period: float) -> MasterCell:
    """Make the master's cylinder and valve like those of the real cells.

    Parameters
    ----------
    cell : Cell
    period : float
        Control period, s.
    """
    nodes = cell.lag.response(Queue(), [node * period for node in GAUSS] + [period])
    # Without a lag there is no column for the opening at the start.
    openings = tuple((row[0] if cell.lag.rows else 0.0, row[-1]) for row in nodes.tolist())
    laminar = cell.flow.knee > cell.supply.largest
    return MasterCell(openings, cell.flow, laminar, cell.supply, cell.actuator, period)
