"""Motion of the fingertip along a press stroke.

The hand draws in its own time, and the finger follows later, in the session's: it comes from above,
presses to its depth where the mouse went down, goes along the whole path, never ahead of the hand and
never faster than a drag may be, and leaves upwards. A slow machine, or clay that gives way slowly, thus
makes the finger late, and loses nothing of the path. Depth counts from the surface as it was when the
finger began: pins that give way do not draw the finger after them. No Blender in here.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.model.fingertip import Fingertip
from ..core.model.layout import Grid
from ..core.surface.pointing import find_ground_height
from .stroke import ABOVE, DONE, DRAGGING, LEAVING, PRESSING, Stroke

__all__ = ["APPROACH", "DRAG", "SPEED", "follow"]

Floats = NDArray[np.float64]

#: How fast the finger comes down to the surface, and presses, m/s. Pressed faster, it runs into pins whose
#: valves have not opened yet: 2 N at 20 mm/s on the paper's device, 24 N at 50 mm/s.
APPROACH, SPEED = 0.1, 0.02
#: How fast it leaves, m/s: well above any pin's free speed, so that no blister follows it up; and how fast
#: it crosses the bed above all pins.
LIFT, CROSS = 0.4, 1.0
#: Fastest drag, m/s. On the paper's device a valley is as even at 100 mm/s as at 20 mm/s; at 200 mm/s
#: the master is left behind, and its depth grows from 4 to 11 mm along 60 mm.
DRAG = 0.1
#: How far above the highest pin the finger passes over the bed, m.
CLEARANCE = 4e-3
#: Heights that differ by less count as equal, m.
NEAR = 1e-9
#: How far a session slower than the wall's clock may fall behind the hand's times, s: what a hand does
#: in seconds is not to take minutes. The path stays whole, since the finger drags no faster than `DRAG`.
LATE = 0.5


def follow(
    stroke: Stroke,
    grid: Grid,
    height: Floats,
    finger: Fingertip,
    pose: Floats,
    count: int,
    period: float,
    now: float,
) -> tuple[Stroke, Floats]:
    """Advance the fingertip along a press stroke.

    Parameters
    ----------
    stroke : Stroke
        Not done yet.
    grid : Grid
    height : ndarray (n,)
        Heights of the pins now, m; taken for the surface by a stroke that begins.
    finger : Fingertip
    pose : ndarray (7,)
        Where the finger is.
    count : int
        Most control periods to go on for.
    period : float
        Control period, s.
    now : float
        Time by the wall, s, by a clock that never goes back.

    Returns
    -------
    stroke : Stroke
    path : ndarray (k + 1, 7)
        Poses between the periods, row 0 where the finger was; k is at most `count`.
    """
    if stroke.height is None:
        stroke = replace(stroke, height=height.copy(), phase=ABOVE)
    path, peak = [pose], float(height.max())
    while len(path) <= count and not stroke.done:
        stroke, place = _step(stroke, grid, finger, path[-1], peak, period, now)
        path.append(np.array([*place, *pose[3:]]))
    return stroke, np.array(path)


Place = tuple[float, float, float]


def _step(
    stroke: Stroke, grid: Grid, finger: Fingertip, pose: Floats, peak: float, period: float, now: float
) -> tuple[Stroke, Place]:
    """Return the stroke after a control period, and where the finger is then."""
    assert stroke.height is not None
    height = stroke.height
    x, y, z = pose[:3].tolist()
    # It waits for moves that may have been made, or it would stop short and then make haste.
    if not stroke.held or stroke.clock < stroke.known:
        stroke = replace(stroke, clock=max(stroke.clock + period, now - stroke.began - LATE))
    safe = max(peak, float(height.max())) + CLEARANCE
    if stroke.phase == ABOVE:
        return _cross(replace(stroke, clock=0.0, began=now), (x, y, z), safe, period)
    if stroke.phase == LEAVING:
        z = min(safe, z + LIFT * period)
        return (_finish_image(stroke) if z >= safe - NEAR else stroke), (x, y, z)
    if stroke.phase == DRAGGING:
        stroke, x, y = _drag(stroke, x, y, DRAG * period)
    surface = find_ground_height(grid, height, x, y, finger.width / 2)
    # Pins bottom out on the bed's floor.
    lowest = max(0.0, surface - stroke.samples[stroke.reached].depth)
    z = _sink(z, surface, lowest, period)
    pressed = abs(z - lowest) < NEAR
    if stroke.phase == PRESSING and pressed:
        return replace(stroke, phase=DRAGGING), (x, y, z)
    over = not stroke.held and stroke.reached == len(stroke.samples) - 1
    if stroke.phase == DRAGGING and over and pressed:
        return replace(stroke, phase=LEAVING), (x, y, z)
    return stroke, (x, y, z)


def _finish_image(stroke: Stroke) -> Stroke:
    """Return the stroke with its next mirror image begun; without one it is done."""
    if stroke.image + 1 < len(stroke.mirrors):
        return replace(stroke, phase=ABOVE, image=stroke.image + 1, reached=0)
    return replace(stroke, phase=DONE)


def _cross(stroke: Stroke, place: Place, safe: float, period: float) -> tuple[Stroke, Place]:
    """Go up to a safe height, m, then over to the path's first place."""
    x, y, z = place
    if z < safe - NEAR:
        return stroke, (x, y, min(safe, z + LIFT * period))
    to_x, to_y = stroke.place(0)
    far, length = math.hypot(to_x - x, to_y - y), CROSS * period
    if far > length:
        return stroke, (x + (to_x - x) * length / far, y + (to_y - y) * length / far, z)
    return replace(stroke, phase=PRESSING), (to_x, to_y, z)


def _sink(z: float, surface: float, lowest: float, period: float) -> float:
    """Return the height after a control period on the way to the lowest, m."""
    if z > surface:
        return max(surface, lowest, z - APPROACH * period)
    if z > lowest:
        return max(lowest, z - SPEED * period)
    return min(lowest, z + APPROACH * period)


def _drag(stroke: Stroke, x: float, y: float, length: float) -> tuple[Stroke, float, float]:
    """Return the stroke and the place after a length of its path, m, never ahead of the hand."""
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
