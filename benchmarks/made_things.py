"""Things made by recorded strokes of the Press tool, and how near they come to the intended relief."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.schema import Scene
from digiclay.device.instant import CLEARANCE
from digiclay.live.recorded_strokes import PointerStroke, play_strokes, read_strokes
from digiclay.live.sculpting import begin_session
from digiclay.settings.beds import BEDS
from digiclay.settings.devices import make_scene

from .intended_reliefs import RELIEFS, find_relief

#: Folder of the recorded strokes; and the things, each with a file there and an intended relief.
STROKES = Path(__file__).parent / "strokes"
THINGS = tuple(RELIEFS)


@dataclass(frozen=True, eq=False)
class Made:
    """Thing made on a bed.

    Attributes
    ----------
    name : str
        One of `THINGS`.
    title : str
        For people.
    bed, own_bed : str
        One of `BEDS`: where it was made, and where its strokes were drawn.
    scene : Scene
    formed, intended : ndarray (n,)
        Heights of the pins above rest, m.
    strokes : int
    simulated, spent : float
        Duration of the session, and processor time for it, s.
    """

    name: str
    title: str
    bed: str
    own_bed: str
    scene: Scene
    formed: Floats
    intended: Floats
    strokes: int
    simulated: float
    spent: float

    @property
    def correlation(self) -> float:
        """Pearson's coefficient of formed and intended heights over all pins."""
        return float(np.corrcoef(self.formed, self.intended)[0, 1])

    @property
    def slope(self) -> float:
        """Slope of the regression of formed on intended heights: 1 when nothing is scaled."""
        formed, intended = self.formed - self.formed.mean(), self.intended - self.intended.mean()
        return float(formed @ intended / (intended @ intended))

    @property
    def error(self) -> float:
        """Root of the mean square of formed less intended heights, m."""
        return float(np.sqrt(np.mean((self.formed - self.intended) ** 2)))


def make(name: str, bed: str | None = None) -> Made:
    """Play the recorded strokes of a thing on a bed at rest.

    `name`: one of `THINGS`; `bed`: one of `BEDS`; that of the file when left out. Places and sizes are scaled
    with its width. Raises DigiclayError when the file cannot be read, or a stroke not be formed.
    """
    recorded = read_strokes(STROKES / f"{name}.toml")
    own, other = BEDS[recorded.bed], BEDS[bed or recorded.bed]
    share = other.columns * other.pitch / (own.columns * own.pitch)
    layout = Layout(rows=other.rows, columns=other.columns, pitch=other.pitch)
    scene = make_scene("paper", layout, "virtual_master", other.share)
    above = np.array([0.0, 0.0, scene.actuator.rest_height + CLEARANCE, *LEVEL])
    session, _ = begin_session(1, recorded.name, scene, above)
    started = time.process_time()
    *_, session = play_strokes(session, rescale(recorded.strokes, share))
    spent = time.process_time() - started
    place = session.system.grid.positions.T / share
    formed = session.state.row(0) - scene.actuator.rest_height
    return Made(
        name, recorded.name, bed or recorded.bed, recorded.bed, scene, formed,
        find_relief(name, place[0], place[1]), len(recorded.strokes),
        session.state.period * session.system.period, spent,
    )  # fmt: skip


def rescale(strokes: tuple[PointerStroke, ...], share: float) -> tuple[PointerStroke, ...]:
    """Return strokes on a bed of another width; depths and heights stay."""
    return tuple(
        replace(one, moves=tuple((at, share * x, share * y) for at, x, y in one.moves)) for one in strokes
    )
