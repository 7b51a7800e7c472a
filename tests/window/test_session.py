"""A live session in a real Blender window, used by simulated key presses and mouse moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played

#: Pins come to rest by hundredths of a millimeter for some time after the finger has left them.
SETTLING = 0.1e-3


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what stood in the scene after each step of a user's session."""
    return played("sculpt_a_ridge.py", tmp_path_factory.mktemp("ridge"))


def lowest(look: dict[str, Any]) -> float:
    """Return the lowest pin top drawn, m."""
    return float(look["heights"][0])


def test_one_bed_is_added_at_rest(seen: dict[str, Any]) -> None:
    assert (seen["added"]["beds"], seen["added"]["modes"][0]) == (1, 625)


def test_dragging_moves_the_fingertip_and_nothing_else_without_a_session(seen: dict[str, Any]) -> None:
    added, dragged = seen["added"], seen["dragged"]
    moved = np.subtract(dragged["pose"][:3], added["pose"][:3])
    # The mouse goes where 9 mm are seen, to a pixel: 0.2 mm.
    np.testing.assert_allclose(moved, [9e-3, 0, 0], rtol=0, atol=0.5e-3)
    assert dragged["heights"] == added["heights"]


def test_one_undo_takes_back_the_drag(seen: dict[str, Any]) -> None:
    assert seen["drag undone"]["pose"] == seen["added"]["pose"]


def test_the_ridge_grows_during_the_move(seen: dict[str, Any]) -> None:
    pressing = [lowest(seen[f"pressing {step}"]) for step in range(1, 7)]
    assert pressing[-1] < pressing[0]
    # Cells that keep the height they were left at, and those the finger leaves behind: its trail.
    trail = [
        seen[f"drawing {step}"]["modes"][1] + seen[f"drawing {step}"]["modes"][7] for step in range(1, 9)
    ]
    assert (np.diff(trail) >= 0).all()
    assert trail[-1] > trail[1] + 20


def test_the_finger_is_felt_while_it_is_moved(seen: dict[str, Any]) -> None:
    # The set point is 0.4 N.
    assert all(0.1 < seen[f"drawing {step}"]["force"] < 2.0 for step in range(2, 9))


def test_a_machine_too_slow_tells_its_speed(seen: dict[str, Any]) -> None:
    # Software GL draws a frame in a third of a second; 20 periods of 5 ms are simulated in between at most.
    assert 0.0 < seen["drawn"]["factor"] <= 1.1


def test_what_was_formed_stays_when_the_finger_is_lifted(seen: dict[str, Any]) -> None:
    assert seen["lifted"]["modes"][1] > 100
    assert seen["lifted"]["force"] == 0.0
    assert lowest(seen["lifted"]) < 39e-3


def test_undo_takes_back_one_gesture_after_the_other_and_the_session_goes_on(seen: dict[str, Any]) -> None:
    pressed, drawn = seen["pressed"], seen["drawn"]
    once, twice = seen["lift undone"], seen["draw undone"]
    assert (once["sessions"], twice["sessions"]) == (1, 1)
    assert once["pose"] == drawn["pose"]
    assert twice["pose"] == pressed["pose"]
    assert lowest(twice) == pytest.approx(lowest(pressed), abs=5 * SETTLING)
    # The trail is gone: nothing but the blister has left its rest, as after the press.
    assert twice["modes"][0] == pytest.approx(pressed["modes"][0], abs=5)


def test_redo_brings_back_one_gesture_after_the_other(seen: dict[str, Any]) -> None:
    assert seen["draw redone"]["pose"] == seen["drawn"]["pose"]
    assert seen["lift redone"]["pose"] == seen["lifted"]["pose"]
    assert lowest(seen["lift redone"]) == pytest.approx(lowest(seen["lifted"]), abs=SETTLING)


def test_p_pauses_and_resumes_and_shift_p_does_one_period(seen: dict[str, Any]) -> None:
    paused = seen["paused"]
    assert (paused["paused"], seen["paused later"]["period"]) == (True, paused["period"])
    assert (seen["single step"]["paused"], seen["single step"]["period"]) == (True, paused["period"] + 1)
    assert not seen["resumed"]["paused"]
    assert seen["resumed"]["period"] > paused["period"] + 1


def test_backspace_takes_back_a_gesture_and_undo_brings_it_back(seen: dict[str, Any]) -> None:
    assert lowest(seen["rewound"]) > lowest(seen["resumed"]) + 1e-3
    assert lowest(seen["rewinding undone"]) == pytest.approx(lowest(seen["resumed"]), abs=SETTLING)


def test_a_file_saved_in_mid_session_is_loaded_as_it_was(seen: dict[str, Any]) -> None:
    saved, loaded = seen["saved"], seen["loaded"]
    assert loaded["sessions"] == 0
    assert "another file was loaded" in loaded["said"]
    assert (loaded["heights"], loaded["kept"]) == (saved["heights"], saved["kept"])
    assert (seen["going on"]["sessions"], seen["going on"]["period"] > saved["period"]) == (1, True)
    assert lowest(seen["going on"]) == pytest.approx(lowest(saved), abs=SETTLING)


def test_esc_stops_the_session_and_the_bed_keeps_what_was_formed(seen: dict[str, Any]) -> None:
    stopped = seen["stopped"]
    assert (stopped["sessions"], stopped["kept"] > 0) == (0, True)
    assert lowest(stopped) == pytest.approx(lowest(seen["going on"]), abs=SETTLING)


@pytest.mark.parametrize("name", ["ridge", "lifted", "undone", "paused", "loaded", "stopped"])
def test_every_screenshot_shows_more_than_an_empty_window(seen: dict[str, Any], name: str) -> None:
    # Shaded pins and a shaded fingertip have thousands of colors, a blank screen has one.
    assert seen["colors"][f"session_{name}"] > 1000


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what stood in the scene after each thing that was done to a session."""
    return played("interrupt_a_session.py", tmp_path_factory.mktemp("interrupt"), (800, 600))


@pytest.mark.parametrize(
    ("stopped", "words", "again"),
    [
        ("fingertip deleted", "fingertip is deleted", "fingertip back"),
        ("in another scene", "no window shows its scene", "scene back"),
        ("edited", "the bed is being edited", "edited no more"),
        ("scaled", "must be the same along x, y and z", "scaled no more"),
    ],
)
def test_a_session_waits_with_the_reason_and_goes_on(
    interrupted: dict[str, Any], stopped: str, words: str, again: str
) -> None:
    waiting, later = interrupted[stopped], interrupted[again]
    assert words in waiting["waits"]
    assert words in waiting["said"]
    assert (waiting["sessions"], later["sessions"], later["waits"]) == (1, 1, "")
    assert "goes on" in later["said"]
    assert lowest(later) == pytest.approx(lowest(interrupted["formed"]), abs=2 * SETTLING)


def test_esc_in_edit_mode_takes_a_stroke_back_and_a_stretched_bed_is_not_adjusted(
    interrupted: dict[str, Any],
) -> None:
    # That nothing failed meanwhile is seen to by `played`.
    assert interrupted["strokes"] == [[1], [0]]
    assert "DIGICLAY_OT_press_size" not in interrupted["adjusting"]


def test_a_session_goes_on_in_another_workspace(interrupted: dict[str, Any]) -> None:
    there = interrupted["in another workspace"]
    assert (there["sessions"], there["waits"]) == (1, "")
    assert there["period"] > interrupted["fingertip back"]["period"]


def test_deleting_one_of_two_beds_ends_its_session_alone(interrupted: dict[str, Any]) -> None:
    assert interrupted["two beds"]["sessions"] == 2
    assert interrupted["second bed deleted"]["sessions"] == 1
    assert "its bed was deleted" in interrupted["second bed deleted"]["said"]


def test_a_bed_that_was_deleted_comes_back_with_its_state(interrupted: dict[str, Any]) -> None:
    assert (interrupted["all deleted"]["sessions"], interrupted["all back"]["sessions"]) == (0, 0)
    again = interrupted["started again"]
    assert again["sessions"] == 1
    assert lowest(again) == pytest.approx(lowest(interrupted["formed"]), abs=2 * SETTLING)


def test_disabling_the_extension_ends_the_session_and_enabling_it_goes_on(
    interrupted: dict[str, Any],
) -> None:
    assert interrupted["panels left"] == []
    assert interrupted["enabled again"]["sessions"] == 0
    assert interrupted["going on"]["sessions"] == 1
    assert interrupted["going on"]["period"] > interrupted["started again"]["period"]


def test_loading_another_file_ends_the_session(interrupted: dict[str, Any]) -> None:
    other = interrupted["another file"]
    assert (other["beds"], other["sessions"], interrupted["keys drawn"]) == (0, 0, [])
    assert "another file was loaded" in other["said"]


def test_blender_quits_with_a_session_on(interrupted: dict[str, Any]) -> None:
    # That it ended well is seen to by `played`.
    assert interrupted["before quitting"]["sessions"] == 1


@pytest.fixture(scope="module")
def tried(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what three hundred random events came to; they check what must hold after each."""
    return played("random_events.py", tmp_path_factory.mktemp("random"), (800, 600))


def test_300_random_events_leave_no_traceback_and_no_broken_state(tried: dict[str, Any]) -> None:
    assert len(tried["done"]) == 300
    # Most of them happened to a session, not to Blender alone.
    assert tried["live"] > 200


def test_after_random_events_a_bed_can_be_formed(tried: dict[str, Any]) -> None:
    assert tried["formed"]["sessions"] == 1
    assert lowest(tried["formed"]) < 39.5e-3


@pytest.mark.parametrize("name", ["random", "after_random"])
def test_the_screenshots_of_random_events_are_pictures(tried: dict[str, Any], name: str) -> None:
    assert tried["colors"][f"session_{name}"] > 500
