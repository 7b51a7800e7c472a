"""VM Model: the virtual master's cylinder and valve, like a real cell's, without load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["MasterCell"]


@dataclass(frozen=True)
class MasterCell:
    """One unloaded cell, in plain numbers: the valve's opening is known exactly, its flow is averaged.

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
        *nodes, end = (a * opening + b * command for a, b in self.openings)
        rise = self.period * sum(self.speed(node) for node in nodes) / len(nodes)
        return min(max(height + rise, 0.0), self.stroke), end
