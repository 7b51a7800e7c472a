"""A hand erases, locks and stamps, about a placed center; each is one undo step: X events from outside."""

import math

import numpy as np
import pytest

from tests.assemble import assert_near
from tests.window.blender_window import up
from tests.window.hand_verbs import CENTER

PLAYED = {"script": "hand_verbs.py", "size": (1300, 760), "by_hand": True}


def locked(seen, name):
    return np.array(seen[name]["locked"]).reshape(25, 25)


def test_erasing_brings_a_groove_back_to_rest_but_for_locked_pins(seen):
    kept, groove, erased = locked(seen, "locked"), up(seen, "groove"), up(seen, "erased")
    assert groove[12, 12] < -3.0
    # In perspective a hand wanders where the ground is low.
    assert kept[[6, 7, 8, 16, 17, 18], 12].all()
    assert kept[12].any()
    assert not kept[:, :6].any()
    np.testing.assert_array_equal(erased[kept], groove[kept])
    middle = erased[12, 6:16]
    assert np.abs(middle[~kept[12, 6:16]]).max() < 0.1


@pytest.mark.parametrize(
    "name, before",
    [
        ("erasing undone", "locked"),
        ("inverting undone", "erasing undone"),
        ("stamping undone", "cleared"),
    ],
)
def test_each_is_one_undo_step(seen, name, before):
    assert_near(up(seen, name), up(seen, before), 1e-3)
    np.testing.assert_array_equal(locked(seen, name), locked(seen, before))
    assert seen[name]["sessions"] == 1


def test_locks_are_turned_over_taken_off_by_ctrl_and_cleared(seen):
    kept = locked(seen, "locked")
    np.testing.assert_array_equal(locked(seen, "inverted"), ~kept)
    left = locked(seen, "unlocked")
    assert not left[6:12, 12].any()
    assert left[16:19, 12].all()
    assert not locked(seen, "cleared").any()
    assert_near(up(seen, "cleared"), up(seen, "erasing undone"), 1e-3)


def test_a_stamp_stands_where_and_as_large_as_it_was_drawn_and_ctrl_presses_it_in(seen):
    risen = up(seen, "stamped") - up(seen, "cleared")
    # In the row 18 mm behind the middle; the hand's place is good to a pixel or two.
    assert risen[18, 12] == pytest.approx(12.0, abs=0.8)
    across = np.flatnonzero(risen[18] > 0.5) * 3.0 - 36.0
    assert (across.min(), across.max()) == (
        pytest.approx(-13.5, abs=2.0),
        pytest.approx(13.5, abs=2.0),
    )
    sunk = up(seen, "imprinted") - up(seen, "cleared")
    assert sunk.min() == pytest.approx(-8.0, abs=0.8)
    assert sunk.max() < 0.01


def test_a_placed_center_has_five_rays_about_it(seen):
    x, y, axis = seen["center"]
    assert (x, y) == (pytest.approx(CENTER[0], abs=0.7), pytest.approx(CENTER[1], abs=0.7))
    assert axis == pytest.approx(math.pi / 4.0, abs=0.1)
    risen = up(seen, "radial") - up(seen, "flat")
    places = [
        (x + 15.0 * math.cos(turn), y + 15.0 * math.sin(turn))
        for turn in np.arange(5) * 0.4 * math.pi
    ]
    for place in places:
        column, row = (round(part / 3.0) + 12 for part in place)
        assert risen[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].max() > 5.0, place
    assert risen[round(y / 3.0) + 12, round(x / 3.0) + 12] < 5.9
