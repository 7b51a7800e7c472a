"""Bed of a session as a message to its clients."""

from __future__ import annotations

from dataclasses import dataclass

from digiclay.core.engine.system import System
from digiclay.core.scene.schema import Scene

from .protocol import LIMITS, Limits

#: Most pins whose positions are told: libraries refuse messages of a megabyte.
MOST_POSITIONS = 10_000


@dataclass(frozen=True)
class Bed:
    """Bed of the session, sent to a client once.

    Attributes
    ----------
    name : str
        Of the scene.
    rows, columns : int
    pitch, stroke : float
        m.
    period : float
        Control period, s.
    positions : tuple of (float, float)
        Of the pins, m; none of a bed of more than 10,000.
    most_force, most_speed : float
        Largest total force handed out, N, and largest speed of the fingertip, m/s.
    """

    name: str
    rows: int
    columns: int
    pitch: float
    stroke: float
    period: float
    positions: tuple[tuple[float, float], ...]
    most_force: float = LIMITS.force
    most_speed: float = LIMITS.speed


def describe_bed(scene: Scene, system: System, limits: Limits) -> Bed:
    """Return what clients are told of the bed of a scene."""
    layout, grid = scene.layout, system.grid
    told = grid.positions if grid.count <= MOST_POSITIONS else grid.positions[:0]
    return Bed(
        scene.name, layout.rows, layout.columns, layout.pitch, system.cell.actuator.stroke, system.period,
        tuple((float(x), float(y)) for x, y in told), limits.force, limits.speed,
    )  # fmt: skip
