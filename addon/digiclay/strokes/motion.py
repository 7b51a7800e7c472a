"""Motion of the fingertip along a press stroke.

The hand draws in its own time, and the fingertip follows later, in the session's: it comes from above,
presses to its depth where the mouse went down, goes along the whole path, never ahead of the hand and
never faster than a drag may be, and leaves upwards. A slow machine, or clay that gives way slowly, thus
makes the fingertip late, and loses nothing of the path. Depth counts from the surface as it was when the
finger began: pins that give way do not draw the fingertip after them. No Blender in here.

A brush that raises presses until the blister starts, and rises to its height there, no faster than the
pins can follow. Every brush then goes along at its height, up and down over what is formed, at a speed at
which the pins ahead come to that height in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..core.base.arrays import Floats
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Grid
from ..core.surface.pointing import find_ground_height
from .stroke import ABOVE, DONE, DRAGGING, LEAVING, PRESSING, RISING, Brush, Mirror, Stroke
from .tracking import Tracking

#: Lowest point of the fingertip, m.
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
#: How far above the highest pin the fingertip passes over the bed, m.
CLEARANCE = 4e-3
#: Heights that differ by less count as equal, m.
NEAR = 1e-9
#: How far a session slower than the wall's clock may fall behind the hand's times, s: what a hand does
#: in seconds is not to take minutes. The path stays whole, since the fingertip drags no faster than `DRAG`.
LATE = 0.5


def run_clock(stroke: Stroke, period: float, now: float) -> Stroke:
    """Return the stroke with its clock a control period on. `period`, s; `now`: time by the wall, s."""
    # It waits for moves that may have been made, or it would stop short and then make haste.
    if stroke.held and stroke.clock >= stroke.known:
        return stroke
    return replace(stroke, clock=max(stroke.clock + period, now - stroke.began - LATE))


def cross(stroke: Stroke, place: Place, safe: float, period: float) -> tuple[Stroke, Place]:
    """Rise to a safe height, m, then cross to the path's first place."""
    x, y, z = place
    if z < safe - NEAR:
        return stroke, (x, y, min(safe, z + LIFT * period))
    to_x, to_y = stroke.place(0)
    far, length = math.hypot(to_x - x, to_y - y), CROSS * period
    if far > length:
        return stroke, (x + (to_x - x) * length / far, y + (to_y - y) * length / far, z)
    return replace(stroke, phase=PRESSING), (to_x, to_y, z)


def drag(stroke: Stroke, x: float, y: float, length: float) -> tuple[Stroke, float, float]:
    """Return the stroke and its place, m, a length further along its path, never ahead of the hand."""
    reached, samples = stroke.reached, stroke.samples
    while reached + 1 < len(samples):
        last, aim = samples[reached], samples[reached + 1]
        (last_x, last_y), (aim_x, aim_y) = stroke.place(reached), stroke.place(reached + 1)
        passed = aim.time <= stroke.clock
        # On the way to a move yet to come the fingertip is no farther than the hand was.
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


#: How fast the fingertip turns while it touches, rad/s: as fast as a hand turns a pen, so that tilt read in
#: coarse steps does not jerk it.
TURN = 3.0


def lean_finger(turn: Floats, lean: tuple[float, float]) -> Floats:
    """Return an orientation (4,) that leans from `turn` (4,) towards x and y of the bed, rad."""
    angle = math.hypot(*lean)
    if angle == 0.0:
        return turn
    # The axis is level, and square to the direction in which the top goes.
    share = math.sin(0.5 * angle) / angle
    return _multiply(np.array([math.cos(0.5 * angle), -lean[1] * share, lean[0] * share, 0.0]), turn)


def mirror_turn(turn: Floats, mirror: Mirror) -> Floats:
    """Return the orientation (4,) of an ellipsoid's mirror image."""
    along, across = mirror
    # M R M for M = diag(along, across, 1): the axis of a rotation is mirrored the other way round.
    return np.asarray(turn * [1.0, across, along, along * across])


def turn_toward(turn: Floats, aim: Floats, angle: float) -> Floats:
    """Return an orientation (4,) turned towards another, by an angle, rad, at most."""
    dot = float(turn @ aim)
    # The two quaternions of an orientation are opposite: the nearer one is meant.
    aim = aim if dot >= 0.0 else -aim
    far = 2.0 * math.atan2(float(np.linalg.norm(aim - abs(dot) * turn)), abs(dot))
    if far <= angle:
        return aim
    part, half = angle / far, 0.5 * far
    between: Floats = (math.sin((1.0 - part) * half) * turn + math.sin(part * half) * aim) / math.sin(half)
    return between / np.linalg.norm(between)


def advance_turn(stroke: Stroke, turn: Floats, clear: bool, period: float) -> Floats:
    """Return the fingertip's orientation (4,) after a control period; above all pins it turns at once."""
    assert stroke.turn is not None
    if stroke.done:
        return stroke.turn
    leaning = lean_finger(stroke.turn, stroke.samples[stroke.reached].lean)
    aim = mirror_turn(leaning, stroke.mirrors[stroke.image])
    return aim if clear else turn_toward(turn, aim, TURN * period)


def _multiply(first: Floats, second: Floats) -> Floats:
    """Return the rotation of a second quaternion followed by a first one."""
    a, u, b, v = first[0], first[1:], second[0], second[1:]
    return np.concatenate([[a * b - u @ v], a * v + b * u + np.cross(u, v)])


#: How fast the fingertip comes down to the surface, and presses, m/s. Pressed faster, it runs into pins whose
#: valves have not opened yet: 2 N at 20 mm/s on the paper's device, 24 N at 50 mm/s.
APPROACH, SPEED = 0.1, 0.02
#: How long a fingertip that takes a blister up gains speed, s: at once at half the free speed, it leaves the
#: pins behind, whose valves have not opened yet.
SPEED_UP = 1.0
#: Fastest drag of a blister, in its radii a second: the control finds the fingertip so much later. The pins
#: of small beds rise quickly enough to overtake it.
RADII = 2.0
#: Likewise of a finger that presses a valley, and pushes the pins out of its way; `DRAG` on the paper's bed.
PUSHED = 20.0 / 3.0
#: How long pins look for a fingertip that leaves, s, and how many times as fast as they it is.
SEARCH, OUTRUN = 0.1, 5.0
#: How far the fingertip may be off its height while it goes on along the path, m.
SLACK = 0.5e-3


@dataclass(frozen=True, eq=False)
class Ground:
    """Pins as they were when a stroke began, and the fingertip that moves over them in control periods."""

    grid: Grid
    #: Heights (n,), m.
    height: Floats
    finger: Fingertip
    #: Control period, s.
    period: float

    def find_surface(self, x: float, y: float) -> float:
        """Return the height of the surface under the middle of the fingertip at a place, m."""
        return find_ground_height(self.grid, self.height, x, y, self.finger.width / 2)

    def find_touch(self, x: float, y: float) -> float:
        """Return how high a fingertip is that descends at a place and first touches a pin, m."""
        # On a slope it touches the pins beside it first, several millimeters above the surface below it.
        cells, width = self.grid.disc(x, y, self.finger.width), self.finger.width
        square = ((self.grid.x[cells] - x) ** 2 + (self.grid.y[cells] - y) ** 2) / width**2
        gap = self.finger.height * (1.0 - np.sqrt(np.maximum(1.0 - square, 0.0)))
        return float((self.height[cells] - gap).max(initial=0.0))

    def find_lowest(self, stroke: Stroke, x: float, y: float) -> float:
        """Return how low the fingertip is to be at a place of its path, m."""
        sample, surface = stroke.samples[stroke.reached], self.find_surface(x, y)
        if stroke.tracking is None or stroke.brush is Brush.LOWER:
            return max(0.0, surface - sample.depth)
        if stroke.brush is Brush.RAISE:
            top = surface + sample.depth
        else:
            top = surface + sample.share * (self.find_surface(*stroke.place(0)) - surface)
        return max(0.0, min(top, stroke.tracking.highest) - stroke.tracking.sink)


def follow(
    stroke: Stroke, grid: Grid, height: Floats, finger: Fingertip, pose: Floats, count: int, period: float,
    now: float, tracking: Tracking | None = None,
) -> tuple[Stroke, Floats]:  # fmt: skip
    """Advance the fingertip along a press stroke; return the stroke and its path (k + 1, 7), k <= count."""
    if stroke.height is None:
        stroke = replace(_begin(stroke, height, tracking), turn=pose[3:])
    assert stroke.height is not None
    ground, path = Ground(grid, stroke.height, finger, period), [pose]
    safe = max(float(height.max()), float(stroke.height.max())) + CLEARANCE
    while len(path) <= count and not stroke.done:
        stroke, place = _step(stroke, ground, path[-1][:3].tolist(), safe, now)
        turn = advance_turn(stroke, path[-1][3:], place[2] >= safe - NEAR, period)
        path.append(np.array([*place, *turn]))
    return stroke, np.array(path)


def _begin(stroke: Stroke, height: Floats, tracking: Tracking | None) -> Stroke:
    """Return the stroke at its beginning; one whose brush needs a blister only leaves a device without."""
    stroke = replace(stroke, height=height.copy(), phase=ABOVE, tracking=tracking)
    if tracking is None and stroke.brush is not Brush.LOWER:
        return replace(stroke, phase=LEAVING, mirrors=stroke.mirrors[:1])
    return stroke


def _step(stroke: Stroke, ground: Ground, place: Place, safe: float, now: float) -> tuple[Stroke, Place]:
    """Return the stroke after a control period, and where the fingertip is then."""
    x, y, z = place
    stroke = run_clock(stroke, ground.period, now)
    if stroke.phase == ABOVE:
        return cross(replace(stroke, clock=0.0, began=now), (x, y, z), safe, ground.period)
    if stroke.phase == LEAVING:
        lift = LIFT
        if stroke.tracking is not None:
            # Pins that look for the fingertip are not to find it again.
            speed = stroke.tracking.speed
            top = ground.find_lowest(stroke, x, y) + stroke.tracking.sink
            safe, lift = max(safe, top + max(CLEARANCE, SEARCH * speed)), max(LIFT, OUTRUN * speed)
        z = min(safe, z + lift * ground.period)
        return (finish_image(stroke) if z >= safe - NEAR else stroke), (x, y, z)
    move = _press if stroke.tracking is None or stroke.phase == PRESSING else _track
    stroke, (x, y, z) = move(stroke, ground, (x, y, z))
    over = not stroke.held and stroke.reached == len(stroke.samples) - 1
    if stroke.phase == DRAGGING and over and abs(z - ground.find_lowest(stroke, x, y)) < NEAR:
        stroke = replace(stroke, phase=LEAVING)
    return stroke, (x, y, z)


def _press(stroke: Stroke, ground: Ground, place: Place) -> tuple[Stroke, Place]:
    """Press into the surface, or drag at a depth below it."""
    x, y, z = place
    if stroke.phase == DRAGGING:
        stroke, x, y = drag(stroke, x, y, min(DRAG, SPAN * (ground.finger.width / 2)) * ground.period)
    surface = touch = ground.find_surface(x, y)
    # Pins bottom out on the bed's floor.
    if stroke.tracking is None or stroke.brush is Brush.LOWER:
        lowest, after = ground.find_lowest(stroke, x, y), DRAGGING
    else:
        lowest, after = max(0.0, surface - stroke.tracking.press), RISING
    pressing = stroke.phase == PRESSING
    if pressing:
        touch = max(surface, ground.find_touch(x, y))
    z = _sink(z, touch, lowest, ground.period)
    return (replace(stroke, phase=after) if pressing and abs(z - lowest) < NEAR else stroke), (x, y, z)


def _track(stroke: Stroke, ground: Ground, place: Place) -> tuple[Stroke, Place]:
    """Take the blister up, or along; it goes along where the fingertip is at its height."""
    tracking = stroke.tracking
    assert tracking is not None
    x, y, z = place
    lowest = ground.find_lowest(stroke, x, y)
    if stroke.phase == DRAGGING and abs(z - lowest) <= SLACK:
        near = ground.height[ground.grid.disc(x, y, tracking.radius)]
        change = float(np.abs(near - z - tracking.sink).max(initial=NEAR))
        radii = PUSHED if stroke.brush is Brush.LOWER else RADII
        # The pins ahead come to its height in time.
        speed = min(DRAG, radii * tracking.radius, tracking.speed / (tracking.slope * change))
        stroke, x, y = drag(stroke, x, y, speed * ground.period)
        lowest = ground.find_lowest(stroke, x, y)
    z, climb = _climb(z, stroke.climb, lowest, tracking.lift, ground.period)
    risen = stroke.phase == RISING and abs(z - lowest) < NEAR
    return replace(stroke, climb=climb, phase=DRAGGING if risen else stroke.phase), (x, y, z)


def _climb(z: float, climb: float, aim: float, fastest: float, period: float) -> tuple[float, float]:
    """Return height, m, and speed, m/s, after a control period on the way to height `aim`."""
    gain = fastest / SPEED_UP
    far = aim - z
    wanted = math.copysign(min(fastest, math.sqrt(2.0 * gain * abs(far))), far)
    climb += min(max(wanted - climb, -gain * period), gain * period)
    if abs(far) <= max(abs(climb), gain * period) * period:
        return aim, 0.0
    return z + climb * period, climb


def _sink(z: float, surface: float, lowest: float, period: float) -> float:
    """Return the height after a control period on the way to the lowest, m."""
    if z > surface:
        return max(surface, lowest, z - APPROACH * period)
    if z > lowest:
        return max(lowest, z - SPEED * period)
    return min(lowest, z + APPROACH * period)
