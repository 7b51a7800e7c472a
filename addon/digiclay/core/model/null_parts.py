"""Null parts, which replace omitted parts: no state, no computation."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ..base.arrays import Floats
from .control_interface import Commands, Measurement, Memory
from .delay import Queue
from .interfaces import Alike, Lag, Sensors


class InstantValve(Alike, Lag):
    """No valve lag: the opening is the command."""

    rows = 0

    def opening(self, rows: Floats, command: Floats) -> Floats:
        """Return the command."""
        return command

    def rate(self, rows: Floats, command: Floats) -> Floats:
        """Return no rows."""
        return rows

    def response(self, queue: Queue, times: Sequence[float]) -> Floats:
        """Return the map (t, queue.length) that selects the command seen at each time, s."""
        response = np.zeros((len(times), queue.length))
        response[np.arange(len(times)), [queue.seen(time) for time in times]] = 1.0
        return response

    def settle(self, rows: Floats) -> None:
        """Nothing to settle."""


class Unrelaxed(Alike):
    """No relaxation: the pulp is elastic."""

    rows = 0
    rates: ClassVar[Floats] = np.empty((0, 1))
    shares: ClassVar[Floats] = np.empty(0)

    def relaxed(self, filters: Floats) -> float:
        """Return no loss of force."""
        return 0.0

    def rate(self, filters: Floats, tension: Floats) -> Floats:
        """Return no rows. `filters` (0, n); `tension` (n,), N."""
        return filters

    def mean_loss_map(self, step: float) -> tuple[Floats, float]:
        """Return the map to no loss of force, shape (1,), and no share."""
        return np.zeros(1), 0.0

    def propagator(self, step: float) -> Floats:
        """Return the map to no rows, shape (0, 3)."""
        return np.empty((0, 3))

    def age(self, filters: Floats, time: Floats) -> None:
        """Nothing to age. `filters` (0, n); `time` (n,), s."""


class PerfectSensors(Alike, Sensors):
    """No sensor model: measured forces and heights are the true ones."""

    rows = 0

    def measure(self, seen: Measurement, period: int) -> tuple[Floats, Floats]:
        """Return the true ones."""
        return seen.force, seen.height

    def read(self, seen: Measurement, period: int) -> Measurement:
        """Return the cells as they are."""
        return seen

    def note(self, seen: Measurement, period: int) -> None:
        """Nothing to remember."""


class DirectDrive(Alike):
    """A valve per cell: every command acts."""

    sets: ClassVar[list[str | int]] = []

    def begin(self) -> None:
        """Nothing to remember."""

    def serve(
        self, state: None, period: int, seen: Measurement, orders: Commands
    ) -> tuple[None, Commands]:
        """Return the commands as they are."""
        return None, orders


class Uncontrolled:
    """No control method: every valve stays shut."""

    rows = 0

    def begin(self) -> None:
        """Nothing to remember."""

    def locate(self, memory: Memory, touched: Measurement) -> tuple[Any, None]:
        """Control no disc."""
        return memory, None

    def command(self, memory: Memory, seen: Measurement) -> tuple[Memory, Commands]:
        """Leave targets and modes, and shut the valves."""
        return memory, Commands(seen.target, seen.mode, np.zeros(seen.target.shape))
