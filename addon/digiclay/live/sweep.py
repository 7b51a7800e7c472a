"""Motion of the fingertip over a press stroke that smooths, and the orders to the device below it.

Pins are smoothed by their valves, not by a finger: it goes along the path above them, never ahead of the hand
and no faster than a drag, and shows where the device is at work. At the end it waits until all pins have come
to their heights. No Blender in here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.base.arrays import Floats
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from .stroke import ABOVE, DRAGGING, LEAVING, Stroke
from .stroke_travel import CLEARANCE, DRAG, LIFT, cross, drag, finish_image, run_clock

#: Least radius of the disc that is smoothed, in pitches: below one a pin has no neighbor in it.
LEAST = 2.0
#: How long pins are waited for that do not come to their heights, s: noise may hide that they have.
PATIENCE = 2.0


def find_radius(finger: Fingertip, layout: Layout) -> float:
    """Return the radius of the disc that a stroke smooths, m: half the finger's width, or that of few pins."""
    return max(finger.width, LEAST * layout.pitch)


def sweep(
    stroke: Stroke, height: Floats, radius: float, pose: Floats, count: int, period: float, now: float,
    *, arrived: bool,
) -> tuple[Stroke, Floats, Floats]:  # fmt: skip
    """Advance the fingertip over a press stroke that smooths.

    `stroke`: not done yet; `height` (n,), how high the pins are now, or are commanded to, m: the finger stays
    above; `radius`: of the disc that is smoothed, m; `pose` (7,), where the finger is; `count`: most control
    periods to go on for; `period`: control period, s; `now`: time by the wall, s, by a clock that never goes
    back; `arrived`: whether all smoothed pins are at their heights now. Returns `stroke`; `path` (k + 1, 7),
    poses between the periods, row 0 where the finger was; k is at most `count`; `orders` (k, 4), what is
    smoothed in each of the periods, see `core.control.smoothing`.
    """
    if stroke.height is None:
        stroke = replace(stroke, height=height.copy(), phase=ABOVE)
    safe = float(height.max()) + CLEARANCE
    path, orders = [pose], []
    while len(path) <= count and not stroke.done:
        stroke = run_clock(stroke, period, now)
        x, y, z = path[-1][:3].tolist()
        strength = 0.0
        if stroke.phase == ABOVE:
            stroke, (x, y, z) = cross(replace(stroke, clock=0.0, began=now), (x, y, z), safe, period)
            orders.append((0.0, 0.0, 0.0, 0.0))
        else:
            if stroke.phase != LEAVING:
                stroke, x, y = drag(replace(stroke, phase=DRAGGING), x, y, DRAG * period)
                z = max(safe, z - LIFT * period)
                strength = stroke.samples[stroke.reached].share
            orders.append((x, y, radius, strength))
            stroke = _end(stroke, arrived=arrived)
            arrived = False
        path.append(np.array([x, y, z, *pose[3:]]))
    return stroke, np.array(path), np.array(orders).reshape(-1, 4)


def _end(stroke: Stroke, *, arrived: bool) -> Stroke:
    """Return the stroke with its end begun after the path, and ended after the pins have arrived."""
    if stroke.phase == LEAVING:
        late = stroke.clock - stroke.left >= PATIENCE
        return finish_image(stroke) if arrived or late else stroke
    over = not stroke.held and stroke.reached == len(stroke.samples) - 1
    return replace(stroke, phase=LEAVING, left=stroke.clock) if over else stroke
