"""Cylinder and valve of the virtual master: a cell without load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..model.delay import Queue
from ..model.physics import GAUSS, Cell

__all__ = ["MasterCell", "master_cell"]


@dataclass(frozen=True)
class MasterCell:
    """One unloaded cell in plain numbers: exact valve opening, averaged flow.

    Attributes
    ----------
    openings : tuple of (float, float)
        The opening at the Gauss points of a control period, then at its end, as
        ``a K + b K_com``.
    speed : callable
        Speed of the unloaded pin, m/s, for an opening.
    period : float
        Control period, s.
    stroke : float
        Upper end stop, m.
    """

    openings: tuple[tuple[float, float], ...]
    speed: Callable[[float], float]
    period: float
    stroke: float

    def after(self, height: float, opening: float, command: float) -> tuple[float, float]:
        """Return height, m, and opening after one period of a held command."""
        (a, b), (c, d), (e, f) = self.openings
        speed = 0.5 * (self.speed(a * opening + b * command) + self.speed(c * opening + d * command))
        return min(max(height + self.period * speed, 0.0), self.stroke), e * opening + f * command


def master_cell(cell: Cell, period: float) -> MasterCell:
    """Make the master's cylinder and valve like those of the real cells."""
    nodes = cell.lag.response(Queue(), [node * period for node in GAUSS] + [period])
    # Without a lag there is no column for the opening at the start.
    openings = tuple((row[0] if cell.lag.rows else 0.0, row[-1]) for row in nodes.tolist())
    laminar = cell.flow.knee > cell.supply.largest
    speed = _laminar_speed(cell) if laminar else _speed(cell)
    return MasterCell(openings, speed, period, cell.actuator.stroke)


def _laminar_speed(cell: Cell) -> Callable[[float], float]:
    """Return the speed where every flow is laminar, see `Flow.laminar_conductance`, in plain numbers."""
    line, valve = cell.flow.resistances
    square, area = cell.flow.power == 2, cell.actuator.area
    up, down = cell.supply.high / area, cell.supply.low / area

    def speed(opening: float) -> float:
        lift = opening * opening if square else abs(opening)
        return lift / (line * lift + valve) * (up if opening > 0.0 else down)

    return speed


def _speed(cell: Cell) -> Callable[[float], float]:
    """Return the speed where some flow may be turbulent."""
    supply, area = cell.supply, cell.actuator.area

    def speed(opening: float) -> float:
        pressure = supply.high if opening > 0.0 else supply.low
        return float(cell.flow.flow(np.array([opening]), np.array([pressure]))[0]) / area

    return speed
