"""Force plot at a film's lower edge: total force over time, set point, current instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import bridge
from ..compat import bpy
from ..core.base.arrays import Floats
from .legend import FADED, INK, LEFT, Front

#: Part of the picture's height the strip takes, and what of it is left to the letters above the curve.
SHARE, LETTERS = 0.20, 0.30
#: Most columns the curve is drawn with.
MOST = 600
#: sRGB: the whole session's force, what of it has been, the set point, and what lies behind.
TO_COME, BEEN, ASKED, PAPER = (0.52, 0.57, 0.64), (0.00, 0.45, 0.70), (0.84, 0.37, 0.00), (0.93, 0.94, 0.95)
#: Least force the strip's height stands for, N.
LEAST = 0.05


@dataclass(frozen=True)
class ForcePlot:
    """Force plot of one film.

    Attributes
    ----------
    been, cursor, force, time
        Objects that change from frame to frame.
    place : ndarray (k,)
        Where each column stands, plane units, and
    height : ndarray (k,)
        how high it is.
    first, per_second : float
        Time of the left edge, s, and plane units of a second.
    """

    been: Any
    cursor: Any
    force: Any
    time: Any
    place: Floats
    height: Floats
    first: float
    per_second: float

    def show(self, time: float, force: float) -> None:
        """Show an instant: its time, s, and the total force then, N. `time`, s; `force`, N."""
        now = (time - self.first) * self.per_second
        place = np.minimum(self.place, now)
        # Columns still to come are drawn together at the cursor, as a face of no width.
        flat = np.ascontiguousarray(_area(place, np.where(self.place <= now, self.height, 0.0)), np.float32)
        self.been.data.vertices.foreach_set("co", flat.ravel())
        self.been.data.update()
        behind = self.cursor.location.z / self.been.location.z
        self.cursor.location.x = (self.been.location.x + now) * behind
        self.force.data.body = f"total force {force:.2f} N"
        self.time.data.body = f"{time:.2f} s"


def draw_force_plot(front: Front, time: Floats, force: Floats, set_point: float | None) -> ForcePlot:
    """Draw the strip of a session.

    `time`, `force` (t,), times, s, and total forces, N, of the rows the film is made of; `set_point`: total
    force that is asked for, N.
    """
    left, right = LEFT * front.width, -LEFT * front.width
    bottom = -0.95 * front.height
    full = 2.0 * SHARE * front.height
    rise = (1.0 - LETTERS) * full
    top = max(LEAST, 1.1 * float(force.max()), 1.4 * (set_point or 0.0))
    moments, highest = reduce_columns(time, force)
    lasts = max(float(time[-1] - time[0]), 1e-9)
    place, height = (moments - time[0]) * ((right - left) / lasts), highest * (rise / top)
    front.box("strip", (left, bottom), (right, bottom + rise), PAPER, 5)
    areas = []
    corners = np.arange(len(place) - 1)[:, None] * 2 + [0, 2, 3, 1]
    faces: list[tuple[int, ...]] = [tuple(face) for face in corners.tolist()]
    for name, color, layer in (("to come", TO_COME, 4), ("been", BEEN, 3)):
        area = bpy.data.objects.new(name, bridge.mesh(name, (_area(place, height), faces)))
        areas.append(front.put(area, left, bottom, color, layer))
    thick = max(0.010 * full, 0.5 * front.pixel)
    size = front.readable(0.80 * front.letter)
    above = bottom + rise + 0.35 * size
    if set_point is not None:
        at = bottom + set_point * rise / top
        front.box("set point", (left, at - thick), (right, at + thick), ASKED, 2)
        front.write(f"set point {set_point:.2f} N", size, 0.0, above, ASKED, "CENTER")
    cursor = front.box("cursor", (left, bottom), (left + 1.5 * thick, bottom + rise), INK, 1)
    said = front.write("total force", size, left, above, INK)
    moment = front.write("time", size, right, above, FADED, "RIGHT")
    return ForcePlot(areas[1], cursor, said, moment, place, height, float(time[0]), (right - left) / lasts)


def reduce_columns(time: Floats, force: Floats, most: int = MOST) -> tuple[Floats, Floats]:
    """Return times and forces of at most so many columns: rows that share one give it their largest force.

    `time` (t,), s; `force` (t,), N; `most`: columns.
    """
    count = len(time)
    starts = np.unique(np.linspace(0, count, min(count, most), endpoint=False).astype(np.intp))
    return time[starts], np.maximum.reduceat(force, starts)


def _area(place: Floats, height: Floats) -> Floats:
    """Return the lower and upper end of every column, alternating, (2 k, 3)."""
    points = np.zeros((2 * len(place), 3))
    points[:, 0] = np.repeat(place, 2)
    points[1::2, 1] = height
    return points
