"""Strokes queued for a session are all formed, one after the other, and are taken back one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running
from digiclay.sessions.stroke_queue import change_stroke, find_stroke, last_place, queue_stroke
from digiclay.strokes.stroke import SYMMETRIES, draw

from tests.hand import finish, go_on, heights, let_go, risen, started

pytestmark = pytest.mark.usefixtures("quick_machine")

DEPTH = 4e-3
#: A pin that a finger of 4 mm depth has pressed is lower than this, m.
FORMED = -2e-3


def tap(session: Running, x: float, y: float) -> Running:
    """Queue a click, mm."""
    session, number = queue_stroke(session, 1e-3 * x, 1e-3 * y, DEPTH)
    return let_go(session, number)


def test_presses_in_quick_succession_all_form_and_count_one_gesture_each() -> None:
    places = [(-15.0, -15.0), (15.0, -15.0), (0.0, 15.0)]
    session = started()
    for place in places:
        session = tap(session, *place)
    done = finish(session)
    assert max(risen(done, *place) for place in places) < FORMED
    assert (done.finished_strokes, len(done.gestures), done.strokes) == (3, 3, ())


def test_a_stroke_that_rests_and_goes_on_is_one_gesture() -> None:
    session, number = queue_stroke(started(), -9e-3, 0.0, DEPTH)
    session = change_stroke(session, number, lambda s: draw(s, 2.0, 9e-3, 0.0, DEPTH))
    done = finish(let_go(session, number))
    assert len(done.gestures) == 1


def test_at_most_one_stroke_ends_in_a_tick_so_that_each_gets_an_undo_step() -> None:
    session, drawn = tap(tap(started(), -15.0, 0.0), 15.0, 0.0), []
    for now in range(1, 9):
        session = sculpting.advance(session, session.pose, float(now), 1000)
        drawn.append(session.finished_strokes)
    # Each takes half a second: both would fit into the first tick.
    assert set(np.diff(drawn)) == {0, 1}
    assert drawn[-1] == 2


def test_a_stroke_taken_back_in_its_middle_leaves_the_bed_as_before_and_lets_the_earlier_ones_be() -> None:
    once = finish(tap(started(), -15.0, 0.0))
    before, touched = heights(once).copy(), len(once.gestures)
    session = go_on(queue_stroke(once, 15e-3, 0.0, DEPTH)[0], 30)
    assert np.abs(heights(session) - before).max() > 1e-4
    back = sculpting.withdraw_stroke(session)
    np.testing.assert_array_equal(heights(back), before)
    assert (back.strokes, len(back.gestures)) == ((), touched)


def test_of_several_the_last_is_taken_back_first_and_never_begins() -> None:
    session = tap(tap(started(), -15.0, 0.0), 15.0, 0.0)
    number = session.strokes[-1].number
    assert sculpting.reset(session).strokes == ()
    back = sculpting.rewind(session)
    assert find_stroke(back, number) is None
    done = finish(back)
    assert risen(done, -15.0, 0.0) < FORMED
    assert risen(done, 15.0, 0.0) == 0.0


def test_a_symmetric_stroke_forms_all_its_images_as_one_gesture() -> None:
    session, number = queue_stroke(started(), 12e-3, 12e-3, DEPTH, SYMMETRIES["XY"])
    done = finish(let_go(session, number))
    assert max(risen(done, x, y) for x in (-12.0, 12.0) for y in (-12.0, 12.0)) < FORMED
    assert (done.finished_strokes, len(done.gestures)) == (1, 1)
    assert last_place(done) == (12e-3, 12e-3)
