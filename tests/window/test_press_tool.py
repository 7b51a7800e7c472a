"""The Press tool, the overlay, heat map and arrows in a real Blender window."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played

#: Pins the valley is drawn over, 6 mm off the middle row of 25, and their columns.
ROW, COLUMNS = 14, slice(8, 17)
REST = 40.0
#: Pins settle by tenths of a millimeter while the finger leaves and after; the valley is 3.5 mm deep.
SETTLING = 0.5


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("press_tool.py", tmp_path_factory.mktemp("press"), size=(1100, 720))


def bed(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return the heights of a step, mm, rows by columns."""
    return np.array(seen[name]["bed"])


def finger(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return where the finger is in a step, mm."""
    return np.array(seen[name]["finger"])


def test_a_press_starts_a_session_and_puts_the_finger_under_the_mouse(seen: dict[str, Any]) -> None:
    assert (seen["added"]["sessions"], seen["pressed"]["sessions"]) == (0, 1)
    # 18 mm, 6 mm to a pixel of the picture: the bed of 75 mm is 500 pixels wide.
    np.testing.assert_allclose(finger(seen, "pressed")[:2], [18.0, 6.0], rtol=0, atol=0.3)
    assert finger(seen, "pressed")[2] == pytest.approx(REST - 4.0, abs=0.3)


def test_dragging_draws_a_valley_and_leaves_the_rest_of_the_bed_alone(seen: dict[str, Any]) -> None:
    drawn = bed(seen, "let go")
    assert drawn[ROW, COLUMNS].max() < REST - 1.0
    np.testing.assert_allclose(drawn[:4], REST, rtol=0, atol=1e-3)


def test_let_go_the_finger_leaves_the_bed(seen: dict[str, Any]) -> None:
    assert finger(seen, "let go")[2] > REST
    assert seen["let go"]["force"] == 0.0


def test_one_undo_takes_back_one_gesture_and_redo_brings_it_back(seen: dict[str, Any]) -> None:
    before, tapped = bed(seen, "let go"), bed(seen, "tapped")
    assert tapped[6, 12] < REST - 1.0
    np.testing.assert_allclose(bed(seen, "tap undone"), before, rtol=0, atol=SETTLING)
    np.testing.assert_allclose(bed(seen, "valley undone"), REST, rtol=0, atol=1e-3)
    np.testing.assert_allclose(bed(seen, "valley redone"), before, rtol=0, atol=SETTLING)
    assert seen["valley undone"]["sessions"] == 1


def test_the_wheel_presses_deeper_and_ctrl_in_mid_stroke_draws_on_as_deep(seen: dict[str, Any]) -> None:
    before, deeper, back = (
        finger(seen, f"{name}")[2] for name in ("before the wheel", "after the wheel", "after Ctrl")
    )
    assert deeper == pytest.approx(before - 2.0, abs=0.3)
    assert back == pytest.approx(deeper, abs=0.3)
    assert np.linalg.norm(np.subtract(finger(seen, "after Ctrl"), finger(seen, "after the wheel"))[:2]) > 3.0


def test_esc_takes_the_gesture_back_and_the_session_goes_on(seen: dict[str, Any]) -> None:
    np.testing.assert_allclose(bed(seen, "taken back"), bed(seen, "valley redone"), rtol=0, atol=SETTLING)
    assert seen["taken back"]["sessions"] == 1
    assert finger(seen, "taken back")[2] > REST


def test_clicks_pick_the_pins_under_the_mouse(seen: dict[str, Any]) -> None:
    # Column 12 of row 12 is the middle; 3 mm a pin.
    assert seen["picked"]["picked"] == [3 * 25 + 8, 3 * 25 + 12, 3 * 25 + 16]


def test_forces_are_written_once_they_are_shown(seen: dict[str, Any]) -> None:
    assert seen["pressed"]["forces written"] is False
    assert seen["forces shown"]["forces written"] is True


def test_the_overlay_is_drawn_while_a_session_runs_and_it_is_wanted(seen: dict[str, Any]) -> None:
    wanted = {"added": False, "pressed": True, "overlay off": False, "overlay on": True, "ended": False}
    assert {name: seen[name]["overlay"] for name in wanted} == wanted


def test_the_next_press_starts_the_session_anew_and_ends_with_its_bed(seen: dict[str, Any]) -> None:
    assert (seen["ended"]["sessions"], seen["started anew"]["sessions"]) == (0, 1)
    assert (seen["bed deleted"]["beds"], seen["bed deleted"]["sessions"]) == (0, 0)


def test_disabled_with_the_tool_in_hand_the_extension_leaves_the_first_one_there(
    seen: dict[str, Any],
) -> None:
    # What it left behind to draw would fail with a traceback, which ends `played`.
    assert seen["tools held"] == ["digiclay.press_tool", "builtin.select_box"]


def test_every_picture_shows_more_than_an_empty_window(seen: dict[str, Any]) -> None:
    # Shaded pins and a shaded fingertip have thousands of colors, a blank screen has one.
    assert len(seen["colors"]) == 5
    assert min(seen["colors"].values()) > 500
