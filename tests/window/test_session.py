"""A live session in a real Blender window, used by simulated key presses and mouse moves."""

import numpy as np
import pytest

from tests.assemble import assert_near
from tests.window.blender_window import played

PLAYED = {"script": "sculpt_a_ridge.py", "size": (1000, 640)}
#: Pins come to rest by hundredths of a millimeter for some time after the fingertip has left them.
SETTLING = 0.1e-3


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    return played("interrupt_a_session.py", tmp_path_factory.mktemp("interrupt"), (800, 600))


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    return played("random_events.py", tmp_path_factory.mktemp("random"), (800, 600))


def lowest(look):
    return float(look["heights"][0])


def test_dragging_moves_the_fingertip_of_a_bed_at_rest_and_nothing_else_without_a_session(seen):
    added, dragged = seen["added"], seen["dragged"]
    assert (added["beds"], added["modes"][0]) == (1, 625)
    moved = np.subtract(dragged["pose"][:3], added["pose"][:3])
    # The mouse goes where 9 mm are seen, to a pixel: 0.2 mm.
    assert_near(moved, [9e-3, 0, 0], 0.5e-3)
    assert dragged["heights"] == added["heights"]
    assert seen["drag undone"]["pose"] == added["pose"]


def test_the_ridge_grows_and_the_fingertip_is_felt_during_the_move(seen):
    pressing = [lowest(seen[f"pressing {step}"]) for step in range(1, 7)]
    assert pressing[-1] < pressing[0]
    # Cells that keep the height they were left at, and those the fingertip leaves behind: its
    # trail.
    modes = np.array([seen[f"drawing {step}"]["modes"] for step in range(1, 9)])
    trail = modes[:, 1] + modes[:, 7]
    assert (np.diff(trail) >= 0).all()
    assert trail[-1] > trail[1] + 20
    # The set point is 0.4 N.
    assert all(0.1 < seen[f"drawing {step}"]["force"] < 2.0 for step in range(2, 9))
    # Software GL draws a frame in a third of a second; 20 periods of 5 ms are simulated in between
    # at most.
    assert 0.0 < seen["drawn"]["factor"] <= 1.1


def test_what_was_formed_stays_when_lifted_and_backspace_and_undo_take_it_back_and_bring_it(seen):
    assert seen["lifted"]["modes"][1] > 100
    assert seen["lifted"]["force"] == 0.0
    assert lowest(seen["lifted"]) < 39e-3
    # Backspace takes back the last gesture alone, also after undo and redo.
    counts = [
        seen[name]["gestures"] for name in ("lift redone", "resumed", "rewound", "rewinding undone")
    ]
    assert counts == [seen["lifted"]["gestures"]] * 2 + [counts[0] - 1, counts[0]]
    assert counts[0] > 1
    assert lowest(seen["rewinding undone"]) == pytest.approx(lowest(seen["resumed"]), abs=SETTLING)


def test_undo_and_redo_take_one_gesture_after_the_other_and_the_session_goes_on(seen):
    done = ("lift undone", "draw undone", "draw redone", "lift redone")
    assert [seen[name]["sessions"] for name in done] == [1] * 4
    same = ("drawn", "pressed", "drawn", "lifted")
    assert [seen[name]["pose"] for name in done] == [seen[name]["pose"] for name in same]
    undone, pressed = seen["draw undone"], seen["pressed"]
    assert lowest(undone) == pytest.approx(lowest(pressed), abs=5 * SETTLING)
    # The trail is gone: nothing but the blister has left its rest, as after the press.
    assert undone["modes"][0] == pytest.approx(pressed["modes"][0], abs=5)
    assert lowest(seen["lift redone"]) == pytest.approx(lowest(seen["lifted"]), abs=SETTLING)


def test_p_pauses_and_resumes_and_shift_p_does_one_period(seen):
    paused = seen["paused"]
    assert (paused["paused"], seen["paused later"]["period"]) == (True, paused["period"])
    assert (seen["single step"]["paused"], seen["single step"]["period"]) == (
        True,
        paused["period"] + 1,
    )
    assert not seen["resumed"]["paused"]
    assert seen["resumed"]["period"] > paused["period"] + 1


def test_a_file_saved_in_mid_session_is_loaded_as_it_was_and_esc_keeps_what_is_formed(seen):
    saved, loaded, later, stopped = (
        seen[name] for name in ("saved", "loaded", "going on", "stopped")
    )
    assert [look["sessions"] for look in (loaded, later, stopped)] == [0, 1, 0]
    assert "another file was loaded" in loaded["said"]
    assert (loaded["heights"], loaded["kept"]) == (saved["heights"], saved["kept"])
    assert (later["period"] > saved["period"], stopped["kept"] > 0) == (True, True)
    assert lowest(later) == pytest.approx(lowest(saved), abs=SETTLING)
    assert lowest(stopped) == pytest.approx(lowest(later), abs=SETTLING)


@pytest.mark.parametrize(
    "stopped, words, again",
    [
        ("fingertip deleted", "fingertip is deleted", "fingertip back"),
        ("in another scene", "no window shows its scene", "scene back"),
        ("scaled", "must be the same along x, y and z", "scaled no more"),
    ],
)
def test_a_session_waits_with_the_reason_and_goes_on(interrupted, stopped, words, again):
    waiting, later = interrupted[stopped], interrupted[again]
    assert words in waiting["waits"]
    assert words in waiting["said"]
    assert (waiting["sessions"], later["sessions"], later["waits"]) == (1, 1, "")
    assert "goes on" in later["said"]
    assert lowest(later) == pytest.approx(lowest(interrupted["formed"]), abs=2 * SETTLING)


@pytest.mark.parametrize(
    "name, sessions",
    [
        pytest.param("in another workspace", 1, id="a session goes on in another workspace"),
        pytest.param("two beds", 2, id="each bed has a session of its own"),
        pytest.param("second bed deleted", 1, id="deleting one of two beds ends its session alone"),
        pytest.param("all deleted", 0, id="no session outlives its bed"),
        pytest.param("all back", 0, id="undo brings beds back without a session"),
        pytest.param("started again", 1, id="a session starts on a bed that was deleted"),
        pytest.param("enabled again", 0, id="disabling the extension ends the session"),
        pytest.param("going on", 1, id="a session starts after enabling"),
        pytest.param("another file", 0, id="loading another file ends the session"),
        pytest.param(
            "before quitting", 1, id="Blender quits with a session on, well as `played` requires"
        ),
    ],
)
def test_sessions_end_with_what_they_need(interrupted, name, sessions):
    assert interrupted[name]["sessions"] == sessions


def test_whatever_ends_a_session_says_so_and_leaves_the_state_and_nothing_else(interrupted):
    there, again, later = (
        interrupted[name] for name in ("in another workspace", "started again", "going on")
    )
    assert (there["waits"], there["period"] > interrupted["fingertip back"]["period"]) == ("", True)
    assert "its bed was deleted" in interrupted["second bed deleted"]["said"]
    assert lowest(again) == pytest.approx(lowest(interrupted["formed"]), abs=2 * SETTLING)
    assert later["period"] > again["period"]
    assert "another file was loaded" in interrupted["another file"]["said"]
    left = (
        interrupted["another file"]["beds"],
        interrupted["panels left"],
        interrupted["keys drawn"],
    )
    assert left == (0, [], [])


def test_esc_in_edit_mode_leaves_a_stroke_for_the_next_session_and_a_stretched_bed_is_not_adjusted(
    interrupted,
):
    # That nothing failed meanwhile is seen to by `played`.
    assert interrupted["strokes"] == [[1], [], [1]]
    assert "the bed is being edited" in interrupted["edited"]["waits"]
    assert "DIGICLAY_OT_press_size" not in interrupted["adjusting"]


def test_150_random_events_leave_no_traceback_and_a_bed_that_can_be_formed(tried):
    assert tried["done"] == 150
    # Most of them happened to a session, not to Blender alone.
    assert tried["live"] > 100
    assert tried["formed"]["sessions"] == 1
    assert lowest(tried["formed"]) < 39.5e-3


def test_the_shape_comes_up_and_a_session_goes_on_from_it_with_the_fingertip_above(seen):
    assert seen["flat"]["heights"] == pytest.approx([0.04, 0.04], abs=1e-7)
    # The dead band of the height control, 10 µm.
    assert seen["displayed"]["heights"] == pytest.approx([0.04, 0.052], abs=1.1e-5)
    assert seen["displayed"]["pose"][2] > 0.052
    assert seen["session on a shape"]["sessions"] == 1
    assert seen["session on a shape"]["heights"] == pytest.approx(
        seen["displayed"]["heights"], abs=1e-7
    )


def test_the_fingertip_forms_the_shape_which_is_made_a_mesh_and_kept_in_one_undo_step(seen):
    assert max(seen[name]["force"] for name in seen if name.startswith("into the shape")) > 0.1
    assert seen["formed shape"]["sessions"] == 0
    assert seen["formed shape"]["heights"] != pytest.approx(seen["displayed"]["heights"], abs=1e-4)
    assert seen["mesh"] == pytest.approx(seen["formed shape"]["heights"][1], abs=1e-7)
    assert (seen["kept"] > 100, seen["keeping undone"]) == (True, "ripple")
    assert (seen["beds"], seen["beds after undo"]) == (2, 1)


HAND = list(range(1, 8))


def test_fingertips_come_and_go_while_the_session_goes_on(seen):
    found = {
        name: seen[name]["numbers"] for name in ("two", "hand", "deleted", "hand again", "copied")
    }
    assert found == {
        "two": [1, 2],
        "hand": HAND,
        "deleted": [1, 2],
        "hand again": HAND,
        "copied": [*HAND, 8],
    }
    assert [seen[name]["tips"] == seen[name]["numbers"] for name in found] == [True] * 5
    assert [seen[name]["waits"] for name in found] == [""] * 5
    assert seen["hand"]["hidden"] == []


def test_two_fingertips_press_each_with_its_force_and_a_hand_as_one(seen):
    assert min(seen["two pressed"]["forces"]) > 0.01
    moved = np.array(seen["hand pressed"]["poses"]) - seen["hand"]["poses"]
    # The mouse moves by pixels, of 0.7 mm in a view that has the bed beside the open overlay.
    assert_near(moved[2:], [[0.0, 0.0, -9.0]] * 5, 0.7)
    assert_near(moved[:2], 0.0, 1e-3)
    assert min(seen["hand pressed"]["forces"]) > 0.01
