"""Queue of press strokes: the same heights in whatever ticks, the ghost that is shown of it, its time."""

import json
from dataclasses import astuple, replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.model.fingertip import Fingertip
from digiclay.sessions.sculpting import change_scene, follow_finger, rewind
from digiclay.settings.devices import scale_blister
from digiclay.strokes import drawn
from digiclay.strokes.stroke import Brush, lay_ring, make_images
from digiclay.strokes.sweep import estimate_time
from numpy.testing import assert_array_equal

from tests.assemble import assert_near
from tests.hand import heights
from tests.strokes import begin_bed, find_ghost, form, lay, queue

#: The last valley is pressed with more than `motion.FIRM`, at which the fingertip waits for the pins.
FROM_A_FLANK = [
    lay([(11.5, 4.9), (-10.5, 0.2)], Brush.RAISE, 12.0),
    lay([(-17.1, 8.0), (1.1, 8.2)], Brush.LOWER, 8.0),
    lay([(-16.5, 5.8), (-5.2, 0.0)], Brush.LOWER, 8.0),
]


def test_strokes_leave_the_same_bits_however_many_periods_are_simulated_at_a_time():
    session = begin_bed("design", 41, 41, "hybrid", preset="design")
    few, many = (form(session, *FROM_A_FLANK, periods=periods) for periods in (7, 64))
    assert few.state.period == many.state.period
    assert_array_equal(heights(few), heights(many))


#: A part of a bed by its name, rows, columns and method.
PARTS = {
    "Method III": ("design", 41, 41, "hybrid"),
    "Method I, rows shifted": ("design", 41, 41, "virtual_master", "staggered"),
    "without a blister": ("design", 41, 41, "plastic"),
}
WAVE = [(x, 4.0 * np.sin(0.3 * x)) for x in np.linspace(-12.0, 12.0, 27)]
RING = 1e3 * lay_ring((5e-3, 3e-3), (13e-3, 3e-3))
LEANING = {"images": make_images("X"), "lean": (0.3, 0.2)}
QUEUES = {
    "a valley across a ridge": [
        lay(WAVE, Brush.RAISE, 5.0), lay([(0, -13), (2, 13)], Brush.LOWER, 3.0),
    ],
    "a ring, mirrored": [lay(RING, Brush.RAISE, images=make_images("XY"))],
    "lines turned about the middle": [
        lay([(4, 2), (17, 6)], Brush.LOWER, 3.0, images=make_images("RADIAL", 3)),
    ],
    "a ridge that is leveled": [
        lay(WAVE, Brush.RAISE, 5.0), lay([(-14, 0), (14, 0)], Brush.LEVEL, 1.0),
    ],
    "a leaning finger": [lay(WAVE, Brush.LOWER, 2.0, **LEANING)],
}  # fmt: skip


@cache
def form_queue(part, name):
    """Return what a queue forms on a bed: heights before, of its ghost, and after it, (n,) each, m.

    Then the time, s, that it takes after the first control period, as expected and as simulated.
    """
    session = queue(begin_bed(*PARTS[part]), *QUEUES[name])
    before, ghost = heights(session).copy(), find_ghost(session).height
    session = follow_finger(session, session.pose, 1)
    expected = estimate_time(session.strokes)
    done = form(session)
    taken = (done.state.period - 1) * done.system.period
    return before, ghost, heights(done), expected, taken


@pytest.mark.parametrize("name", QUEUES)
def test_what_valves_finish_is_the_ghost_and_the_time_that_it_takes_is_known_roughly(name):
    _, ghost, formed, expected, taken = form_queue("Method III", name)
    assert_near(formed, ghost, 2e-6)
    assert 0.6 * taken < expected < 1.6 * taken
    assert estimate_time(()) == 0.0


def test_a_leaning_finger_leaves_its_ghost_where_rows_are_shifted():
    _, ghost, formed, *_ = form_queue("Method I, rows shifted", "a leaning finger")
    assert_near(formed, ghost, 2e-6)


def test_without_a_blister_the_ghost_agrees_with_the_result_to_a_millimeter_over_most_pins():
    before, ghost, formed, *_ = form_queue("without a blister", "lines turned about the middle")
    # Of the pins that move, not of all: those far from a stroke agree anyway.
    moved = np.maximum(np.abs(ghost - before), np.abs(formed - before)) > 0.1e-3
    # Pins that only give way do so up to a force: 1.1 mm less than the fingertip comes down.
    assert (np.abs(formed - ghost)[moved] < 1.2e-3).mean() >= 0.95
    assert moved.sum() > 30


#: Brush of two strokes, the share of the bed's fingertip that each is drawn with, and its row, mm: apart
#: from each other, so that each can be formed alone.
TWO_SIZES = {
    "valleys": [(Brush.LOWER, 1.0, -15.0), (Brush.LOWER, 0.5, 15.0)],
    "what valves drive": [(Brush.CREASE, 1.0, -15.0), (Brush.CREST, 0.5, 15.0)],
}


def find_sizes(share):
    """Return fingertip and blister of a stroke, a share of those of the bed."""
    scene = begin_bed(*PARTS["Method III"]).scene
    finger = Fingertip(*(share * axis for axis in astuple(scene.fingers[0].fingertip)))
    return {"finger": finger, "blister": scale_blister(scene.blister, share)}


def lay_sizes(name, *shares):
    """Return the strokes of a row of `TWO_SIZES`, with other shares if these are given; 0: the bed's."""
    rows = TWO_SIZES[name]
    return [
        lay([(-9, y), (9, y)], brush, 3.0, **(find_sizes(share) if share else {}))
        for (brush, _, y), share in zip(rows, shares or [row[1] for row in rows], strict=True)
    ]


@pytest.mark.parametrize("name", TWO_SIZES)
def test_each_stroke_of_a_queue_is_formed_and_shown_with_the_fingertip_that_it_was_drawn_with(name):
    one_by_one = begin = begin_bed(*PARTS["Method III"])
    for stroke in lay_sizes(name):
        (first,) = begin.scene.fingers
        tip = replace(first, fingertip=stroke.finger)
        scene = replace(begin.scene, fingers=(tip,), blister=stroke.blister)
        one_by_one, _ = change_scene(one_by_one, scene)
        one_by_one = form(one_by_one, replace(stroke, finger=None, blister=None))
    assert_array_equal(heights(form(begin, *lay_sizes(name))), heights(one_by_one))
    # What would be left by fingertips of the bed's size is another surface.
    own, whole, usual = (
        find_ghost(queue(begin, *lay_sizes(name, *shares))).height
        for shares in ((), (1.0, 1.0), (0.0, 0.0))
    )
    assert np.abs(own - whole).max() > 0.2e-3
    assert_array_equal(whole, usual)


def test_a_stroke_keeps_its_fingertip_where_it_is_stored_and_taken_back():
    strokes = lay_sizes("valleys")
    lines = [drawn.dump(stroke) for stroke in strokes]
    loaded = [drawn.load(line) for line in lines]
    sizes = [(stroke.finger, stroke.blister) for stroke in strokes]
    assert [(stroke.finger, stroke.blister) for stroke in loaded] == sizes
    assert [drawn.dump(stroke) for stroke in loaded] == lines
    done = form(begin_bed(*PARTS["Method III"]), *strokes)
    # Redo finds the ends of both strokes: the other fingertip of the second one spoils none.
    assert [gesture.stroke for gesture in done.gestures] == lines
    assert all(gesture.end is not None for gesture in done.gestures)
    assert_array_equal(heights(form(rewind(done), loaded[1])), heights(done))


#: Fingertip of a stored stroke, its semi-axes, m, that is none.
SPOILT = [[0.0, 1e-3, 1e-3], [-1e-3] * 3, [1e-3] * 2, ["a", 1, 1], [float("nan")] * 3, [1e9] * 3, 5]


@pytest.mark.parametrize("axes", SPOILT, ids=str)
def test_a_stored_stroke_with_a_spoilt_fingertip_is_none(axes):
    line = json.loads(drawn.dump(lay_sizes("valleys")[0]))
    assert drawn.load(json.dumps(line)) is not None
    line[-1]["finger"] = axes
    assert drawn.load(json.dumps(line)) is None
