"""Stand-ins for what a scene leaves out: they own no state and compute nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["InstantValve", "PerfectSensors", "Unrelaxed"]

Floats = NDArray[np.float64]


class InstantValve:
    """No valve lag: the opening is the command."""

    rows = 0

    def opening(self, own: Floats, command: Floats) -> Floats:
        """Return the command."""
        return command

    def rate(self, own: Floats, command: Floats) -> Floats:
        """Return no rows."""
        return own

    def during(self, own: Floats, command: Floats, step: float) -> tuple[Floats, ...]:
        """Return the command, once: it does not change within a step."""
        return (command,)

    def advance(self, own: Floats, command: Floats, step: float) -> None:
        """Nothing to move on."""


class Unrelaxed:
    """No relaxation: the pulp is elastic."""

    rows = 0

    def relaxed(self, own: Floats) -> float:
        """Return no loss of force."""
        return 0.0

    def rate(self, own: Floats, tension: Floats) -> Floats:
        """Return no rows."""
        return own

    def halfway(self, own: Floats, tension: Floats, step: float) -> float:
        """Return no loss of force."""
        return 0.0

    def advance(self, own: Floats, mean: Floats, first: Floats, last: Floats, step: float) -> None:
        """Nothing to move on."""

    def age(self, own: Floats, time: Floats) -> None:
        """Nothing to age."""


class PerfectSensors:
    """No sensor model: the controller knows the true forces and heights."""

    def measure(self, force: Floats, height: Floats) -> tuple[Floats, Floats]:
        """Return what is there."""
        return force, height
