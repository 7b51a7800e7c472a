"""System of a session: all parts and constants of a bed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import Floats
from ..model.control_interface import Controller
from ..model.fingertip import require_one
from ..model.interfaces import Drive, Movement, Segment, Sensors, Stepper
from ..model.layout import Grid
from ..model.physics import Cell
from ..model.touch import FingerPeriod, trace_finger
from .active_set import Selection
from .hand_steps import HandStep
from .state import ActiveSet, Rows


@dataclass(frozen=True, eq=False)
class System:
    """Constants of a session."""

    grid: Grid
    cell: Cell
    sensors: Sensors
    controller: Controller
    drive: Drive
    stepper: Stepper
    plan: object
    """The stepper's constants of all periods."""
    period: float
    """Control period, s; of a batch (b,)."""
    fastest: float
    """Largest speed of a rising pin, m/s; of a batch (b,)."""
    selection: Selection
    """Of the active cells."""
    instants: Floats
    """(p,): Times into the period at which the fingertip's pose is needed, first 0, last `period`, s."""
    rows: Rows
    by_set: bool
    """Whether the result of a cell depends on the other active cells: in a batch each run then keeps the
    active set that it has alone."""
    latency: float
    """Time from a valve's command to the reading of its effect, s: dead time, lag, sensors' delay."""
    height_floor: float
    """Largest error of a height reading, m."""
    hands: tuple[HandStep, ...]
    """Physics steps of a period in which fingertips give way; none: their paths are prescribed."""

    @property
    def fingers(self) -> int:
        """Number of fingers."""
        return 1

    def trace(self, poses: Floats, first: int) -> list[Any]:
        """Return what presses in each of t periods from the period `first` on; None: nothing.

        `poses` (t, p, f, 7): the fingertips at the periods' instants.
        """
        if self.cell.touch is None:
            return [None] * len(poses)
        path = trace_finger(
            self.cell.touch.fingertip, require_one(tuple(poses.transpose(2, 0, 1, 3)))
        )
        return [path.at(period) for period in range(len(poses))]

    def move(self, active: ActiveSet, finger: FingerPeriod | None) -> None:
        """Move active cells through a control period under their queued commands, in place."""
        movement = active.movements.get(self.plan)
        if movement is None:
            movement = active.movements[self.plan] = self.prepare(active)
        if finger and active.near:
            under = finger.under(active.touched.quadratic_basis)
        else:
            under = np.empty((self.instants.size, 0, *active.cells.shape[1:]))
        active.touched.force[:] = movement(under)

    def prepare(self, active: ActiveSet) -> Movement:
        """Return the movement of active cells for as long as their set serves."""
        return self.stepper.prepare(self.plan, active.driven, active.near)


def make_segments(
    stepper: Stepper, cut: float, period: float, count: int
) -> tuple[tuple[Segment, ...], Floats]:
    """Return a period's steps, `count` equal ones, cut at a time, s, and its instants (p,), s."""
    times = {round(i * period / count, 15) for i in range(count + 1)}
    if cut:
        times = {t for t in times if abs(t - cut) > 1e-9 * period} | {cut}
    edges = sorted(times)
    pairs = list(pairwise(edges))
    times_of_nodes = [
        [a + node * (b - a) if node < 1.0 else b for node in stepper.nodes] for a, b in pairs
    ]
    instants = sorted({time for nodes in times_of_nodes for time in nodes})
    segments = tuple(
        Segment(a, b - a, tuple(map(instants.index, nodes)))
        for (a, b), nodes in zip(pairs, times_of_nodes, strict=True)
    )
    return segments, np.array(instants)
