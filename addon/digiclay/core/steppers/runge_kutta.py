"""The classical fourth-order Runge-Kutta method, on the rates as they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..physics import Cell, rates

__all__ = ["RungeKutta4"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RungeKutta4:
    """Explicit, order 4 where the right-hand side is smooth, 2 across a contact or a reversed valve."""

    name = "runge_kutta_4"
    order = 4
    nodes = (0.0, 0.5, 1.0)

    def advance(self, cell: Cell, y: Floats, under: Floats, command: Floats, step: float) -> None:
        """Move a block of cells on by one step, in place.

        Parameters
        ----------
        cell : Cell
        y : ndarray (r, n)
            State rows, see `physics.Cell`.
        under : ndarray (3, k)
            Underside of the finger over the first k cells at the start, middle and end, m.
        command : ndarray (n,)
            Held valve commands.
        step : float
            Length of the step, s.
        """
        first = rates(cell, y, under[0], command)
        second = rates(cell, y + (0.5 * step) * first, under[1], command)
        third = rates(cell, y + (0.5 * step) * second, under[1], command)
        fourth = rates(cell, y + step * third, under[2], command)
        y += (step / 6.0) * (first + 2.0 * (second + third) + fourth)
        np.clip(y[0], 0.0, cell.actuator.stroke, out=y[0])
