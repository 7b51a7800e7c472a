"""Drawings of several strokes by a hand, judged by their paths alone: as a ghost, and formed in a session."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from digiclay.sessions.running import find_device
from digiclay.sessions.sculpting import change_stroke, follow_finger, queue_stroke
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stroke import ALONE, Brush, Combine, draw, lay_path, start

from tests.assemble import assert_near, table
from tests.drawings import AS_DRAWN, TURNED, draw_by_hand, find_wanted, judge, put, read_drawings
from tests.hand import heights, let_go
from tests.strokes import CHUNK
from tests.window.made import begin, make_bed

DRAWN = read_drawings()
#: Brush, how strokes meet, and what they are to leave, mm.
RAISED = (Brush.RAISE, Combine.HIGHEST, 8.0)
LOWERED = (Brush.LOWER, Combine.LOWEST, -4.0)
#: Moves of the hand between two ticks of a session, and control periods in each, as in a second.
MOVES, PERIODS = 3, 6


@cache
def at_rest():
    """Return a session of the bed "design", the heights of its pins, and their places, mm."""
    session = begin(make_bed("design"))
    return session, heights(session), *(1e3 * session.system.grid.positions.T)


def measure(height):
    """Return heights of pins (n,), m, as rows by columns above rest, mm."""
    _, rest, *_ = at_rest()
    return (1e3 * (height - rest)).reshape(100, 100)


def begin_stroke(brush, combine, amount, place):
    """Return a stroke whose first place, mm, the hand has drawn."""
    return start(0, *(1e-3 * place), 1e-3 * abs(amount), brush=brush, combine=combine)


@table(
    "name, kind, pose",
    {
        "R raised": ("R", RAISED, AS_DRAWN),
        "X lowered, turned": ("X", LOWERED, TURNED),
        "logo raised, turned": ("logo", RAISED, TURNED),
        "face lowered": ("face", LOWERED, AS_DRAWN),
        "map raised": ("map", RAISED, AS_DRAWN),
    },
)
def test_the_ghost_of_a_drawing_has_its_height_on_each_path_and_flanks_of_one_stroke(
    name, kind, pose
):
    session, rest, x, y = at_rest()
    paths, rng = put(DRAWN[name], *pose), np.random.default_rng(41)
    hands = [draw_by_hand(path, rng) for path in paths]
    strokes = [lay_path(begin_stroke(*kind, hand[0]), 1e-3 * hand) for hand in hands]
    device = find_device(session)
    formed = find_ghosts(tuple(strokes), device, rest)[-1].nominal.height
    assert judge(paths, kind[-1], measure(formed), x, y) == ""
    # The whole surface is that of what the hand has drawn, trembling as it does.
    assert_near(measure(formed).ravel(), find_wanted(hands, kind[-1], x, y), 1e-6)
    # In another order, and drawn once more, it is the same.
    again = find_ghosts(tuple(strokes[::-1]), device, formed)[-1].nominal.height
    np.testing.assert_array_equal(again, formed)


@pytest.mark.parametrize(
    "spoil, said",
    [
        (lambda x, relief: relief, ""),
        (lambda x, relief: relief + 0.11, "stroke 1 has 8.11 to 8.11 mm; stroke 2 has"),
        (lambda x, relief: relief * (1.0 + 0.06 * np.sign(x)), "varies by 0."),
        (lambda x, relief: relief * (np.abs(relief) > 3.0), "a slope is"),
        (lambda x, relief: 2.0 * relief, "stroke 1 has 16.00"),
    ],
    ids=["nothing", "too high", "uneven along", "a cliff on a flank", "twice"],
)
def test_the_judge_says_what_is_wrong(spoil, said):
    *_, x, y = at_rest()
    relief = spoil(x, find_wanted(DRAWN["X"], 8.0, x, y)).reshape(100, 100)
    found = judge(DRAWN["X"], 8.0, relief, x, y)
    assert said in found if said else found == ""


def test_strokes_that_count_from_the_surface_add_where_they_meet_as_in_older_files():
    session, rest, x, y = at_rest()
    kind = Brush.RAISE, Combine.USUAL, 8.0
    strokes = [lay_path(begin_stroke(*kind, path[0]), 1e-3 * path) for path in DRAWN["X"]]
    formed = find_ghosts(tuple(strokes), find_device(session), rest)[-1].nominal.height
    assert "stroke 1 has 8.00 to 16.00 mm" in judge(DRAWN["X"], 8.0, measure(formed), x, y)


def draw_all(paths, kind, images):
    """Yield the session of a hand that draws along paths, mm, 100 moves per second, after each tick."""
    session, rng = begin(make_bed("design")), np.random.default_rng(41)
    for path in paths:
        hand = draw_by_hand(path, rng)
        stroke = replace(begin_stroke(*kind, hand[0]), images=images)
        session, number = queue_stroke(session, stroke)
        for first in range(1, len(hand), MOVES):
            for x, y in (1e-3 * hand[first : first + MOVES]).tolist():
                add = partial(draw, x=x, y=y, depth=1e-3 * abs(kind[-1]))
                session = change_stroke(session, number, add)
            session = follow_finger(session, session.pose, PERIODS)
            yield session
        session = let_go(session, number)
    while session.strokes:
        session = follow_finger(session, session.pose, CHUNK)
        yield session


#: Brush and pose of each drawing, and most control periods and calls that form it, an eighth more
#: than were counted: what they take depends on the machine.
FORMED = {
    "R": (LOWERED, TURNED, (840, 226)),
    "X": (RAISED, TURNED, (735, 157)),
}


def assert_formed(paths, kind, most, images=ALONE):
    """Assert that paths, mm, are formed in so many periods and calls, and no finger is pressed hard."""
    force, periods = 0.0, {0}
    for session in draw_all(paths, kind, images):
        # A trace has the sum of several fingertips.
        felt = session.trace.force if images is ALONE else session.state.finger_forces()
        force = max(force, float(felt.max(initial=0.0)))
        periods.add(session.state.period)
    turns = np.linspace(0.0, 360.0, len(images), endpoint=False)
    drawn = [path for turn in turns for path in put(paths, turn, (0.0, 0.0))]
    assert judge(drawn, kind[-1], measure(heights(session)), *at_rest()[2:]) == ""
    # As things of the gallery: a hand presses with 1 N.
    assert force < 1.0
    counts = session.state.period, len(periods) - 1
    assert np.less_equal(counts, most).all(), counts


@pytest.mark.parametrize("name", FORMED)
def test_a_drawing_is_formed_while_a_hand_draws_it_and_no_finger_is_pressed_hard(name):
    kind, pose, most = FORMED[name]
    assert_formed(put(DRAWN[name], *pose), kind, most)
