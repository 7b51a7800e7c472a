"""A live session driven by gizmo and playback, in second windows, during a render, and in other views."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played

REST = 40e-3


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("play_and_look.py", tmp_path_factory.mktemp("play"), (800, 600))


def test_the_bed_forms_while_the_gizmo_is_dragged(seen: dict[str, Any]) -> None:
    down = [seen[f"gizmo {step}"]["pose"][2] for step in range(1, 7)]
    assert (np.diff(down) <= 0.0).all()
    # The blue arrow is dragged by what 12 mm are seen as; what it takes to be a drag is a few pixels.
    assert down[0] - down[-1] == pytest.approx(12e-3, abs=3e-3)
    assert seen["gizmo 6"]["heights"][0] < REST - 0.1e-3


def test_the_bed_follows_an_animation_that_is_played(seen: dict[str, Any]) -> None:
    assert seen["played"]["heights"][0] < REST - 0.5e-3
    assert seen["played"]["sessions"] == 1


def test_the_first_esc_stops_the_session_and_the_next_the_playback(seen: dict[str, Any]) -> None:
    once, twice = seen["after one Esc"], seen["after two"]
    assert (once["sessions"], once["plays"]) == (0, True)
    assert (twice["sessions"], twice["plays"]) == (0, False)


def test_closing_another_window_leaves_the_session_alone(seen: dict[str, Any]) -> None:
    closed = seen["second window closed"]
    assert (closed["windows"], closed["sessions"], closed["waits"]) == (1, 1, "")


def test_closing_the_sessions_own_window_ends_it_with_the_reason(seen: dict[str, Any]) -> None:
    assert seen["started in the second"]["sessions"] == 1
    closed = seen["its own window closed"]
    assert (closed["windows"], closed["sessions"]) == (1, 0)
    assert "its window was closed" in closed["said"]


def test_what_was_recorded_in_a_window_that_is_closed_is_a_take_in_an_undo_step(seen: dict[str, Any]) -> None:
    assert seen["kept when its window was closed"] == ["Take 1"]
    assert "kept as Take 1" in seen["its own window closed"]["said"]
    assert seen["kept after undo and redo"] == ["Take 1"]


def test_a_session_waits_while_a_picture_is_rendered(seen: dict[str, Any]) -> None:
    assert "a render is under way" in seen["waits in a render"]
    assert (seen["rendered"]["sessions"], seen["rendered"]["waits"]) == (1, "")


@pytest.mark.parametrize(("name", "place"), [("orthographic", (-15e-3, 9e-3)), ("quad view", (15e-3, -9e-3))])
def test_the_press_tool_presses_under_the_mouse_in_every_view(
    seen: dict[str, Any], name: str, place: tuple[float, float]
) -> None:
    # A pixel of the small views is up to 1 mm of the bed.
    np.testing.assert_allclose(seen[name]["pose"][:2], place, rtol=0, atol=1.5e-3)
    assert seen[name]["pose"][2] < REST - 3e-3


def test_the_overlay_writes_into_one_quarter_of_a_quad_view_and_marks_picked_pins_in_all(
    seen: dict[str, Any],
) -> None:
    # Where two pictures of the same pins stand side by side, one text is enough.
    writes = [words for words, _ in seen["drawn in the quarters"]]
    assert sorted(writes) == [False, False, False, True]
    assert seen["drawn where the view can be turned"] == [True, True]
    assert [marks for _, marks in seen["drawn in the quarters"]] == [True] * 4


def test_a_session_outlives_the_view_it_was_started_in(seen: dict[str, Any]) -> None:
    # The view is maximized in mid-session. Blender states it when the area of an operator is gone.
    assert "internal error" not in seen["output"]


def test_every_picture_shows_more_than_an_empty_window(seen: dict[str, Any]) -> None:
    # Shaded pins and a shaded fingertip have thousands of colors, a blank screen has one.
    assert len(seen["colors"]) == 4
    assert min(seen["colors"].values()) > 1000
