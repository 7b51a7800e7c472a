"""Travel of the fingertip over the bed and along the path of a press stroke, alike for all brushes."""

from __future__ import annotations

import math
from dataclasses import replace

from .stroke import ABOVE, DONE, PRESSING, Stroke

#: Lowest point of the finger, m.
Place = tuple[float, float, float]

#: How fast it leaves, m/s: well above any pin's free speed, so that no blister follows it up; and how fast
#: it crosses the bed above all pins.
LIFT, CROSS = 0.4, 1.0
#: Fastest drag, m/s. On the paper's device a valley is as even at 100 mm/s as at 20 mm/s; at 200 mm/s
#: the master is left behind, and its depth grows from 4 to 11 mm along 60 mm.
DRAG = 0.1
#: Fastest drag of a finger that presses, in its half widths a second: on the bed "design", half as wide, 6 mm
#: deep, it leaves a valley uneven by 0.7 mm at 100 mm/s, by 0.05 mm at 60 mm/s.
SPAN = 30.0
#: How far above the highest pin the finger passes over the bed, m.
CLEARANCE = 4e-3
#: Heights that differ by less count as equal, m.
NEAR = 1e-9
#: How far a session slower than the wall's clock may fall behind the hand's times, s: what a hand does
#: in seconds is not to take minutes. The path stays whole, since the finger drags no faster than `DRAG`.
LATE = 0.5


def run_clock(stroke: Stroke, period: float, now: float) -> Stroke:
    """Return the stroke with its clock a control period on. `period`, s; `now`: time by the wall, s."""
    # It waits for moves that may have been made, or it would stop short and then make haste.
    if stroke.held and stroke.clock >= stroke.known:
        return stroke
    return replace(stroke, clock=max(stroke.clock + period, now - stroke.began - LATE))


def cross(stroke: Stroke, place: Place, safe: float, period: float) -> tuple[Stroke, Place]:
    """Go up to a safe height, then over to the path's first place.

    `place` (float, float, float), of the finger, m; `safe`, m; `period`, s.
    """
    x, y, z = place
    if z < safe - NEAR:
        return stroke, (x, y, min(safe, z + LIFT * period))
    to_x, to_y = stroke.place(0)
    far, length = math.hypot(to_x - x, to_y - y), CROSS * period
    if far > length:
        return stroke, (x + (to_x - x) * length / far, y + (to_y - y) * length / far, z)
    return replace(stroke, phase=PRESSING), (to_x, to_y, z)


def drag(stroke: Stroke, x: float, y: float, length: float) -> tuple[Stroke, float, float]:
    """Return the stroke and the place after a length of its path, never ahead of the hand.

    `x`, `y`: where the finger is, m; `length`, m.
    """
    reached, samples = stroke.reached, stroke.samples
    while reached + 1 < len(samples):
        last, aim = samples[reached], samples[reached + 1]
        (last_x, last_y), (aim_x, aim_y) = stroke.place(reached), stroke.place(reached + 1)
        passed = aim.time <= stroke.clock
        # On the way to a move yet to come the finger is no farther than the hand was.
        part = 1.0 if passed else (stroke.clock - last.time) / (aim.time - last.time)
        to_x, to_y = last_x + part * (aim_x - last_x), last_y + part * (aim_y - last_y)
        far = math.hypot(to_x - x, to_y - y)
        if far > length:
            x, y = x + length / far * (to_x - x), y + length / far * (to_y - y)
            break
        x, y, length = to_x, to_y, length - far
        if not passed:
            break
        reached += 1
    return replace(stroke, reached=reached), x, y


def finish_image(stroke: Stroke) -> Stroke:
    """Return the stroke with its next mirror image begun; without one it is done."""
    if stroke.image + 1 < len(stroke.mirrors):
        return replace(stroke, phase=ABOVE, image=stroke.image + 1, reached=0, climb=0.0)
    return replace(stroke, phase=DONE)
