"""An impatient hand: its strokes do not wait for the clock, are finished at once, and taken back."""

import numpy as np
import pytest

from tests.window.blender_window import FORMED, down
from tests.window.hand_queue import LINES, LOADS

PLAYED = {"script": "hand_queue.py", "size": (800, 560), "by_hand": True}
#: Rows of the bed that lie on the lines, 3 mm a pin, and the columns looked at.
ROWS = [round((y + 36) / 3) for ((_, y), _) in LINES]
MIDDLE = slice(6, 19)


def formed(seen, name):
    return [bool((np.abs(down(seen, name)[row, MIDDLE]) > FORMED).all()) for row in ROWS]


def test_strokes_drawn_at_once_do_not_wait_for_the_clock_are_all_formed_and_undone_one_by_one(seen):
    assert seen["left"] >= 2  # the hand was faster
    assert formed(seen, "formed") == [True] * 3
    for count in (1, 2):
        assert formed(seen, f"undone {count}") == [True] * (3 - count) + [False] * count
        assert formed(seen, f"redone {count}") == [True] * (1 + count) + [False] * (2 - count)
    assert formed(seen, "backspace") == [True, True, False]
    # By the clock it were 5 ms in a tick, of which there are at most 30 a second. Software draws
    # for most of the time, and the machine is shared.
    assert seen["time"]["simulated"] > 2.0 * 0.15 * seen["time"]["after the hand"]


def test_strokes_are_finished_at_once_each_with_its_undo_step(seen):
    assert seen["finished"]["left"] == 0
    assert formed(seen, "finished") == formed(seen, "finished, formed") == [True] * 3
    assert formed(seen, "finished, undone") == [True, True, False]


def test_esc_lets_strokes_go_on_that_are_being_finished_at_once(seen):
    assert seen["let go on"]["left"] >= 1
    assert seen["let go on"]["sessions"] == 1
    assert formed(seen, "let go on, formed") == [True] * 3
    assert formed(seen, "let go on, undone") == [True, True, False]


def test_queued_strokes_are_taken_back_and_redone_one_by_one(seen):
    assert formed(seen, "two taken back") == [True, False, False]
    assert formed(seen, "two redone") == [True] * 3


@pytest.mark.parametrize("name", ["stopped", "opened"])
def test_three_times_esc_takes_back_no_stroke_and_a_file_saved_meanwhile_has_all(seen, name):
    assert seen["after Esc"] == 1  # the session stops when they are formed
    assert formed(seen, name) == [True] * 3


@pytest.mark.parametrize("name", list(LOADS)[1:])
def test_the_same_path_leaves_the_same_heights_whatever_the_load(seen, name):
    # The script may miss the last moves before a quick stroke ends: its path is no more than a
    # beginning.
    one, other = seen["alone"], seen[name]
    shorter = min(len(one["path"]), len(other["path"]))
    assert one["path"][:shorter] == other["path"][:shorter]
    assert np.array_equal(one["exact"], other["exact"])
    assert np.ptp(one["exact"]) > 1e-3
