"""Strokes by a hand while a 3D mouse turns the view, in a quad view and a second window; the way back."""

import numpy as np
import pytest

from tests.window.blender_window import BLENDER, FORMED, down, played
from tests.window.hand_strokes import HALF
from tests.window.space_mouse import VARIABLE, driver

PITCH = 3.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Play the script once, with a 3D mouse; return what stood in the scene after each of its steps."""
    with (
        driver(tmp_path_factory.mktemp("mouse"), BLENDER) as path,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setenv(VARIABLE, path)
        out = tmp_path_factory.mktemp("elsewhere")
        return played("hand_elsewhere.py", out, size=(800, 560), by_hand=True)


@pytest.mark.parametrize("name", ["turned", "quarter", "second window"])
def test_a_stroke_is_formed_wherever_the_hand_has_drawn(seen, name):
    # The path is that of the samples that the tool has queued while the button was held.
    path = np.array(seen[name]["path"])
    np.testing.assert_allclose(path[[0, -1]], [[-HALF, 0.0], [HALF, 0.0]], rtol=0, atol=2.0)
    columns, rows = np.rint(path / PITCH + 12).astype(int).clip(0, 24).T
    assert (down(seen, name)[rows, columns] > FORMED).mean() >= 0.95


def test_a_3d_mouse_turns_the_view_and_the_wheels_of_a_trackpad_zoom_in_mid_stroke(seen):
    assert seen["turned"]["held"]
    assert seen["turned"]["turned"] > 0.03
    assert seen["turned"]["nearer"] > 1.05


def test_a_second_window_leaves_the_session_to_the_first_and_one_click_leaves_sculpt_mode(seen):
    assert (seen["second window"]["windows"], seen["second window"]["sessions"]) == (2, 1)
    assert seen["mode before"] == "SCULPT"
    assert seen["back"] == {"mode": "OBJECT", "tool": "digiclay.press_tool"}
