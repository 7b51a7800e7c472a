"""A hand raises, levels, smooths, erases, locks and stamps; each is one undo step: X events from outside."""

import math

import numpy as np
import pytest

from tests.window.blender_window import REST, Seen, bed
from tests.window.hand_brushes import CENTER, HALF, LONG, SPIKE

PLAYED = {"script": "hand_brushes.py", "size": (1300, 760), "by_hand": True}
#: The columns of the bed that lie on the strokes that raise, 3 mm a pin.
COLUMNS = np.abs(np.arange(-36, 37, 3)) <= LONG
MIDDLE, ABOVE = (12, 12), (18, 12)


def up(seen: Seen, name: str) -> np.ndarray:
    """Return how far the pins are up, mm, rows by columns."""
    return bed(seen, name) - REST


@pytest.mark.parametrize(("name", "row"), [("raised", 12), ("inverted", 5)])
def test_a_quick_drag_of_60_mm_raises_all_its_columns_by_15_mm(seen: Seen, name: str, row: int) -> None:
    risen = up(seen, name)[row, COLUMNS]
    assert (np.abs(risen - 15.0) < 2.0).mean() >= 0.95


def test_ctrl_makes_raise_lower_and_level_fills_a_valley_that_it_crosses(seen: Seen) -> None:
    assert (up(seen, "lowered")[12, COLUMNS] < -1.0).mean() >= 0.95
    assert up(seen, "lowered")[12, 12] < -1.0
    # The pin in the middle of the crossing, and its neighbors along the stroke.
    np.testing.assert_allclose(up(seen, "leveled")[10:15, 12], 0.0, rtol=0, atol=1.5)


def test_shift_and_a_drag_smooth_a_spike_in_one_stroke(seen: Seen) -> None:
    before, smoothed = up(seen, "before"), up(seen, "smoothed")
    assert before[MIDDLE] == pytest.approx(1e3 * SPIKE, abs=1e-3)
    assert smoothed[MIDDLE] < 0.4e3 * SPIKE
    assert seen["smoothed"]["drawn"] == seen["before"]["drawn"] + 1
    # What one pin gives the others get, and those outside the ring stay.
    assert smoothed.sum() == pytest.approx(before.sum(), abs=625 * 0.01)
    outside = np.abs(np.arange(25) - 12) > 3
    np.testing.assert_array_equal(smoothed[outside], before[outside])
    # It begins where the mouse went down, by 0.3 mm a pixel: a drag is told from a click after 3 of them.
    np.testing.assert_allclose(seen["smoothed"]["first"], [-HALF, 0.0], atol=0.5)


@pytest.mark.parametrize(
    ("name", "before", "tolerance"),
    [
        # The script's reset before it was no undo step: what it removed is there again, as it was when the
        # stroke ended; pins still settled then by some µm.
        pytest.param("raising undone", "raised", 0.05, id="a raised ridge is one undo step"),
        pytest.param("undone", "before", 1e-3, id="Ctrl-Z takes the smoothing back"),
        pytest.param("escaped", "by brush", 1e-3, id="Esc in mid-stroke leaves the bed as before"),
    ],
)
def test_what_is_taken_back_is_as_before(seen: Seen, name: str, before: str, tolerance: float) -> None:
    np.testing.assert_allclose(up(seen, name), up(seen, before), rtol=0, atol=tolerance)
    assert seen[name]["sessions"] == 1
    assert np.abs(up(seen, "inverted") - up(seen, "raised")).max() > 10.0


def test_the_brush_of_the_header_smooths_without_shift_and_shift_with_a_click_forms_a_line(seen):
    assert up(seen, "by brush")[ABOVE] < 0.4e3 * SPIKE
    assert up(seen, "line")[4, 3:22].max() < -1.0


def locked(seen: Seen, name: str) -> np.ndarray:
    return np.array(seen[name]["locked"]).reshape(25, 25)


def test_erasing_brings_a_groove_back_to_rest_but_for_locked_pins(seen: Seen) -> None:
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
    ("name", "before"),
    [("erasing undone", "locked"), ("inverting undone", "erasing undone"), ("stamping undone", "cleared")],
)
def test_each_is_one_undo_step(seen: Seen, name: str, before: str) -> None:
    np.testing.assert_allclose(up(seen, name), up(seen, before), rtol=0, atol=1e-3)
    np.testing.assert_array_equal(locked(seen, name), locked(seen, before))
    assert seen[name]["sessions"] == 1


def test_locks_are_turned_over_taken_off_by_ctrl_and_cleared(seen: Seen) -> None:
    kept = locked(seen, "locked")
    np.testing.assert_array_equal(locked(seen, "inverted"), ~kept)
    left = locked(seen, "unlocked")
    assert not left[6:12, 12].any()
    assert left[16:19, 12].all()
    assert not locked(seen, "cleared").any()
    np.testing.assert_allclose(up(seen, "cleared"), up(seen, "erasing undone"), rtol=0, atol=1e-3)


def test_a_stamp_stands_where_and_as_large_as_it_was_drawn_and_ctrl_presses_it_in(seen: Seen) -> None:
    risen = up(seen, "stamped") - up(seen, "cleared")
    # In the row 18 mm behind the middle; the hand's place is good to a pixel or two.
    assert risen[18, 12] == pytest.approx(12.0, abs=0.8)
    across = np.flatnonzero(risen[18] > 0.5) * 3.0 - 36.0
    assert (across.min(), across.max()) == (pytest.approx(-13.5, abs=2.0), pytest.approx(13.5, abs=2.0))
    sunk = up(seen, "imprinted") - up(seen, "cleared")
    assert sunk.min() == pytest.approx(-8.0, abs=0.8)
    assert sunk.max() < 0.01


def test_a_placed_center_has_five_rays_about_it(seen: Seen) -> None:
    x, y, axis = seen["center"]
    assert (x, y) == (pytest.approx(CENTER[0], abs=0.7), pytest.approx(CENTER[1], abs=0.7))
    assert axis == pytest.approx(math.pi / 4.0, abs=0.1)
    risen = up(seen, "radial") - up(seen, "flat")
    places = [(x + 15.0 * math.cos(turn), y + 15.0 * math.sin(turn)) for turn in np.arange(5) * 0.4 * math.pi]
    for place in places:
        column, row = (round(part / 3.0) + 12 for part in place)
        assert risen[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].max() > 5.0, place
    assert risen[round(y / 3.0) + 12, round(x / 3.0) + 12] < 5.9
