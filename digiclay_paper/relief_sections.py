"""Intended relief of the session, and the deviation of the formed one, section by section.

`core/studies/nominal_relief.py` states what is asked for.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.modes import Mode
from digiclay.core.metrics.summary import find_contact_rows
from digiclay.core.session.run_scene import Result
from digiclay.core.studies.nominal_relief import evaluate_share, find_nominal, measure_reach

from .results import Session

#: The session's lines: y of ridge and valley, x at which both end and the mound is, m.
RIDGE, VALLEY, END = -21e-3, 21e-3, 21e-3
#: How far from its middle a section along ridge or valley is level, m.
LEVEL = 10e-3
#: What rounding makes of a length, m.
TINY = 1e-12
#: Cells on a section are within this of its line, m.
ON = 1e-6


class Limits(NamedTuple):
    """Largest deviations of a section of the intended shape."""

    rms: float = 0.10
    largest: float = 0.25
    """Of the deviation, as shares of the height of the relief asked for in the section."""
    rim: float = 0.05
    """How much higher (in a crease: lower) than in the middle any of its pins may be, as such a share."""
    level: float = 0.25
    """How far its middle may be from the height asked for there, as a share of that."""

    def __str__(self) -> str:
        return (
            f"within {self.rms:.0%} (rms) and {self.largest:.0%} (largest) of the relief asked for, and "
            f"its rim over its middle by no more than {self.rim:.0%}, and its middle within {self.level:.0%} "
            "of the height asked for"
        )


LIMITS = Limits()


class Section(NamedTuple):
    """A section through the final surface."""

    name: str
    part: str
    """Boss or crease it belongs to: ridge, mound or valley."""
    along: Floats
    """(k,): Where its cells are on its line, m."""
    formed: Floats
    asked: Floats
    """(k,): Heights over the bed at rest, m: formed, and asked for. `asked` is scaled so that in the middle
    it is as high as `formed`: how deep the pins press into the fingertip is no matter of shape."""
    level: float
    """By how much it was higher there than it had been asked for, m; in a crease: lower."""
    middle: float
    """The height asked for in the middle, m; in a crease: the depth."""
    rim: float
    """How much higher (in a crease: lower) than in the middle the section is anywhere, m."""
    pins: float
    """The same of all pins of the boss or crease, on the section or beside it, m."""

    @property
    def relief(self) -> float:
        """Height of the relief asked for, m."""
        return float(np.abs(self.asked).max())

    @property
    def rms(self) -> float:
        """Root mean square deviation, m."""
        return float(np.sqrt(np.mean((self.formed - self.asked) ** 2)))

    @property
    def largest(self) -> float:
        """Largest deviation, m."""
        return float(np.abs(self.formed - self.asked).max())

    def meets(self, limits: Limits) -> bool:
        """Return whether the section has the shape asked for."""
        allowed = limits.rms, limits.largest, limits.rim
        rim = max(self.rim, self.pins)
        shape = np.array([self.rms, self.largest, rim]) <= np.array(allowed) * self.relief + TINY
        return bool(np.all(shape)) and abs(self.level) <= limits.level * self.middle


def asked_for(session: Session) -> Floats:
    """Return the heights over the bed at rest that the session asks for, shape (n,), m."""
    history = session.history
    touching = find_contact_rows(history["total_force"]) & ~np.isnan(history["set_point"])
    path = {"fingertip": history["fingertip"][touching], "position": history["position"]}
    return find_nominal(session.scene, path, history["following"][touching])


def sections(session: Session) -> Iterator[Section]:
    """Give the sections along and across ridge, mound and valley."""
    place, scene = session.history["position"], session.scene
    formed, asked = session.history["height"][-1] - scene.actuator.rest_height, asked_for(session)
    x, y = place.T
    near, far = y < 0.0, y > 0.0
    slant = (x - END) - (y - RIDGE)
    ridge, valley = (np.abs(y - line) < ON for line in (RIDGE, VALLEY))
    straight, end = np.abs(x) < LEVEL, np.abs(x - END) < ON
    parts = {"ridge": near & straight, "mound": near, "valley": far}
    # Name, part, cells, where they are on their line, and the cells in its middle.
    lines = (
        ("along ridge and mound", "mound", ridge, x, ridge & end),
        ("across the ridge", "ridge", (np.abs(x) < ON) & near, y, ridge & straight),
        ("across the mound", "mound", end & near, y, ridge & end),
        ("slantwise across the mound", "mound", (np.abs(slant) < ON) & near, x, ridge & end),
        ("along the valley", "valley", valley, x, valley & straight),
        ("across the valley", "valley", (np.abs(x) < ON) & far, y, valley & straight),
    )
    for name, part, cells, where, middle in lines:
        if np.any(cells) and np.any(middle):
            sign = -1.0 if part == "valley" else 1.0
            yield _cut((name, part), (formed, asked, where), (cells, middle, parts[part]), sign)


def _cut(
    names: tuple[str, str], over: tuple[Floats, ...], cells: Sequence[Any], sign: float
) -> Section:
    """Return the section of a name and a part of the bed; `sign`: -1 of a crease.

    `over`: heights formed and asked for, and places along the line, (n,) each, m; `cells`: those on
    the section, in its middle, and of the whole part.
    """
    (formed, asked, where), (line, middle, whole) = over, cells
    high, wanted = (float(np.median(sign * heights[middle])) for heights in (formed, asked))
    rim, pins = (float((sign * formed[some]).max()) - high for some in (line, whole))
    drawn = asked[line] * (high / wanted if wanted else 1.0)
    return Section(*names, where[line], formed[line], drawn, high - wanted, wanted, rim, pins)


def blister_section(done: Result) -> Section:
    """Return the section along x through a blister under a fingertip in the middle of the bed."""
    history, scene = done.history, done.scene
    assert scene.blister is not None  # both methods have one
    place, rest = history["position"], scene.actuator.rest_height
    tip, line = history["fingertip"][-1], np.abs(place[:, 1]) < ON
    following = np.count_nonzero(history["mode"][-1:] == Mode.FORCE_FOLLOW, axis=1)
    away = np.hypot(*(place - tip[:2]).T)
    share = evaluate_share(scene.blister, away - measure_reach(scene, place, following))
    formed, asked = history["height"][-1] - rest, share * (float(tip[2]) - rest)
    cells = line, away == away.min(), slice(None)
    sign = 1.0 if tip[2] > rest else -1.0
    return _cut(("blister", "blister"), (formed, asked, place[:, 0]), cells, sign)
