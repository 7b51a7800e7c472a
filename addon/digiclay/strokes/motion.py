"""Motion of the fingertip along a press stroke.

The fingertip comes from above, presses to its depth where the mouse went down, goes along the whole
path as fast as the blister of the device can be led, and leaves upwards. It is never ahead of the
hand: where the hand has not drawn further, it waits, and the session with it. So what it does
follows from the path alone. Depth counts from the surface as it was when the finger began, or when
its pass did: pins that give way do not draw the fingertip after them. No Blender in here.

Each image of a path has a fingertip, as far as there are any, and all go at once, side by side as
well. None comes down where a method would take it for another one: the one of the later image
lifts, and waits above until the other one is away, or the hand lets go: then it goes along from the
end, if it is free there. The valves leave the same surface either way. Where images coincide, or
nearly so all along, one is gone along.

A brush that raises presses until the blister starts, and rises to its height there. Every brush
then goes along at its height, up and down over what is formed.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np

from ..core.base.arrays import TIE, Floats
from .nominal import LIMITS, Device, find_nominal, returns
from .pose import lean_finger, turn_image, turn_toward
from .stroke import (
    ABOVE,
    DONE,
    DRAGGING,
    FINISHING,
    LEAVING,
    PRESSING,
    RISING,
    YIELDING,
    Brush,
    Stroke,
    alter,
    needs_blister,
)
from .tracking import SUDDEN, Tracking
from .workspace import Workspace

#: Lowest point of the fingertip, m.
Point = tuple[float, float, float]

#: How fast it crosses the bed above all pins, comes down to them, and leaves, m/s; the last as many
#: times as fast as pins rise, so that no blister follows it up.
CROSS, DESCEND, OUTRUN = 1.0, 0.4, 5.0
#: How fast it comes down the last way, m/s, and how far above the highest pin it passes over the
#: bed, m.
APPROACH, CLEARANCE = 0.1, 4e-3
#: How far the fingertip may be off its height while it goes on along the path, m.
SLACK = 0.5e-3
#: How fast the fingertip turns while it touches, rad/s: as fast as a hand turns a pen, so that tilt
#: read in coarse steps does not jerk it.
TURN = 3.0
#: Force above which a fingertip dragged on uneven ground waits for pins to give way, N, how long at
#: most, s, for pins at their stops never do, and how fast it gains speed, m/s². On "design" two of
#: 15 valleys of 6 mm that begin on the flank of another one take more than 1 N, one of them 76 N;
#: before, six did, up to 535 N.
FIRM, PATIENCE, HURRY = 0.5, 0.1, 1.0

#: Fastest drag where no blister follows, m/s and half widths per second, and fastest press there,
#: m/s. Pressed faster, the fingertip runs into pins whose valves have not opened yet.
DRAG, SPAN, PRESS = 0.1, 30.0, 0.02
#: The fingertip comes down on a slope where it touches a pin so far above the surface below it, m.
UNEVEN = 0.5e-3 + TIE
#: An image comes down no nearer to another one, in largest semi-axes of the fingertip; where all
#: its path is so near to what another one goes along, it leaves that to the valves; so near, in
#: pitches, it is the same. Where two meet none lifts: beside the blister of another one pins then
#: run away upwards.
APART, MERGED, SAME = 1.0, 0.6, 0.5
#: Brushes of which each place of a path leaves the same, whichever way it is gone along.
BOTH_WAYS = (Brush.LOWER, Brush.RAISE)
#: Phases in which it touches, or is about to.
DOWN = (PRESSING, RISING, DRAGGING, LEAVING)


def begin(stroke: Stroke, height: Floats, turn: Floats, tracking: Tracking | None) -> Stroke:
    """Return a stroke as its fingertip begins: heights (n,), m, its orientation (4,), and the blister.

    One whose brush needs a blister only leaves a device without.
    """
    height = height.copy()
    begun = replace(stroke, height=height, ground=height, phase=ABOVE, tracking=tracking, turn=turn)
    if tracking is None and needs_blister(stroke.brush, stroke.falloff):
        return replace(begun, phase=LEAVING, images=stroke.images[:1])
    if stroke.brush not in LIMITS or len(stroke.images) == 1:
        return begun
    return replace(
        begun, parts=tuple(replace(begun, image=image) for image in range(len(stroke.images)))
    )


def follow(
    stroke: Stroke,
    device: Device,
    now: Floats,
    pose: Floats,
    count: int,
    period: float,
    force: float = 0.0,
    hard: float = math.inf,
) -> tuple[Stroke, Floats]:
    """Advance the fingertip along a stroke that has begun; return it and the path (k + 1, 7), k <= count.

    The path ends where the hand has not drawn further, and where the fingertip begins something
    else: it comes down to the pins that stand there, `now` (n,), m. On uneven ground it is dragged
    one period at a time: what it does depends on the force, N; elsewhere it does on one above
    `hard`, N.
    """
    if stroke.phase == PRESSING and stroke.standing is None:
        stroke = _look_down(stroke, device, now, *pose[:2].tolist())
    if stroke.tracking and stroke.phase in (PRESSING, DRAGGING):
        drags = stroke.phase == DRAGGING
        firm = force > min(FIRM, hard)  # only then it counts whether the ground is uneven
        firm = firm and force > (FIRM if drags and _is_uneven(stroke, device, pose) else hard)
        if firm and stroke.waited * period < PATIENCE:
            return replace(stroke, waited=stroke.waited + 1, pace=0.0), np.array([pose, pose])
        stroke = stroke if firm else alter(stroke, waited=0)
        # No farther than to where the force may count.
        count = _count_even(stroke, device, pose, count, period) if drags else count
    space, path = Workspace(device, period, find_safe(stroke, device, now)), [pose]
    while len(path) <= count and stroke.phase not in (FINISHING, DONE):
        step = _step(stroke, space, path[-1][:3].tolist())
        if step is None:
            break
        before, (stroke, place) = stroke, step
        if (stroke.phase, stroke.image) != (before.phase, before.image):
            space = replace(space, safe=find_safe(stroke, device, now))
        turn = _turn(stroke, path[-1][3:], place[2] >= space.safe - TIE, period)
        path.append(np.array([*place, *turn]))
        if stroke.phase != before.phase:
            break
    return stroke, np.array(path)


def _look_down(stroke: Stroke, device: Device, now: Floats, x: float, y: float) -> Stroke:
    """Return the stroke of a fingertip above a place, where it comes down to pins at heights (n,), m."""
    stroke, space = replace(stroke, standing=now.copy()), Workspace(device, 0.0, 0.0)
    touch, lowest = space.find_touch(stroke, x, y), space.find_lowest(stroke, x, y)
    slopes = touch - device.find_surface(now, x, y) > UNEVEN
    return replace(stroke, touch=touch, slopes=slopes, lowest=lowest)


def follow_images(
    stroke: Stroke,
    device: Device,
    now: Floats,
    poses: Floats,
    count: int,
    period: float,
    forces: Floats,
) -> tuple[Stroke, Floats]:
    """Advance m fingertips along the images of a stroke; return it and the paths (k + 1, m, 7), k <= count.

    They begin with the first m images, and go on with those m further on. Where one waits for the
    hand, all do: what they do follows from the path alone. Otherwise as `follow`.
    """
    path, hard = [poses], math.inf
    if (tracking := stroke.tracking) and tracking.hard < math.inf:
        gap = min(
            (math.dist(*pair) for pair in combinations(poses[:, :2].tolist(), 2)), default=math.inf
        )
        count = _count_while(lambda periods: gap >= 2.0 * tracking.reach(periods * period), count)
        if gap < 2.0 * tracking.radius - TIE:
            hard = tracking.hard
    for part in stroke.parts:
        if count > 1:
            count = _count_settled(part, device, poses[part.image % len(poses)], count, period)
    while len(path) <= count and stroke.parts:
        before, (stroke, places) = (
            stroke,
            _follow_once(stroke, device, now, path[-1], period, forces, hard),
        )
        if stroke is before:
            break
        path.append(places)
        if [part.phase for part in stroke.parts] != [part.phase for part in before.parts]:
            break
    return stroke, np.array(path)


def _count_while(holds: Callable[[int], bool], most: int) -> int:
    """Return for how many periods, `most` or a half, a quarter ... of them, something holds; at least 1."""
    while most > 1 and not holds(most):
        most //= 2
    return most


def _count_even(part: Stroke, device: Device, pose: Floats, most: int, period: float) -> int:
    """Return for how many periods a fingertip that drags stays on even ground, `most` at most."""
    return _count_while(lambda periods: not _is_uneven(part, device, pose, periods * period), most)


def _count_settled(part: Stroke, device: Device, pose: Floats, most: int, period: float) -> int:
    """Return for how many periods what an image does follows from its path alone, `most` at most."""
    if part.phase == DRAGGING and part.tracking:
        return _count_even(part, device, pose, most, period)
    standing = part.phase == PRESSING and _stands(part, pose)
    return 1 if part.phase in (ABOVE, YIELDING, PRESSING) and not standing else most


def _stands(part: Stroke, pose: Floats) -> bool:
    """Tell whether an image is so near the pins that it no longer looks at how they stand."""
    # What others form counts until it is near the pins: then it would wait for those that creep.
    return part.standing is not None and bool(pose[2] <= part.touch + CLEARANCE + TIE)


def _follow_once(
    stroke: Stroke,
    device: Device,
    now: Floats,
    poses: Floats,
    period: float,
    forces: Floats,
    hard: float,
) -> tuple[Stroke, Floats]:
    """Advance fingertips by a period; return the stroke, as it is where one waits, and their poses (m, 7)."""
    parts, count, after = list(stroke.parts), len(poses), poses.copy()
    busy = [
        next((part for part in parts[first::count] if not part.left), None)
        for first in range(count)
    ]
    at = {part.image: poses[part.image % count] for part in busy if part}
    for image, pose in sorted(at.items()):
        samples = stroke.samples[::-1] if parts[image].backward else stroke.samples
        part = alter(parts[image], samples=samples, held=stroke.held)
        if part.phase in (PRESSING, YIELDING):
            # A waiting fingertip gives way to all that touch, so that none has to lift off again.
            others = parts if part.phase == YIELDING else parts[:image]
            down = [
                at[other.image] for other in others if other.image in at and other.phase in DOWN
            ]
            part = _yield(part, parts[:image], down, device, now, pose)
        if part.phase == PRESSING and not _stands(part, pose):
            part = replace(part, standing=None)
        part, path = follow(part, device, now, pose, 1, period, float(forces[image % count]), hard)
        if len(path) == 1 and not part.left:
            return stroke, poses
        parts[image], after[image % count] = part, path[-1]
    if all(part.left for part in parts):  # for one more period, without the other fingertips
        last = parts[-1]
        return replace(
            stroke, parts=(), phase=LEAVING, image=last.image, reached=last.reached
        ), after
    return replace(stroke, parts=tuple(parts)), after


def _yield(
    part: Stroke,
    earlier: list[Stroke],
    down: list[Floats],
    device: Device,
    now: Floats,
    pose: Floats,
) -> Stroke:
    """Return the stroke along an image, lifted where an earlier one is too near, of fingertips that are down.

    Above, it comes as far along its path as it coincides with what an earlier one has gone along.
    One that still waits when the hand has let go begins at the end of its path, if it is free
    there.
    """
    earlier = [other for other in earlier if other.backward == part.backward]
    least = APART * max(device.finger.length, device.finger.width) - TIE
    near = any(math.dist(pose[:2], other[:2]) < least for other in down)
    if near and part.phase == PRESSING:
        return replace(part, phase=YIELDING, standing=None, climb=0.0, pace=0.0)
    if part.phase != YIELDING or pose[2] < find_safe(part, device, now) - TIE:
        return part

    fixed = part.held or part.backward or part.accumulate or part.brush not in BOTH_WAYS
    if near and part.tracking and not fixed:
        taken = [*(other[:2].tolist() for other in down), *(other.place(-1) for other in earlier)]
        if all(math.dist(part.place(-1), place) >= least for place in taken):
            return replace(part, samples=part.samples[::-1], reached=0, backward=True, phase=ABOVE)

    def is_same(other: Stroke, index: int, apart: float = SAME * device.grid.layout.pitch) -> bool:
        return math.dist(part.place(index), other.place(index)) < apart - TIE

    for other in earlier:
        while part.reached < other.reached and is_same(other, part.reached):
            if not is_same(other, part.reached + 1):
                break
            part = replace(_reach(part, device, part.reached + 1), phase=ABOVE)
        if part.drawn and other.drawn and is_same(other, part.reached):
            return leave(part)
        gone = range(part.reached, other.reached + 1) if other.standing is not None else ()
        if part.tracking and gone and all(is_same(other, index, MERGED * least) for index in gone):
            return leave(part) if other.drawn else part
    return part if near or part.phase == ABOVE else replace(part, phase=PRESSING)


def _is_uneven(stroke: Stroke, device: Device, pose: Floats, time: float = 0.0) -> bool:
    """Tell whether the ground is uneven that the blister is over, or comes over in a time, s."""
    assert stroke.ground is not None
    assert stroke.tracking is not None
    near = device.grid.disc(pose[0], pose[1], stroke.tracking.reach(time))
    return near.size > 0 and bool(np.ptp(stroke.ground[near]) > UNEVEN)


def find_safe(stroke: Stroke, device: Device, now: Floats) -> float:
    """Return a height above all pins, m, `now` at heights (n,), m, and above what the stroke raises."""
    assert stroke.height is not None
    highest = float(stroke.height.max())
    # Before the fingertip is down for the first time nothing is raised, and not all of the path is
    # known.
    if len(stroke.images) > 1 and stroke.phase in (ABOVE, YIELDING):
        # In whole steps, else it would wait until pins that others form have crept to their
        # heights.
        highest = CLEARANCE * math.ceil(max(highest, float(now.max())) / CLEARANCE - TIE)
    elif stroke.brush.rises and stroke.phase != ABOVE:
        raised = max(sample.depth for sample in stroke.samples)
        highest = device.highest if stroke.accumulate else min(highest + raised, device.highest)
    return highest + CLEARANCE


def cross(stroke: Stroke, place: Point, safe: float, period: float) -> tuple[Stroke, Point]:
    """Rise to a safe height, m, then cross to the path's first place, or to where it is gone along next."""
    x, y, z = place
    if z < safe - TIE:
        return stroke, (x, y, min(safe, z + DESCEND * period))
    to_x, to_y = stroke.place(stroke.reached)
    far, length = math.hypot(to_x - x, to_y - y), CROSS * period
    if far > length + TIE:
        return stroke, (x + (to_x - x) * length / far, y + (to_y - y) * length / far, z)
    return replace(stroke, phase=PRESSING), (to_x, to_y, z)


def drag(
    stroke: Stroke, device: Device, x: float, y: float, length: float
) -> tuple[Stroke, float, float] | None:
    """Return the stroke and its place, m, a length further along its path; None: the hand is not that far."""
    for reached in range(stroke.reached + 1, len(stroke.samples)):
        to_x, to_y = stroke.place(reached)
        far = math.hypot(to_x - x, to_y - y)
        if far > length + TIE:
            return stroke, x + length / far * (to_x - x), y + length / far * (to_y - y)
        x, y, length, stroke = to_x, to_y, length - far, _reach(stroke, device, reached)
    return None if stroke.held else (stroke, x, y)


def _reach(stroke: Stroke, device: Device, reached: int) -> Stroke:
    """Return the stroke with its fingertip at a sample, which may begin another pass."""
    if stroke.brush in LIMITS and returns(stroke, stroke.first, reached, device.finger.width):
        assert stroke.height is not None
        earlier = replace(stroke, samples=stroke.samples[:reached])
        ground = find_nominal(earlier, device, stroke.height).full
        stroke = replace(stroke, ground=ground, first=reached)
    return replace(stroke, reached=reached)


def leave(stroke: Stroke) -> Stroke:
    """Return the stroke that the fingertip has left, with the wait for its pins, if valves drive any."""
    return replace(stroke, phase=FINISHING if stroke.tracking else DONE, waited=0)


def _step(stroke: Stroke, space: Workspace, place: Point) -> tuple[Stroke, Point] | None:
    """Return the stroke after a control period, and where the fingertip is then; None: it has to wait."""
    x, y, z = place
    if stroke.phase == ABOVE:
        return cross(stroke, place, space.safe, space.period)
    if stroke.phase in (LEAVING, YIELDING):
        # Pins that look for the fingertip are not to find it again.
        lift = max(DESCEND, OUTRUN * stroke.tracking.speed) if stroke.tracking else DESCEND
        above = min(space.safe, z + lift * space.period)
        if stroke.phase == YIELDING:
            return stroke, (x, y, max(z, above))
        return (leave(stroke) if above >= space.safe - TIE else stroke), (x, y, above)
    if stroke.placed:
        return _wait_for_hand(stroke, space, place)
    if stroke.phase == PRESSING:
        return _press(stroke, space, place)
    if stroke.phase == RISING:
        stroke, z = _climb(stroke, z, stroke.lowest, space.period)
        return replace(stroke, phase=DRAGGING if abs(z - stroke.lowest) < TIE else RISING), (
            x,
            y,
            z,
        )
    return _drag_on(stroke, space, place)


def _wait_for_hand(stroke: Stroke, space: Workspace, place: Point) -> tuple[Stroke, Point] | None:
    """Wait above the pins until the hand has drawn; then the valves form all images."""
    x, y, z = place
    if stroke.held:
        return None
    if z < space.safe - TIE:
        return stroke, (x, y, min(space.safe, z + DESCEND * space.period))
    return replace(stroke, phase=FINISHING, image=len(stroke.images) - 1), place


def _press(stroke: Stroke, space: Workspace, place: Point) -> tuple[Stroke, Point]:
    """Come down to the pins, and press into them: to the depth of the stroke, or until a blister starts."""
    x, y, z = place
    lowest, touch, after, fastest = stroke.lowest, stroke.touch, DRAGGING, PRESS
    if stroke.tracking:
        # Felt beside its lowest point alone, a fingertip is lost when it is quick.
        fastest = min(stroke.tracking.sink_speed, PRESS if stroke.slopes else math.inf)
        if stroke.brush is not Brush.LOWER:
            pressed = max(0.0, touch - stroke.tracking.press)
            lowest, after = space.pass_over_locked(stroke, x, y, pressed), RISING
    touch = max(touch, lowest)
    if stroke.tracking:
        # Stopped at once it would be lost: the pins below it go on.
        braked = math.sqrt(2.0 * SUDDEN * max(z - lowest, 0.0))
        fastest = min(fastest, max(braked, SUDDEN * space.period))
    # One limit after the other, the last that it comes to.
    for end, speed in ((touch + CLEARANCE, DESCEND), (touch, APPROACH), (lowest, fastest)):
        if z > end + TIE:
            z = max(end, z - speed * space.period)
            break
    return alter(stroke, phase=after if z - lowest < TIE else PRESSING), (x, y, z)


def _drag_on(stroke: Stroke, space: Workspace, place: Point) -> tuple[Stroke, Point] | None:
    """Go along the path at the height of the stroke; a blister goes along where the fingertip is near it."""
    (x, y, z), tracking, device = place, stroke.tracking, space.device
    lowest = stroke.lowest
    if tracking is None or abs(z - lowest) <= SLACK:
        if stroke.drawn and abs(z - lowest) < TIE:
            return replace(stroke, phase=LEAVING), place
        speed = min(DRAG, SPAN * (device.finger.width / 2))
        if tracking:
            assert stroke.ground is not None
            change = 0.0
            if tracking.slope and not tracking.ready:  # else pins ahead are there in time anyway
                near = stroke.ground[device.grid.disc(x, y, tracking.radius)]
                change = float(np.abs(near - z - tracking.sink).max(initial=0.0))
            speed = tracking.limit_drag(change, pressed=stroke.brush is Brush.LOWER)
            speed = min(speed, stroke.pace + HURRY * space.period)
        dragged = drag(stroke, device, x, y, speed * space.period)
        if dragged is None:
            return None
        stroke, x, y = dragged
        lowest = space.find_lowest(stroke, x, y)
        stroke = alter(stroke, pace=speed if tracking else 0.0, lowest=lowest)
    if tracking is None:
        return stroke, (x, y, max(lowest, z - PRESS * space.period) if z > lowest else lowest)
    stroke, z = _climb(stroke, z, lowest, space.period)
    return stroke, (x, y, z)


def _climb(stroke: Stroke, z: float, aim: float, period: float) -> tuple[Stroke, float]:
    """Return the stroke, and the height, m, after a control period on the way to height `aim`."""
    assert stroke.tracking is not None
    far, gain = aim - z, stroke.tracking.gain
    fastest = stroke.tracking.lift if far > 0.0 else stroke.tracking.sink_speed
    wanted = math.copysign(min(fastest, math.sqrt(2.0 * gain * abs(far))), far)
    climb = stroke.climb + min(max(wanted - stroke.climb, -gain * period), gain * period)
    if abs(far) <= max(abs(climb), gain * period) * period:
        return alter(stroke, climb=0.0), aim
    return alter(stroke, climb=climb), z + climb * period


def _turn(stroke: Stroke, turn: Floats, clear: bool, period: float) -> Floats:
    """Return the fingertip's orientation (4,) after a control period; above all pins it turns at once."""
    assert stroke.turn is not None
    if stroke.phase in (FINISHING, DONE):
        return stroke.turn
    leaning = lean_finger(stroke.turn, stroke.samples[stroke.reached].lean)
    aim = turn_image(leaning, stroke.images[stroke.image])
    return aim if clear else turn_toward(turn, aim, TURN * period)
