"""Queue of press strokes: the same heights in whatever ticks, the ghost that is shown of it, its time."""

import functools
import json
from dataclasses import astuple, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_device
from digiclay.sessions.sculpting import change_stroke, queue_stroke, rewind
from digiclay.settings.devices import BEDS, make_scene, scale_blister
from digiclay.strokes import drawn
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stroke import Brush, lay_path, lay_ring, make_images, start
from digiclay.strokes.sweep import estimate_time

from tests.hand import heights

#: Rows and columns of a part of a bed, and its name, arrangement and method.
PARTS = {
    "Method I on the paper's bed": (25, "paper", "aligned", "virtual_master"),
    "Method III": (41, "design", "aligned", "hybrid"),
    "Method I, rows shifted": (41, "design", "staggered", "virtual_master"),
    "Method II on fine pins": (45, "fine", "aligned", "cell_states"),
    "without a blister": (41, "design", "aligned", "plastic"),
}


def begin(name):
    count, bed, arrangement, method = PARTS[name]
    layout = Layout(count, count, BEDS[bed].pitch, arrangement=arrangement)
    above = np.array([0.0, 0.0, 46e-3, *LEVEL])
    scene = make_scene("paper", layout, method, BEDS[bed].share)
    return sculpting.begin_session(7, "Bed", scene, above)[0]


#: Strokes of one session: brush, height or depth, m, path, m, and images. The last valley is
#: pressed with more than `motion.FIRM`, at which the fingertip waits for the pins.
DRAWN = {
    "across the mirror": [
        (Brush.RAISE, 3e-3, np.linspace([-12e-3, -7e-3], [15e-3, 8e-3], 20), "X")
    ],
    "a valley from the flank of another one": [
        (Brush.RAISE, 12e-3, np.array([[11.5e-3, 4.9e-3], [-10.5e-3, 0.2e-3]]), "NONE"),
        (Brush.LOWER, 8e-3, np.array([[-17.1e-3, 8.0e-3], [1.1e-3, 8.2e-3]]), "NONE"),
        (Brush.LOWER, 8e-3, np.array([[-16.5e-3, 5.8e-3], [-5.2e-3, 0.0]]), "NONE"),
    ],
}


def finish(session, periods):
    """Return the session when no stroke is left, so many periods simulated at a time."""
    while session.strokes:
        session = sculpting.follow_finger(session, session.pose, periods)
    return session


def draw(name):
    """Return the session of the strokes of a row of `DRAWN`, none of which has begun."""
    scene = make_scene("design", Layout(41, 41, 1.5e-3), "hybrid", 0.5)
    session, _ = sculpting.begin_session(7, "Bed", scene, np.array([0.0, 0.0, 46e-3, *LEVEL]))
    for brush, amount, path, symmetry in DRAWN[name]:
        session, number = queue_stroke(
            session, start(0, *path[0], amount, make_images(symmetry), brush)
        )
        session = change_stroke(session, number, partial(lay_path, points=path))
    return session


@pytest.mark.parametrize("name", DRAWN)
def test_strokes_leave_the_same_bits_however_many_periods_are_simulated_at_a_time(name):
    few, many = (finish(draw(name), periods) for periods in (7, 64))
    assert few.state.period == many.state.period
    np.testing.assert_array_equal(heights(few), heights(many))


#: Strokes of a queue by their bed: brush, amount, mm, path, mm, and symmetry.
WAVE = [(x, 4.0 * np.sin(0.3 * x)) for x in np.linspace(-12.0, 12.0, 27)]
SHIFTED = 1e3 * lay_ring((5e-3, 3e-3), (13e-3, 3e-3))
QUEUES = {
    "a valley across a ridge": [
        (Brush.RAISE, 5.0, WAVE, "NONE"),
        (Brush.LOWER, 3.0, [(0, -13), (2, 13)], "NONE"),
    ],
    "a ring, mirrored": [(Brush.RAISE, 4.0, SHIFTED, "XY")],
    "lines turned about the middle": [(Brush.LOWER, 3.0, [(4, 2), (17, 6)], "RADIAL")],
    "a ridge that is leveled": [
        (Brush.RAISE, 5.0, WAVE, "NONE"),
        (Brush.LEVEL, 1.0, [(-14, 0), (14, 0)], "NONE"),
    ],
    "a leaning finger": [(Brush.LOWER, 2.0, WAVE, "X")],
}


RIDGE, RINGS, TURNED, LEVEL_RIDGE, LEANING = QUEUES
CASES = [
    *(("Method III", queue) for queue in QUEUES),
    ("Method I on the paper's bed", RIDGE),
    *(("Method I, rows shifted", queue) for queue in (TURNED, LEANING)),
    ("Method II on fine pins", LEVEL_RIDGE),
    ("without a blister", TURNED),
]


class Formed(NamedTuple):
    """What a queue forms, and what is known of it before."""

    before: Floats
    ghost: Floats
    after: Floats
    """(n,) each: Heights, m."""
    expected: float
    taken: float
    """Simulated time after the first control period, s."""
    left: float
    """Time that is expected in the end, s."""


@functools.cache
def form(part, queue):
    """Return what a queue forms on a bed."""
    session = begin(part)
    lean = (0.3, 0.2) if queue == LEANING else (0.0, 0.0)
    for number, (brush, amount, path, symmetry) in enumerate(QUEUES[queue], 1):
        places = 1e-3 * np.array(path)
        stroke = start(
            number, *places[0], 1e-3 * amount, make_images(symmetry, 3), brush, lean=lean
        )
        session = replace(session, strokes=(*session.strokes, lay_path(stroke, places)))
    before = heights(session).copy()
    ghost = find_ghosts(session.strokes, find_device(session), before)[-1].nominal.height
    session = sculpting.follow_finger(session, session.pose, 1)
    expected, begun = estimate_time(session.strokes), session.state.period
    done = finish(session, 64)
    taken = (done.state.period - begun) * done.system.period
    return Formed(before, ghost, heights(done), expected, taken, estimate_time(done.strokes))


@pytest.mark.parametrize("part, queue", CASES)
def test_the_ghost_agrees_with_the_result_to_a_millimeter_over_most_pins(part, queue):
    before, ghost, formed, *_ = form(part, queue)
    # Of the pins that move, not of all: those far from a stroke agree anyway.
    moved = np.maximum(np.abs(ghost - before), np.abs(formed - before)) > 0.1e-3
    # Pins that only give way do so up to a force: 1.1 mm less than the fingertip comes down.
    most = 1.2e-3 if part == "without a blister" else 1e-3
    assert (np.abs(formed - ghost)[moved] < most).mean() >= 0.95
    assert moved.sum() > 30


@pytest.mark.parametrize("queue", QUEUES)
def test_the_time_that_a_queue_still_takes_is_known_roughly(queue):
    formed = form("Method III", queue)
    assert 0.6 * formed.taken < formed.expected < 1.6 * formed.taken
    assert formed.left == 0.0


#: Fingertips of strokes of one queue by their brush, as shares of that of the bed, and the path of
#: each, mm: apart from each other, so that each can be formed alone.
TWO_SIZES = {
    "valleys": [(Brush.LOWER, 1.0, -15.0), (Brush.LOWER, 0.5, 15.0)],
    "ridges": [(Brush.RAISE, 0.6, -12.0), (Brush.RAISE, 1.0, 16.0)],
    "what valves drive": [(Brush.CREASE, 1.0, -15.0), (Brush.CREST, 0.5, 15.0)],
}


def queue_sizes(queue, shares):
    """Return a session with the strokes of a row of `TWO_SIZES` queued; None: the bed's fingertip."""
    session = begin("Method III")
    for (brush, _, y), share in zip(TWO_SIZES[queue], shares, strict=True):
        sizes = find_sizes(session, share) if share else {}
        stroke = start(0, -9e-3, 1e-3 * y, 3e-3, brush=brush, **sizes)
        stroke = lay_path(stroke, 1e-3 * np.array([[-9.0, y], [9.0, y]]))
        session, _ = queue_stroke(session, stroke)
    return session


def find_sizes(session, share):
    """Return fingertip and blister of a stroke, a share of those of a session's scene."""
    scene = session.scene
    finger = Fingertip(*(share * axis for axis in astuple(scene.fingers[0].fingertip)))
    return {"finger": finger, "blister": scale_blister(scene.blister, share)}


def form_after_another(queue, shares):
    """Return heights (n,), m, that strokes leave which are queued one after another, as fingertips change."""
    session = begin("Method III")
    usual = session.scene
    for index, share in enumerate(shares):
        stroke = queue_sizes(queue, shares).strokes[index]
        sizes = find_sizes(replace(session, scene=usual), share)
        tip = replace(usual.fingers[0], fingertip=sizes["finger"])
        scene = replace(usual, fingers=(tip,), blister=sizes["blister"])
        session, _ = sculpting.change_scene(session, scene)
        plain = replace(stroke, finger=None, blister=None)
        session = finish(queue_stroke(session, plain)[0], 64)
    return heights(session)


@pytest.mark.parametrize("queue", TWO_SIZES)
def test_each_stroke_of_a_queue_is_formed_and_shown_with_the_fingertip_that_it_was_drawn_with(
    queue,
):
    shares = [share for _, share, _ in TWO_SIZES[queue]]
    session = queue_sizes(queue, shares)
    wanted = form_after_another(queue, shares)
    np.testing.assert_array_equal(heights(finish(session, 64)), wanted)
    # What would be left by fingertips of the other's size is another surface.
    other = heights(finish(queue_sizes(queue, shares[::-1]), 64))
    assert np.abs(other - wanted).max() > 0.2e-3
    ghosts = [
        find_ghosts(each.strokes, find_device(each), heights(each))[-1].nominal.height
        for each in (session, queue_sizes(queue, [1.0, 1.0]), queue_sizes(queue, [None, None]))
    ]
    assert np.abs(ghosts[0] - ghosts[1]).max() > 0.2e-3
    np.testing.assert_array_equal(ghosts[1], ghosts[2])


def test_a_stroke_keeps_its_fingertip_where_it_is_stored_and_taken_back():
    session = queue_sizes("valleys", [1.0, 0.5])
    lines = [drawn.dump(stroke) for stroke in session.strokes]
    loaded = [drawn.load(line) for line in lines]
    sizes = [(stroke.finger, stroke.blister) for stroke in session.strokes]
    assert [(stroke.finger, stroke.blister) for stroke in loaded] == sizes
    assert [drawn.dump(stroke) for stroke in loaded] == lines
    done = finish(session, 64)
    # Redo finds the ends of both strokes: the other fingertip of the second one spoils none.
    assert [gesture.stroke for gesture in done.gestures] == lines
    assert all(gesture.end is not None for gesture in done.gestures)
    back = rewind(done)
    again = sculpting.follow_finger(queue_stroke(back, loaded[1])[0], back.pose, 8)
    np.testing.assert_array_equal(heights(finish(again, 64)), heights(done))


#: Fingertip of a stored stroke, its semi-axes, m, that is none.
SPOILT = [[0.0, 1e-3, 1e-3], [-1e-3] * 3, [1e-3] * 2, ["a", 1, 1], [float("nan")] * 3, [1e9] * 3, 5]


@pytest.mark.parametrize("axes", SPOILT, ids=str)
def test_a_stored_stroke_with_a_spoilt_fingertip_is_none(axes):
    line = json.loads(drawn.dump(queue_sizes("valleys", [1.0, 0.5]).strokes[0]))
    assert drawn.load(json.dumps(line)) is not None
    line[-1]["finger"] = axes
    assert drawn.load(json.dumps(line)) is None
