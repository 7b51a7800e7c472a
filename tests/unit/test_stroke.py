"""Strokes of the Press tool: path, orientation and motion of the fingertip, the queue; the hand's input."""

import math
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.model.fingertip import LEVEL, Fingertip, make_matrices
from digiclay.core.model.layout import Layout, make_grid
from digiclay.press.pointer import (
    CURVE_ITEMS,
    FULL_TILT,
    begin_button,
    find_lean,
    find_share,
    read_event,
)
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_stroke
from digiclay.sessions.sculpting import drop_strokes
from digiclay.strokes import motion
from digiclay.strokes.nominal import Device
from digiclay.strokes.pose import lean_finger, turn_image, turn_toward
from digiclay.strokes.stroke import (
    ALONE,
    DEEPEST,
    Brush,
    deepen,
    draw,
    lay_line,
    lay_path,
    lay_ring,
    let_go,
    make_images,
    pull,
    start,
)
from numpy.testing import assert_allclose, assert_array_equal

from tests.assemble import table
from tests.hand import TICK, risen, started
from tests.strokes import form, lay, queue

pytestmark = pytest.mark.usefixtures("quick_machine")

CELLS = make_grid(Layout(rows=20, columns=20))
PERIOD = 5e-3
#: A level bed with one pin that stands out, m.
HEIGHT = np.full(CELLS.count, 0.040)
HEIGHT[0] = 0.055
AT = np.array([0.0, 0.0, 0.046, *LEVEL])


DEVICE = Device(CELLS, Fingertip(), None, 0.08)


def line(moves=20, **more):
    """Return a stroke along x from (0, 5) mm to (20, 5) mm, 4 mm deep, in so many moves."""
    return lay(np.linspace((0.0, 5.0), (20.0, 5.0), moves + 1), Brush.LOWER, **more)


def begin(stroke, bed=HEIGHT, at=AT):
    """Return a stroke that begins with the finger at a pose, without a blister."""
    return motion.begin(stroke, bed, at[3:], None)


def waiting(fingers):
    """Return the poses of fingers that begin in one place."""
    return np.repeat(AT[None], fingers, axis=0)


def path(stroke, at=AT, chunk=4000, bed=HEIGHT):
    """Let the finger go on as far as it is drawn, a chunk of periods at a time, without a blister."""
    stroke, poses = lead(begin(stroke, bed, at), at[None], chunk, bed)
    return stroke, poses[:, 0]


def lead(stroke, at, chunk=4000, bed=HEIGHT, creep=0.0):
    """Let fingers at poses (m, 7) go on along a stroke that has begun; return their poses (t, m, 7)."""
    poses, part, forces = [at], at[None], np.zeros(len(at))
    while not stroke.done and (len(part) > 1 or len(poses) == 1) and len(poses) < 4000:
        bed = bed + creep
        if stroke.parts:
            stroke, part = motion.follow_images(
                stroke, DEVICE, bed, poses[-1], chunk, PERIOD, forces
            )
        else:
            stroke, part = motion.follow(stroke, DEVICE, bed, poses[-1][0], chunk, PERIOD)
            part = np.repeat(part[:, None], len(at), axis=1)
        poses += list(part[1:])
    return stroke, np.array(poses)


def pressed(poses):
    """Return the poses at full depth."""
    return poses[np.abs(poses[:, 2] - 0.036) < 1e-9]


@pytest.mark.parametrize("moves", [1, 20, 1000])
def test_the_finger_goes_along_the_whole_path_however_quick_the_hand(moves):
    stroke, poses = path(line(moves=moves))
    assert stroke.done
    assert poses[np.argmax(poses[:, 2] <= 0.036 + 1e-9), 0] == 0.0  # first to its depth
    down = pressed(poses)
    assert (down[0, 0], down[-1, 0]) == pytest.approx((0.0, 0.02), abs=1e-12)
    assert draw(stroke, 0.03, 0.0, 4e-3) is stroke, "the hand has let go"
    # No column is skipped: a control period is DRAG times its length at the most.
    assert np.diff(down[:, 0]).max() <= motion.DRAG * PERIOD + 1e-12


#: Of 21 places, how many are drawn first, and periods at a time.
@pytest.mark.parametrize("shown, chunk", [(1, 7), (3, 1), (11, 4000), (20, 7)])
@pytest.mark.parametrize("fingers", [1, 2])
@pytest.mark.parametrize("away", [0.0, 20e-3], ids=["from the axis", "apart"])
def test_the_way_follows_from_the_path_alone_and_is_never_ahead_of_the_hand(
    away, fingers, chunk, shown
):
    whole = line(images=make_images("X", center=(-away, 0.0)))
    at = waiting(fingers)
    part = begin(replace(whole, samples=whole.samples[:shown], held=True))
    part, first = lead(part, at, chunk)
    assert not part.done
    # Each goes along its image no further than the hand has drawn; with one finger the second one
    # waits.
    assert (first[:, 0, 0] + away).max() <= whole.samples[shown - 1].x + away
    assert (-first[:, -1, 0] - away).max() <= whole.samples[shown - 1].x + away
    assert fingers == 2 or part.parts[1].reached == 0
    poses, stroke = [*first], replace(part, samples=whole.samples, held=False)
    done, more = lead(stroke, poses[-1], chunk)
    assert done.done
    assert_array_equal(np.array([*poses, *more[1:]]), lead(begin(whole), at)[1])


@table(
    "drawn, images, pressing, longer, nearest",
    {
        "two wait for two that are near": ([(20, 4), (26, 4)], make_images("XY"), 2, 120, 9.9),
        "side by side all press": ([(20, 5.1), (26, 5.1)], make_images("XY"), 4, 1, 10.2),
        "they come nearer to each other": ([(9, 28), (2, -28)], make_images("X"), 2, 1, 4),
        "on the axis one presses": ([(0, -20), (0, 20)], make_images("X"), 1, 1, 99),
        "or within half a pitch": ([(0.7, -20), (0.7, 20)], make_images("X"), 1, 1, 99),
        "a click in the middle": ([(0, 0), (0, 0)], make_images("RADIAL", 24), 1, 1, 99),
        "beside the axis one is behind": ([(4, -28), (4, 28)], make_images("X"), 2, 120, 9.9),
        "across the axis they meet": ([(28, -20), (-28, 28)], make_images("X"), 2, 1, 0),
    },
)
def test_of_images_that_are_near_one_gives_way(drawn, images, pressing, longer, nearest):
    places = np.linspace(*np.array(drawn, float), 57)
    alone = len(path(lay(places, Brush.LOWER))[1])
    done, poses = lead(begin(lay(places, Brush.LOWER, images=images)), waiting(len(images)))
    assert done.done
    assert len(poses) - alone <= longer
    down = poses[..., 2] < 40e-3
    assert down.sum(axis=1).max() == pressing
    # Two that come down are half a finger apart; two that go along may meet.
    apart = np.linalg.norm(poses[:, :, None, :2] - poses[:, None, :, :2], axis=-1)
    apart[~(down[:, :, None] & down[:, None])] = np.inf
    apart[:, *np.diag_indices(len(images))] = np.inf
    assert apart.min() >= 1e-3 * nearest - 1e-9
    pressed_at = poses[..., :2][poses[..., 2] < 36e-3 + 1e-9]
    for image in images:
        for place in 1e-3 * places[[0, 20, -1]]:
            assert np.linalg.norm(pressed_at - image.place(*place), axis=1).min() < 1.5e-3


def test_one_that_waits_comes_down_although_pins_creep_up():
    places = np.linspace([4.0, -28.0], [4.0, 28.0], 57)
    stroke = lay(places, Brush.LOWER, images=make_images("X"))
    assert lead(begin(stroke), waiting(2), 1, creep=5e-9)[0].done


@pytest.mark.parametrize(
    "bed, lowest, end", [(HEIGHT, 36e-3, 59e-3), (HEIGHT * 0 + 1e-3, 0.0, None)]
)
def test_a_click_presses_no_deeper_than_the_floor_and_ends_above_all_pins(bed, lowest, end):
    stroke, poses = path(lay([(10.0, 5.0)], Brush.LOWER), bed=bed)
    assert stroke.done
    z = poses[:, 2]
    assert z.min() == pytest.approx(lowest, abs=1e-9)
    assert end is None or z[-1] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("by, depth", [(-1.0, 0.1e-3), (1.0, DEEPEST), (1e-3, 5e-3)])
def test_the_depth_stays_within_what_can_be_pressed(by, depth):
    assert deepen(start(1, 0.0, 0.0, 4e-3), by).samples[-1].depth == pytest.approx(depth, rel=1e-12)


#: Symmetries: how they are made, and where a place (x, y) comes to, by complex numbers.
IMAGES = {
    "none": (ALONE, lambda z: [z]),
    "x": (make_images("X"), lambda z: [z, -z.conjugate()]),
    "y": (make_images("Y"), lambda z: [z, z.conjugate()]),
    "both": (make_images("XY"), lambda z: [z, -z.conjugate(), -z, z.conjugate()]),
    "across the diagonal": (
        make_images("X", angle=-math.pi / 4),
        lambda z: [z, 1j * z.conjugate()],
    ),
    "about a line at x = 5 mm": (
        make_images("X", center=(5e-3, 9.0)),
        lambda z: [z, 10e-3 - z.conjugate()],
    ),
    "three turns": (
        make_images("RADIAL", 3),
        lambda z: [z * np.exp(2j * np.pi * k / 3) for k in range(3)],
    ),
    "a turn about (2, 1) mm": (
        make_images("RADIAL", 2, (2e-3, 1e-3)),
        lambda z: [z, 4e-3 + 2e-3j - z],
    ),
}


@pytest.mark.parametrize("name", IMAGES)
def test_the_finger_goes_along_the_path_and_along_each_of_its_images(name):
    images, turn = IMAGES[name]
    stroke, poses = path(line(images=images))
    assert stroke.done
    down = pressed(poses)
    for end in (0.005j, 0.02 + 0.005j):
        for there in turn(end):
            assert np.abs(down[:, 0] + 1j * down[:, 1] - there).min() < 1e-12
    # Between two of them it crosses above all pins: once more than there are images it is up there.
    top = poses[:, 2] > 0.059 - 1e-9
    assert np.count_nonzero(np.diff(top.astype(int)) == 1) == 1 + len(images)


def test_a_finger_slows_down_above_the_highest_pin_below_it():
    # 1 mm beyond where the surface below the finger counts.
    beside = np.where(CELLS.x > 5e-3, 0.050, 0.040)
    _, poses = path(lay([(0.0, 0.0)], Brush.LOWER), bed=beside)
    z = poses[:, 2]
    cells = np.hypot(CELLS.x, CELLS.y) < 8e-3
    gap = 8e-3 - np.sqrt(64e-6 - (CELLS.x**2 + CELLS.y**2)[cells])
    touch = float((beside[cells] - gap).max())
    down = -np.diff(z) / PERIOD
    assert motion.APPROACH < down.max() <= motion.DESCEND * (1.0 + 1e-6)
    assert down[z[:-1] <= touch + motion.CLEARANCE].max() == pytest.approx(
        motion.APPROACH, rel=1e-6
    )
    assert down[z[:-1] <= touch + 1e-9].max() <= motion.PRESS + 1e-9


@pytest.mark.parametrize(
    "place, mouse, string, pulled",
    [
        ((1e-3, 2e-3), (3e-3, 2e-3), 2.5e-3, (1e-3, 2e-3)),
        ((0.0, 0.0), (10e-3, 0.0), 4e-3, (6e-3, 0.0)),
        ((0.0, 0.0), (3e-3, 4e-3), 0.0, (3e-3, 4e-3)),
    ],
    ids=["within the string", "at its length", "without a string"],
)
def test_the_mouse_pulls_a_place_behind_it(place, mouse, string, pulled):
    assert pull(place, mouse, string) == pytest.approx(pulled, rel=1e-12, abs=1e-15)


def test_a_ring_keeps_its_radius_and_is_closed_and_a_laid_path_is_let_go():
    points = lay_ring((2e-3, -1e-3), (2e-3, 9e-3))
    assert_allclose(np.linalg.norm(points - [2e-3, -1e-3], axis=1), 10e-3, rtol=1e-12)
    assert_allclose(points[0], points[-1], atol=1e-15)
    assert_allclose(points[0], [2e-3, 9e-3], atol=1e-15)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 1e-3 + 1e-12
    # Without a radius it is a place.
    assert_array_equal(lay_ring((1e-3, 2e-3), (1e-3, 2e-3)), [[1e-3, 2e-3]])
    stroke = lay_path(start(3, 0.0, 0.0, 4e-3), lay_line((0.0, 0.0), (30e-3, 40e-3)))
    assert not stroke.held
    assert [one.depth for one in stroke.samples] == [4e-3, 4e-3]
    assert (stroke.samples[-1].x, stroke.samples[-1].y) == (30e-3, 40e-3)


UPRIGHT = np.array(LEVEL)
#: A quarter of a right angle about the vertical: a finger that points between the rows.
TWISTED = np.array([np.cos(np.pi / 16), 0.0, 0.0, np.sin(np.pi / 16)])


def matrix(turn):
    """Return the rotation matrix of a quaternion."""
    return make_matrices(turn[None])[0]


@pytest.mark.parametrize("lean", [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4)])
def test_the_top_of_the_finger_goes_where_it_leans_by_the_angle(lean):
    top = matrix(lean_finger(UPRIGHT, lean))[:, 2]
    angle = np.hypot(*lean)
    assert_allclose(top[:2], np.array(lean) / angle * np.sin(angle), atol=1e-12)
    assert_array_equal(lean_finger(TWISTED, (0.0, 0.0)), TWISTED)


@pytest.mark.parametrize("name", IMAGES)
def test_the_orientation_of_an_image_is_that_of_the_ellipsoids_image_and_near_to_its_own(name):
    turn, form = lean_finger(TWISTED, (0.4, -0.2)), np.diag([1.0, 4.0, 9.0])
    for image in IMAGES[name][0]:
        flat = np.array([[image.xx, image.xy, 0.0], [image.yx, image.yy, 0.0], [0.0, 0.0, 1.0]])
        there, own = matrix(turn_image(turn, image)), matrix(turn)
        wanted = flat @ own @ form @ own.T @ flat.T
        assert_allclose(there @ form @ there.T, wanted, atol=1e-12)
        assert np.trace(there @ own.T) >= 0.8, "it turns by no more than some 90 degrees"


def test_a_pen_that_is_jerked_turns_the_finger_no_faster_than_a_hand_to_its_aim():
    aim, turn, angles = -lean_finger(UPRIGHT, (0.5, 0.0)), UPRIGHT, []
    for _ in range(6):
        before, turn = turn, turn_toward(turn, aim, 0.1)
        angles.append(2.0 * np.arccos(min(1.0, abs(before @ turn))))
    assert_allclose(angles, [0.1] * 5 + [0.0], atol=1e-7)
    assert_allclose(matrix(turn), matrix(aim), atol=1e-12)
    stroke = draw(start(1, 0.0, 0.0, 4e-3), 0.02, 0.0, 4e-3, lean=(0.8, 0.0))
    down = pressed(path(let_go(stroke))[1])
    turned = 2.0 * np.arccos(np.clip(np.abs((down[1:, 3:] * down[:-1, 3:]).sum(1)), 0.0, 1.0))
    assert 0.5 * motion.TURN * PERIOD < turned.max() <= motion.TURN * PERIOD * (1.0 + 1e-6)


@pytest.mark.parametrize("name", ["none", "both", "three turns"])
def test_the_finger_leans_with_the_pen_on_each_image_and_ends_as_it_began(name):
    images = IMAGES[name][0]
    stroke, poses = path(line(images=images, lean=(0.4, 0.2)), np.array([*AT[:3], *TWISTED]))
    assert stroke.done
    assert_array_equal(poses[-1, 3:], TWISTED)
    down = pressed(poses)
    for image in images:
        wanted = turn_image(lean_finger(TWISTED, (0.4, 0.2)), image)
        x, y = image.place(0.01, 0.005)
        side = down[np.hypot(down[:, 0] - x, down[:, 1] - y) < 5e-3]
        assert len(side) > 10
        assert_allclose(side[:, 3:], np.broadcast_to(wanted, (len(side), 4)), atol=1e-9)


def test_a_stroke_that_is_dropped_leaves_a_finger_that_does_not_lean():
    held = start(0, 0.0, 0.0, 4e-3, lean=(0.5, 0.0))
    session = queue(started(), held)
    before = session.pose[3:].copy()
    for step in range(1, 10):
        session = sculpting.advance(session, session.pose, step * TICK, 100)
    assert len(session.strokes) == 1
    assert abs(session.pose[3:] @ before) < 0.99
    assert_array_equal(drop_strokes(session).pose[3:], before)


def test_of_several_the_last_is_taken_back_first_and_never_begins():
    session = queue(started(), *(lay([(x, 0.0)], Brush.LOWER) for x in (-15.0, 15.0)))
    number = session.strokes[-1].number
    assert sculpting.reset(session).strokes == ()
    back = sculpting.rewind(session)
    assert find_stroke(back, number) is None
    done = form(back)
    assert risen(done, -15.0, 0.0) < -2e-3  # of 4 mm
    assert risen(done, 15.0, 0.0) == 0.0


# Input of the hand: pressure and tilt of a pen, and a mouse button that is up

CURVES = [item[0] for item in CURVE_ITEMS]


def test_a_curve_goes_from_nothing_to_all_a_soft_pen_s_deepest_and_nonsense_does_no_harm():
    soft, linear, firm = (find_share(0.5, curve) for curve in CURVES)
    assert (soft, linear, firm) == (pytest.approx(math.sqrt(0.5)), 0.5, 0.25)
    for curve in CURVES:
        shares = [find_share(pressure / 100, curve) for pressure in range(101)]
        assert (shares[0], shares[-1], shares) == (0.0, 1.0, sorted(shares))
        odd = [find_share(pressure, curve) for pressure in (-1.0, 7.0, math.inf, math.nan)]
        assert odd == [0.0, 1.0, 1.0, 1.0]


#: A view from above with its up along y; one from the front and above; one level with the bed.
ABOVE = np.eye(3)
FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
BESIDE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


#: One turned on its side: its right is along the pins.
TURNED = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    "tilt, seen, lean",
    [
        ((1.0, 0.0), ABOVE, (1.0, 0.0)),
        ((1.0, 0.0), FRONT, (1.0, 0.0)),
        # Towards the user is down in the view.
        ((0.0, 0.5), ABOVE, (0.0, -0.5)),
        ((0.0, 0.5), FRONT, (0.0, -0.5)),
        # In a level view the far side is behind the bed.
        ((1.0, 0.0), BESIDE, (0.0, 1.0)),
        ((0.0, -1.0), BESIDE, (-1.0, 0.0)),
        ((0.0, -1.0), TURNED, (1.0, 0.0)),
        # No pen leans farther than full tilt, and nonsense is upright.
        ((1.0, 1.0), ABOVE, (0.5**0.5, -(0.5**0.5))),
        ((math.nan, 0.0), ABOVE, (0.0, 0.0)),
        ((0.0, math.inf), ABOVE, (0.0, 0.0)),
        ((0.0, 0.0), ABOVE, (0.0, 0.0)),
    ],
)
def test_a_pen_leans_over_the_bed_as_over_the_tablet(tilt, seen, lean):
    assert find_lean(tilt, seen) == pytest.approx((FULL_TILT * lean[0], FULL_TILT * lean[1]))


DOWN, UP = ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")
KEY, KEY_UP = ("Z", "PRESS"), ("Z", "RELEASE")


def is_up(begins, *events):
    """Return whether the button is taken to be up after each event of a stroke."""
    button, found = begin_button(*begins), []
    for kind, named in events:
        button = read_event(button, kind, named)
        found.append(button.up)
    return found


@pytest.mark.parametrize(
    "kind", ["TIMER", "TIMER_REPORT", "TIMER_JOBS", "MOUSEMOVE", "INBETWEEN_MOUSEMOVE"]
)
def test_the_release_of_the_stroke_before_is_not_that_of_this_one(kind):
    # Timers of Blender, such as that of a message in the status bar, and copied moves name it all
    # along.
    copied = [(kind, UP), ("TIMER", UP)] * 3
    assert not any(is_up(("PRESS", UP), *copied))


HOME = ("HOME", "RELEASE")
#: The event that begins a stroke, and others in it, of which the last alone may tell the release.
STROKES = {
    "moves and wheel in the second stroke leave it pressed": (
        ("PRESS", UP),
        ("MOUSEMOVE", DOWN),
        ("TIMER", UP),
        ("WHEELUPMOUSE", DOWN),
        ("TIMER_REPORT", UP),
    ),
    "the next move tells a release that a pie menu takes": (
        ("PRESS", UP),
        ("MOUSEMOVE", DOWN),
        ("Z", DOWN),
        ("TIMER", DOWN),
        ("TIMER", KEY),
        ("TIMER", KEY_UP),
        ("MOUSEMOVE", UP),
    ),
    "a timer after another key tells it": (("PRESS", UP), ("TIMER", KEY), ("TIMER", UP)),
    "a move tells it after the first press of all: no other release can be named": (
        ("PRESS", HOME),
        ("TIMER", HOME),
        ("MOUSEMOVE", UP),
    ),
    # A drag is a move: it names the press itself, and a move copied from Blender's record what was
    # before.
    "a stroke begun by a drag learns from a timer what was before": (
        ("CLICK_DRAG", DOWN),
        ("MOUSEMOVE", UP),
        ("TIMER", UP),
        ("TIMER_REPORT", UP),
    ),
    "then a move after another key tells it": (
        ("CLICK_DRAG", DOWN),
        ("TIMER", UP),
        ("TIMER", KEY),
        ("MOUSEMOVE", UP),
    ),
}
LEFT_PRESSED = ("leave it pressed", "what was before")


@pytest.mark.parametrize("words", STROKES)
def test_a_release_is_told_by_what_later_events_name(words):
    begins, *events = STROKES[words]
    assert is_up(begins, *events) == [False] * (len(events) - 1) + [
        not words.endswith(LEFT_PRESSED)
    ]
