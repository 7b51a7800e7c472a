"""A finger moved by hand, tick by tick, over a running session."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.toml_table import resolve
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZES = {"rows": 15, "columns": 15}
SCENE = resolve({"layout": SIZES})
TICK = 1 / 30


def pose(x: float = 0.0, z: float = 46.0) -> Floats:
    """Return a level finger's pose, in mm."""
    return np.array([x * 1e-3, 0.0, z * 1e-3, *LEVEL])


def started() -> Running:
    """Return a session at its beginning, its clock started."""
    session, said = sculpting.begin_session(7, "Bed", SCENE, pose())
    assert said == ""
    return sculpting.advance(session, pose(), 0.0, 100)


class Hand:
    """Moves the finger, in mm, while time goes by."""

    def __init__(self) -> None:
        self.now = 0.0

    def move(self, session: Running, poses: Iterable[tuple[float, float]]) -> Running:
        """Advance tick by tick."""
        for x, z in poses:
            self.now += TICK
            session = sculpting.advance(session, pose(x, z), self.now, 100)
        return session

    def press(self, session: Running, x: float = 0.0) -> Running:
        """Press at a place and lift off again."""
        down, up = np.linspace(46, 37, 10), np.linspace(37, 46, 10)
        return self.move(session, [(x, z) for z in (*down, *[37] * 10, *up, *[46] * 20)])


def heights(session: Running) -> Floats:
    """Return the pin tops."""
    return session.state.row(0)
