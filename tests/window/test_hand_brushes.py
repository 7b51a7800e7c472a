"""A quick drag raises all along its way, Shift smooths or forms a line: X events from outside."""

import numpy as np
import pytest

from tests.assemble import assert_near
from tests.window.blender_window import up
from tests.window.hand_brushes import HALF, LONG, SPIKE

PLAYED = {"script": "hand_brushes.py", "size": (1100, 640), "by_hand": True}
#: The columns of the bed that lie on the strokes that raise, 3 mm a pin.
COLUMNS = np.abs(np.arange(-36, 37, 3)) <= LONG
#: Rows and column of the pins that stand out.
MIDDLE, ABOVE = (12, 12), (18, 12)


@pytest.mark.parametrize("name, row", [("raised", 12), ("inverted", 5)])
def test_a_quick_drag_of_60_mm_raises_all_its_columns_by_6_mm(seen, name, row):
    risen = up(seen, name)[row, COLUMNS]
    assert (np.abs(risen - 6.0) < 2.0).mean() >= 0.95


def test_ctrl_lowers_level_fills_a_valley_the_header_smooths_and_a_click_with_shift_forms_a_line(
    seen,
):
    assert (up(seen, "lowered")[12, COLUMNS] < -1.0).mean() >= 0.95
    assert up(seen, "lowered")[12, 12] < -1.0
    # The pin in the middle of the crossing, and its neighbors along the stroke.
    assert_near(up(seen, "leveled")[10:15, 12], 0.0, 1.5)
    assert up(seen, "by brush")[ABOVE] < 0.4e3 * SPIKE
    assert up(seen, "line")[4, 3:22].max() < -1.0


def test_shift_and_a_drag_smooth_a_spike_in_one_stroke(seen):
    before, smoothed = up(seen, "before"), up(seen, "smoothed")
    assert before[MIDDLE] == pytest.approx(1e3 * SPIKE, abs=1e-3)
    assert smoothed[MIDDLE] < 0.4e3 * SPIKE
    assert seen["smoothed"]["drawn"] == seen["before"]["drawn"] + 1
    # Each pin comes between those about it, and those outside the ring stay.
    assert -0.01 < smoothed.min() < smoothed.max() < before.max() + 0.01
    outside = np.abs(np.arange(25) - 12) > 3
    np.testing.assert_array_equal(smoothed[outside], before[outside])
    # It begins where the mouse went down, by 0.3 mm a pixel: a drag is told from a click after 3 of
    # them.
    np.testing.assert_allclose(seen["smoothed"]["first"], [-HALF, 0.0], atol=0.5)


def measure_bend(path):
    """Return how far a path is from the straight line between its ends, mm."""
    path = np.array(path)
    along, way = (path[-1] - path[0]) / np.linalg.norm(path[-1] - path[0]), path - path[0]
    return np.abs(along[0] * way[:, 1] - along[1] * way[:, 0]).max()


def test_a_line_straight_in_perspective_is_straight_on_the_rest_plane_and_bends_on_a_ridge(seen):
    # Half a pixel of 0.3 mm at a hand that goes to whole ones.
    assert measure_bend(seen["PLANE"]["path"]) < 0.4
    assert measure_bend(seen["SURFACE"]["path"]) > 5.0


@pytest.mark.parametrize(
    "name, before, tolerance",
    [
        # The script's reset before it was no undo step: what it removed is there again, as it was
        # when the stroke ended; pins still settled then by some µm.
        pytest.param("raising undone", "raised", 0.05, id="a raised ridge is one undo step"),
        pytest.param("undone", "before", 1e-3, id="Ctrl-Z takes the smoothing back"),
        pytest.param("escaped", "by brush", 1e-3, id="Esc in mid-stroke leaves the bed as before"),
    ],
)
def test_what_is_taken_back_is_as_before(seen, name, before, tolerance):
    assert_near(up(seen, name), up(seen, before), tolerance)
    assert seen[name]["sessions"] == 1
    assert np.abs(up(seen, "inverted") - up(seen, "raised")).max() > 5.0
