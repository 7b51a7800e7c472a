"""Servo drive: pins that follow commanded heights, frame by frame, by a controller of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from ..base.arrays import Cells, Flags, Floats
from ..base.modes import LOCKED
from .control_interface import Commands, Measurement
from .layout import Layout
from .matrix_drive import DriveParameters, count_periods


class FrameState(NamedTuple):
    """State of the drive; see `matrix_drive.Addressing` for the first three: all lines are addressed."""

    served: Flags
    last: Cells
    waiting: Cells
    held: Floats
    """(n,): Heights that the servos follow, m; NaN before the first one of a pin."""


@dataclass(frozen=True, eq=False)
class ServoDrive:
    """Servos of all pins; of a control method they take the heights, not the valve commands."""

    parameters: DriveParameters
    frame: int
    """Control periods."""
    start: FrameState

    sets: ClassVar[list[str | int]] = []

    def begin(self) -> FrameState:
        """Return the state before a session: no pin has a height to follow."""
        return self.start

    def serve(
        self, state: FrameState, period: int, seen: Measurement, orders: Commands
    ) -> tuple[FrameState, Commands]:
        """Return the state, and ``K = K_s (H_held - H)``, limited to [-1, 1], 0 in the dead zone.

        A pin whose first height comes within a frame holds until its end. Locked pins have no servo.
        """
        servo, wanted, locked = self.parameters, orders.target, orders.mode == LOCKED
        if servo.height_step:
            steps = np.round(wanted / servo.height_step) * servo.height_step
            wanted = np.where(locked, wanted, steps)
        followed, held = state.held[seen.cells], state.held.copy()
        followed = np.where(np.isnan(followed), seen.target, followed)
        if period % self.frame == 0:
            followed = wanted
        followed = np.where(locked, wanted, followed)
        held[seen.cells] = followed
        error = followed - seen.height
        command = np.clip(servo.servo_gain * error, -1.0, 1.0)
        command[np.abs(error) <= servo.dead_zone] = 0.0
        command = np.where(locked, orders.command, command)
        waiting = seen.cells[(command != 0.0) | (wanted != followed)]
        state = state._replace(held=held, waiting=waiting)
        return state, orders._replace(command=command)


def make_servos(drive: DriveParameters, layout: Layout, period: float) -> ServoDrive:
    """Put the drive of a bed together; control period, s."""
    lines, cells = drive.count_lines(layout), layout.rows * layout.columns
    served, last, none = np.ones(lines, np.bool_), np.zeros(lines, np.intp), np.empty(0, np.intp)
    start = FrameState(served, last, none, np.full(cells, np.nan))
    return ServoDrive(drive, count_periods(drive.frame, period), start)
