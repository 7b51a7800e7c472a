"""The Press tool, the overlay, heat map and arrows in a real Blender window."""

import numpy as np
import pytest

from tests.assemble import assert_near
from tests.window.blender_window import REST, bed

PLAYED = {"script": "press_tool.py", "size": (1100, 720)}
#: Pins the valley is drawn over, 6 mm off the middle row of 25, and their columns.
ROW, COLUMNS = 14, slice(8, 17)


def finger(seen, name):
    return np.array(seen[name]["finger"])


def test_a_press_starts_a_session_and_puts_the_finger_under_the_mouse(seen):
    assert (seen["added"]["sessions"], seen["pressed"]["sessions"]) == (0, 1)
    # 18 mm, 6 mm to a pixel of the picture: the bed of 75 mm is 500 pixels wide. The fingertip
    # waits within 0.5 mm of the hand, the way of a control period.
    assert_near(finger(seen, "pressed")[:2], [18.0, 6.0], 0.8)
    # Its lowest point is below the tops of the pins that hold its force.
    assert -6.0 < finger(seen, "pressed")[2] - REST < -4.0


def test_dragging_draws_a_valley_alone_and_let_go_the_fingertip_leaves_the_bed(seen):
    drawn = bed(seen, "let go")
    assert drawn[ROW, COLUMNS].max() < REST - 1.0
    assert_near(drawn[:4], REST, 1e-3)
    assert (finger(seen, "let go")[2] > REST, seen["let go"]["force"]) == (True, 0.0)


def test_the_wheel_presses_deeper_and_ctrl_in_mid_stroke_draws_on_as_deep(seen):
    before, along = (finger(seen, name) for name in ("before the wheel", "after Ctrl"))
    # The fingertip goes deeper where the hand goes on; until then the ghost does.
    assert along[2] == pytest.approx(before[2] - 2.0, abs=0.3)
    assert np.linalg.norm((along - before)[:2]) > 3.0


def test_the_text_at_the_cursor_says_what_a_press_does_now_and_what_is_being_formed(seen):
    lower, size = "Lower, depth 4 mm", "Size 16 mm   "
    assert seen["LEFT_CTRL held"] == f"{size}Raise, height 6 mm"
    assert seen["RIGHT_SHIFT held"] == f"{size}Smooth 100 %"
    free = ("LEFT_CTRL let go", "RIGHT_SHIFT let go", "moved without Ctrl", "the next one")
    assert {seen[name] for name in free} == {f"{size}{lower}"}
    # Eight turns of the wheel, 0.25 mm each, of the one stroke.
    assert seen["deeper"].startswith(f"{size}Lower, depth 6 mm   Forming: Lower")
    assert seen["while Raise forms"].startswith(f"{size}{lower}   Forming: Raise")


def test_the_text_at_the_cursor_stays_beside_the_sidebar_and_above_the_edge(seen):
    left, bottom, right, top = seen["room"]
    width = seen["text"]["middle"][2] - seen["text"]["middle"][0]
    assert width > 150  # of all its letters
    for x, y, to_x, to_y in seen["text"].values():
        assert left <= x < to_x < right
        assert bottom <= y < to_y < top
        assert to_x - x == pytest.approx(width, abs=3)  # smooth edges


def test_clicks_pick_the_pins_under_the_mouse_and_forces_are_written_once_they_are_shown(seen):
    # Column 12 of row 12 is the middle; 3 mm a pin.
    assert seen["picked"]["picked"] == [3 * 25 + 8, 3 * 25 + 12, 3 * 25 + 16]
    assert [seen[name]["forces written"] for name in ("pressed", "forces shown")] == [False, True]


def test_the_overlay_is_drawn_while_a_session_runs_and_it_is_wanted(seen):
    wanted = {
        "added": False,
        "pressed": True,
        "overlay off": False,
        "overlay on": True,
        "ended": False,
    }
    assert {name: seen[name]["overlay"] for name in wanted} == wanted


def test_the_next_press_starts_the_session_anew_and_ends_with_its_bed(seen):
    assert [seen[name]["sessions"] for name in ("ended", "started anew", "bed deleted")] == [
        0,
        1,
        0,
    ]
    assert seen["bed deleted"]["beds"] == 0
    # Disabled: what the extension left behind to draw would fail with a traceback, which ends
    # `played`.
    assert seen["tools held"] == ["digiclay.press_tool", "builtin.select_box"]
