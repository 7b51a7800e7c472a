"""Symmetric press strokes in a session: all images at once, in the time of one, and nothing is lost."""

import math
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.session import snapshot
from digiclay.core.session.take import from_bytes, make_take, to_bytes
from digiclay.recorded.takes import read_recording
from digiclay.sessions.running import list_pressing
from digiclay.sessions.sculpting import (
    advance,
    begin_session,
    change_scene,
    change_stroke,
    drop_strokes,
    follow_finger,
    restore,
    rewind,
    set_recording,
)
from digiclay.settings.devices import make_scene
from digiclay.strokes.stroke import (
    ALONE,
    FINISHING,
    PRESSING,
    YIELDING,
    Brush,
    lay_path,
    make_images,
)
from numpy.testing import assert_allclose, assert_array_equal

from tests.assemble import assert_near, replayed, table
from tests.hand import heights
from tests.strokes import copy, find_ghost, form, lay, queue

#: Pins on a side, their distance, m, and the height at which the fingertip waits, m.
COUNT, PITCH, ABOVE = 41, 1.5e-3, 46e-3


def begin(method="virtual_master", fingers=1):
    """Return a session that is recorded, of fingertips of which only the first one is near the bed."""
    scene = make_scene("paper", Layout(COUNT, COUNT, PITCH), method, 0.5).with_fingers(fingers)
    poses = np.array([[0.3 * number, 0.0, ABOVE, *LEVEL] for number in range(fingers)])
    return set_recording(begin_session(7, "Bed", scene, poses)[0], True)


def draw(session, path, images, brush=Brush.LOWER):
    """Queue a stroke of 4 mm along a path, mm."""
    return queue(session, lay(path, brush, images=images))


def line(x, y, end_x, end_y):
    """Return a path that a hand has drawn, mm."""
    return np.linspace((x, y), (end_x, end_y), 30)


def go_on(session, periods):
    """Simulate so many periods of the strokes."""
    end = session.state.period + periods
    while session.state.period < end:
        session = follow_finger(session, session.poses, 1)
    return session


def keep(session):
    """Return what a session has recorded, read from bytes."""
    take = make_take(session.scene, session.recording, session.snapshot)
    return from_bytes(to_bytes(take))


#: A path that stays apart from its images, and from the pins' rows, mm.
APART = line(20.0, 8.5, 23.0, 9.5)
#: Method and brush; images on whole pins, how they turn a table of pins, and the pins by which their
#: center is off the middle.
ALIKE = {
    "four turns": ("virtual_master", Brush.LOWER, make_images("RADIAL", 4), np.rot90, (0, 0)),
    "a diagonal": (
        "virtual_master", Brush.RAISE, make_images("Y", angle=math.pi / 4), np.transpose, (0, 0),
    ),
    "four turns about another place": (
        "hybrid", Brush.RAISE, make_images("RADIAL", 4, (3e-3, -1.5e-3)), np.rot90, (-1, 2),
    ),
    "two turns": (
        "cell_states", Brush.LOWER, make_images("RADIAL", 2), lambda pins: np.rot90(pins, 2), (0, 0),
    ),
    "x": ("plastic", Brush.LOWER, make_images("X"), np.fliplr, (0, 0)),
}  # fmt: skip


@table("method, brush, images, turn, off", ALIKE)
def test_images_form_alike_in_the_time_of_one_and_are_replayed_bit_for_bit(
    method, brush, images, turn, off
):
    alone, session = (
        form(begin(method), lay(APART, brush, images=many)) for many in (ALONE, images)
    )
    # One period more, without the fingertips of the images; noise of the valves may take another
    # look.
    assert session.state.period - alone.state.period in (1, 5)
    pins = 1e3 * heights(session).reshape(COUNT, COUNT) - 40.0
    part = np.roll(pins, np.negative(off), (0, 1))[5:-5, 5:-5]
    # Valves place pins to 1 µm; pins that only give way differ by the order in which fingertips
    # press them.
    assert_near(part, turn(part), 0.03 if method == "plastic" else 2e-3)
    assert np.abs(part).max() > 2.5
    assert (session.poses.shape, session.system.fingers, len(session.gestures)) == ((1, 7), 1, 1)
    take = keep(session)
    assert take.poses.shape == (session.state.period + 1, len(images), 7)
    assert replayed(take)


ONE, LOWER, RAISE = "virtual_master", Brush.LOWER, Brush.RAISE
X = make_images("X")
RAYS = make_images("RADIAL", 8, (1.1e-3, -0.7e-3))
#: As a hand draws along an axis: up to 1.4 mm beside it.
WAVE = np.column_stack([0.9 + 0.5 * np.sin(np.linspace(0, 9, 30)), np.linspace(-9, 9, 30)])


def follow_to_the_end(session, periods=8):
    """Return a session whose strokes are finished, its greatest force, N, and last heights.

    The heights are those when the fingertips have left, before the valves finish.
    """
    force, left = 0.0, heights(session)
    while session.strokes:
        session = follow_finger(session, session.poses, periods)
        force = max(force, float(session.state.finger_forces().max()))
        if session.strokes and session.strokes[0].phase != FINISHING:
            left = heights(session)
    return session, force, left


#: Images that are near each other, or meet: method, brush, path, mm, images, and greatest time, as
#: a multiple of that of one.
MEETING = {
    "on the axis one presses": ("hybrid", RAISE, line(0, -9, 0, 9), X, 1.1),
    "Method II, at forces at which others wait": ("cell_states", LOWER, line(4, -6, 4, 6), X, 1.05),
    "nearer, one follows": (ONE, LOWER, line(1.6, -6, 1.6, 6), X, 1.6),
    "by hand along the axis, one presses": (ONE, LOWER, WAVE, X, 1.15),
    "a click in a small ring, every other one": (
        ONE,
        LOWER,
        line(8, 0, 8, 0),
        make_images("RADIAL", 24),
        2.0,
    ),
    "towards the axis, nearer than one may come down": (ONE, LOWER, line(11, -9, 1, 9), X, 1.1),
    "across the axis both go on": (ONE, LOWER, line(-18, -9, 18, 9), X, 1.15),
    "from the axis one begins at its end": ("hybrid", RAISE, line(0, -9, 18, 9), X, 1.15),
    "lines that pass each other": (ONE, LOWER, line(-10, 1, 10, 1), make_images("RADIAL", 3), 1.3),
}


@cache
def meet(name):
    """Return what the images of a row form, as `follow_to_the_end` does."""
    method, brush, path, images, _ = MEETING[name]
    return follow_to_the_end(draw(begin(method), path, images, brush))


@pytest.mark.parametrize("name", MEETING)
def test_images_that_meet_give_way_and_all_of_them_form(name):
    method, brush, path, images, longest = MEETING[name]
    single = form(begin(method), lay(path, brush))
    session, force, _ = meet(name)
    assert session.state.period < longest * single.state.period
    assert force < 0.6  # one alone: 0.2 N; a fingertip that runs into another's ridge: 40 N
    formed = np.abs(heights(session) - 40e-3)
    for image in images:
        places = np.array([image.place(*place) for place in 1e-3 * path])
        assert formed[session.system.grid.at(*places.T)].min() > 3e-3


@pytest.mark.parametrize(
    "name",
    [
        "nearer, one follows",
        "from the axis one begins at its end",
        "a click in a small ring, every other one",
    ],
)
def test_a_take_in_which_images_give_way_is_replayed_bit_for_bit(name):
    assert replayed(keep(meet(name)[0]))


def test_images_begin_no_error_estimate_of_their_own():
    session = begin()
    session = replace(session, monitor=session.monitor._replace(age=100))
    session = go_on(draw(session, APART, make_images("X")), 1)
    assert session.system.fingers == 2
    # One of several fingertips takes a tenth of the stroke's time.
    assert (session.monitor.age, session.monitor.state) == (101, None)


def test_no_fingertip_lifts_again_for_another_one_that_is_down():
    images = make_images("RADIAL", 10, (1.1e-3, -0.7e-3), 0.4)
    session = draw(begin(), line(3.7, 0.9, 5.0, 1.7), images, RAISE)
    pressing = set[int]()
    lifted = 0
    while session.strokes:
        session = follow_finger(session, session.poses, 1)
        parts = session.strokes[0].parts if session.strokes else ()
        forces = session.state.finger_forces()
        lifted += sum(part.image in pressing for part in parts if part.phase == YIELDING)
        pressing = {
            part.image for part in parts if part.phase == PRESSING and forces[part.image] > 0.0
        }
    # It would run into what the others raise, at forces of up to 70 N.
    assert lifted == 0


def test_what_near_images_leave_does_not_depend_on_the_periods_of_a_tick():
    name = "lines that pass each other"
    method, brush, path, images, _ = MEETING[name]
    *_, left = follow_to_the_end(draw(begin(method), path, images, brush), 1)
    assert_array_equal(left, meet(name)[2])


def test_rays_leave_their_nominal_surface_although_the_hand_pauses():
    path = line(2, 1, 18, -6)
    held = replace(lay(path[:13], RAISE, images=RAYS), held=True)
    ghost, session = (
        find_ghost(draw(begin("hybrid"), path, RAYS, RAISE)),
        queue(begin("hybrid"), held),
    )
    for _ in range(40):  # as far as the hand has drawn
        session = follow_finger(session, session.poses, 8)
    session = change_stroke(session, 1, partial(lay_path, points=1e-3 * path))
    session, force, _ = follow_to_the_end(session)
    assert force < 0.6
    assert_near(heights(session), ghost.height, 2e-6)


def test_there_are_no_more_fingertips_than_a_bed_can_have_and_the_others_stay():
    fingers, tap = [], lay(line(24, 0, 24, 0), LOWER, images=make_images("RADIAL", 24))
    for count in (1, 10):
        session = begin(fingers=count)
        stood, session = session.poses.copy(), queue(session, tap)
        session = follow_finger(session, session.poses, 8)
        fingers.append(session.system.fingers)
    assert fingers == [24, 32]
    session = form(session)
    assert_array_equal(session.poses[1:], stood[1:])
    places = np.array([image.place(24e-3, 0.0) for image in tap.images])
    assert heights(session)[session.system.grid.at(*places.T)].max() < 37e-3


@pytest.mark.parametrize("brush", [Brush.SMOOTH, Brush.LOCK])
def test_what_the_valves_do_alone_takes_no_further_fingertips(brush):
    session = draw(begin("hybrid"), line(8, 8, 9, 8), make_images("XY"), brush)
    while session.strokes:
        session = follow_finger(session, session.poses, 16)
        assert session.system.fingers == 1


@cache
def go_to_middle():
    """Return a session in the middle of a radial stroke, with four fingertips in the pins."""
    session = go_on(draw(begin(), APART, make_images("RADIAL", 4)), 70)
    assert session.system.fingers == 4
    assert session.state.finger_forces().min() > 0.01
    return session


def middle():
    """Return that session, to go on with."""
    return copy(go_to_middle())


def test_a_stroke_that_is_taken_back_in_its_middle_leaves_nothing_and_another_symmetry_goes_on():
    session = rewind(middle())
    assert (session.poses.shape, session.system.fingers, session.strokes) == ((1, 7), 1, ())
    assert_array_equal(heights(session), 40e-3)
    session = form(session, lay(APART, LOWER, images=make_images("X")))
    session = form(session, lay(APART[::-1], RAISE, images=make_images("RADIAL", 3)))
    session = follow_finger(session, session.poses, 3)
    take = keep(session)
    assert (take.poses.shape[1], max(take.fingers), min(take.fingers)) == (4, 3, 1)
    assert replayed(take)


def test_a_recording_begins_and_ends_in_the_middle_of_a_stroke():
    session = set_recording(middle(), True)
    session = go_on(session, 20)
    assert set(keep(session).fingers) == {4}
    assert replayed(keep(session))
    # Dropped, the stroke ends there, and so do its fingertips.
    dropped = drop_strokes(session)
    assert (dropped.system.fingers, dropped.poses.shape) == (1, (1, 7))
    assert replayed(keep(dropped))


@pytest.mark.parametrize("change", ["settings", "a second fingertip too"])
def test_settings_and_fingertips_change_in_the_middle_of_a_stroke(change):
    session = middle()
    scene, numbers = session.scene, session.numbers
    gain = 0.9 * scene.control.force_gain
    scene = replace(scene, control=replace(scene.control, force_gain=gain))
    if change != "settings":
        scene, numbers = scene.with_fingers(2), (1, 2)
    force = go_on(middle(), 1).state.finger_forces()
    poses = np.array([[0.0, 0.0, ABOVE, *LEVEL]] * len(numbers))
    session, lost = change_scene(session, scene, numbers, poses)
    assert (lost, session.numbers, session.names[len(numbers) :]) == ("", numbers, (33, 34, 35))
    session = go_on(session, 1)
    # The pulps of the images' fingertips relax on: ones that begin anew would press 2.6 times as
    # hard.
    pressing = session.state.finger_forces()[list_pressing(session)]
    assert_allclose(pressing, force, rtol=0.1)
    done = form(session)
    pins = 1e3 * heights(done).reshape(COUNT, COUNT)
    assert_near(pins, np.rot90(pins), 2e-3)
    assert done.system.fingers == len(numbers)
    back = done
    while back.gestures:  # a change is where another one begins
        back = rewind(back)
        assert back.system.fingers == len(numbers)
    assert_near(heights(back), 40e-3, 1e-9)


def test_a_session_begins_from_the_state_that_was_kept_in_the_middle_of_a_stroke():
    session = middle()
    again, lost = begin_session(
        7,
        "Bed",
        session.scene,
        session.poses[:1],
        session.snapshot,
        0,
        session.numbers,
        session.names,
    )
    assert (lost, again.system.fingers) == ("", 1)
    assert_array_equal(heights(again), heights(session))
    # Undo comes back to it as well.
    back = restore(again, session.snapshot, session.poses, 1, session.names)
    assert_array_equal(heights(back), heights(session))


def make_longer(scene):
    return replace(scene, simulation=replace(scene.simulation, duration=9.0))


@cache
def tick_on():
    """Return a session at its first tick and after 81, each of which simulates one period of a stroke."""
    session = draw(begin("hybrid"), [(2, 9), (9, 2)], ALONE, RAISE)
    ticks = []
    for _ in range(81):  # ticks that have no time
        session = advance(session, session.poses, 0.0, 0, interval=1e-9)
        ticks.append(session)
    return ticks[0], ticks[-1]


@pytest.mark.parametrize(
    "interrupt",
    [
        lambda session: drop_strokes(session).snapshot,
        lambda session: set_recording(session, True).recording.start,
        lambda session: read_recording(session).end,
        lambda session: change_scene(session, make_longer(session.scene))[0].snapshot,
    ],
    ids=["dropped", "recorded from here", "recorded up to here", "on another scene"],
)
def test_ticks_of_a_stroke_pack_no_state_but_whatever_interrupts_it_has_the_present_one(interrupt):
    begun, session = tick_on()
    # With 24 fingertips, packing would take a fifth of a tick.
    assert (session.snapshot is begun.snapshot, session.state.period) == (True, 81)
    stands = heights(session)
    assert np.abs(stands - 40e-3).max() > 1e-3
    state = snapshot.load(session.system, interrupt(copy(session)))
    assert_array_equal(state.row(0), stands)
