"""Servo drive: pins that follow commanded heights, frame by frame, by a controller of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from .control_interface import Commands, Measurement
from .matrix_drive import MatrixDrive


class FrameState(NamedTuple):
    """State of the drive; see `matrix_drive.Addressing` for the first three: all lines are addressed."""

    served: Flags
    last: Cells
    waiting: Cells
    held: Floats
    """(n,): Heights that the servos follow, m."""


@dataclass(frozen=True, eq=False)
class ServoDrive:
    """Servos of all pins; of a control method they take the heights, not the valve commands."""

    parameters: MatrixDrive
    frame: int
    """Control periods."""
    start: FrameState

    def begin(self) -> FrameState:
        """Return the state before a session: all pins hold the rest height."""
        return self.start

    def serve(
        self, state: FrameState, period: int, seen: Measurement, orders: Commands
    ) -> tuple[FrameState, Commands]:
        """Return the state, and ``K = K_s (H_held - H)``, limited to [-1, 1], 0 in the dead zone."""
        known, held = self.parameters, state.held
        wanted = orders.target
        if known.height_step:
            wanted = np.round(wanted / known.height_step) * known.height_step
        if period % self.frame == 0:
            held = held.copy()
            held[seen.cells] = wanted
        followed = held[seen.cells]
        error = followed - seen.height
        command = np.clip(known.servo_gain * error, -1.0, 1.0)
        command[np.abs(error) <= known.dead_zone] = 0.0
        waiting = seen.cells[(command != 0.0) | (wanted != followed)]
        state = state._replace(held=held, waiting=waiting)
        return state, orders._replace(command=command)


def make_servos(drive: MatrixDrive, lines: int, heights: Floats, period: float) -> ServoDrive:
    """Put the drive of a bed together; heights (n,) at rest, m; control period, s."""
    served, last, none = np.ones(lines, np.bool_), np.zeros(lines, np.intp), np.empty(0, np.intp)
    start = FrameState(served, last, none, heights)
    return ServoDrive(drive, max(1, round(drive.frame / period)), start)
