"""Replay of recorded commands, without a controller."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Floats
from ..model.control_interface import Commands, Measurement
from ..model.layout import Disc, Grid


@dataclass(frozen=True, eq=False)
class Replay:
    """Controller of recorded valve commands, (t, n), a row a control period; none afterwards."""

    grid: Grid
    commands: Floats

    name = "replay"
    rows = 0

    @cached_property
    def disc(self) -> Disc | None:
        """The disc that holds every cell that is ever commanded: x, y, radius, m."""
        cells = np.flatnonzero(self.commands.any(axis=0))
        if not cells.size:
            return None
        x, y = self.grid.x[cells], self.grid.y[cells]
        at_x, at_y = float(x.min() + x.max()) / 2, float(y.min() + y.max()) / 2
        return at_x, at_y, float(np.hypot(x - at_x, y - at_y).max())

    def begin(self) -> int:
        """Return the number of periods played."""
        return 0

    def locate(self, memory: int, touched: Measurement) -> tuple[int, Disc | None]:
        """Take every commanded cell along."""
        return memory, self.disc

    def command(self, memory: int, seen: Measurement) -> tuple[int, Commands]:
        """Return the commands of the period."""
        command = np.zeros(seen.height.size)
        if memory < len(self.commands):
            command = self.commands[memory, seen.cells]
        return memory + 1, Commands(seen.target, seen.mode, command)
