"""A gesture of the Press tool comes from above, presses where the mouse is, and leaves upwards."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from digiclay.core.fingertip import LEVEL, Fingertip
from digiclay.core.layout import Layout, grid
from digiclay.press.gesture import (
    ABOVE,
    APPROACH,
    DEEPEST,
    DONE,
    DRAG,
    PRESS,
    SPEED,
    Gesture,
    advanced,
    begun,
    deeper,
    dragged,
)

CELLS = grid(Layout(rows=20, columns=20))
TICK = 1.0 / 30.0


def start(
    at: tuple[float, float, float] = (0.0, 0.0, 0.046), over: tuple[float, float] = (0.01, 0.005)
) -> Gesture:
    """Return a gesture of 4 mm on a level bed with one pin that stands out."""
    height = np.full(CELLS.count, 0.040)
    height[0] = 0.055
    return begun(CELLS, height, Fingertip(), np.array([*at, *LEVEL]), over, 4e-3)


def through(gesture: Gesture, ticks: int, follows: bool = True) -> list[Gesture]:
    """Return a gesture tick by tick, the session a tick behind it or standing still."""
    passed, follower = [gesture], gesture.at
    for _ in range(ticks):
        passed.append(advanced(passed[-1], TICK, follower))
        follower = passed[-2].at if follows else follower
    return passed


def test_the_finger_crosses_the_bed_above_all_pins_and_then_presses_to_its_depth() -> None:
    passed = through(start(), 60)
    crossing = [g.at for g in passed if g.phase == ABOVE and tuple(g.at[:2]) != (0.0, 0.0)]
    assert min(at[2] for at in crossing) > 0.055
    assert passed[-1].phase == PRESS
    np.testing.assert_allclose(passed[-1].at, [0.01, 0.005, 0.036, *LEVEL], rtol=0, atol=1e-12)


def test_a_finger_deep_in_the_bed_goes_straight_up_before_it_crosses() -> None:
    for before, after in pairwise(through(start(at=(0.0, 0.0, 0.030)), 60)):
        if before.at[2] < 0.055 and before.phase == ABOVE:
            assert tuple(after.at[:2]) == (0.0, 0.0)


def test_the_finger_goes_down_no_faster_than_a_finger() -> None:
    heights = np.array([g.at[2] for g in through(start(), 60) if g.phase == PRESS])
    falls = -np.diff(heights)
    assert falls.max() <= APPROACH * TICK + 1e-12
    assert falls[heights[1:] < 0.040].max() <= SPEED * TICK + 1e-12


def test_the_finger_goes_the_way_of_the_mouse_however_slow_the_session_is() -> None:
    pressed = through(start(over=(0.0, 0.0)), 60)[-1]
    corner = dragged(dragged(pressed, (0.01, 0.0)), (0.01, 0.01))
    for ticks in (2, 7, 30):
        tick, passed = 0.25 / ticks, [corner]
        for _ in range(ticks):
            passed.append(advanced(passed[-1], tick, passed[-1].at))
        lengths = [np.hypot(*(b.at - a.at)[:2]) for a, b in pairwise(passed)]
        assert max(lengths) <= DRAG * tick + 1e-12
        assert tuple(passed[-1].at[:2]) == (0.01, 0.01)
        off = [min(abs(g.at[1]), abs(g.at[0] - 0.01)) for g in passed]
        assert max(off) < 1e-12


def test_a_gesture_let_go_at_once_is_drawn_to_its_end() -> None:
    pressed = through(start(over=(0.0, 0.0)), 60)[-1]
    passed = through(replace(dragged(pressed, (0.02, 0.0)), held=False), 90)
    assert passed[-1].phase == DONE
    assert max(g.at[0] for g in passed if g.at[2] < 0.0361) == pytest.approx(0.02, rel=1e-12)


def test_a_click_is_a_whole_press_and_ends_above_the_bed() -> None:
    passed = through(replace(start(), held=False), 60)
    assert min(g.at[2] for g in passed) == pytest.approx(0.036, abs=1e-9)
    assert passed[-1].phase == DONE
    assert passed[-1].at[2] == passed[-1].safe


def test_pins_that_give_way_do_not_draw_the_finger_after_them() -> None:
    gesture = start()
    height = gesture.height.copy()
    given = begun(CELLS, height, Fingertip(), gesture.at, gesture.way[0], 4e-3)
    height -= 0.01
    assert given.lowest == gesture.lowest


def test_dragging_follows_the_surface_as_it_was() -> None:
    slope = 0.040 + 0.1 * CELLS.x
    gesture = begun(CELLS, slope, Fingertip(), np.array([0.0, 0.0, 0.07, *LEVEL]), (0.0, 0.0), 4e-3)
    pressed = through(gesture, 60)[-1]
    there = through(dragged(pressed, (0.02, 0.0)), 60)[-1]
    # The mean of a few pins about the place, which do not stand evenly about it: half a pitch of the slope.
    assert there.at[2] - pressed.at[2] == pytest.approx(0.1 * 0.02, abs=0.1 * 1.5e-3)


def test_a_session_that_does_not_follow_is_waited_for_and_not_for_ever() -> None:
    passed = through(start(), 120, follows=False)
    assert passed[5].phase == ABOVE
    assert passed[-1].phase == PRESS


def test_a_pen_presses_by_its_pressure_and_never_through_the_floor() -> None:
    light = through(replace(start(), pressure=0.25), 60)[-1]
    assert light.at[2] == pytest.approx(0.039, abs=1e-9)
    assert replace(start(), height=np.full(CELLS.count, 0.001)).lowest == 0.0


@pytest.mark.parametrize(("by", "depth"), [(-1.0, 0.1e-3), (1.0, DEEPEST), (1e-3, 5e-3)])
def test_the_depth_stays_within_what_can_be_pressed(by: float, depth: float) -> None:
    assert deeper(start(), by).depth == pytest.approx(depth, rel=1e-12)
