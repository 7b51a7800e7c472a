"""Shift and a drag smooth, Shift and a click form a line: X events from outside, without a pause."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played
from tests.window.hand_smooth import HALF, SPIKE

REST = 40.0
#: Rows and column of the pins that stand out.
MIDDLE, ABOVE = (12, 12), (18, 12)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("hand_smooth.py", tmp_path_factory.mktemp("hand"), size=(1100, 640), by_hand=True)


def up(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return how far the pins are up, mm, rows by columns."""
    return np.array(seen[name]["bed"]) - REST


def test_shift_and_a_drag_smooth_a_spike_in_one_stroke(seen: dict[str, Any]) -> None:
    assert up(seen, "before")[MIDDLE] == pytest.approx(1e3 * SPIKE, abs=1e-3)
    assert up(seen, "smoothed")[MIDDLE] < 0.4e3 * SPIKE
    assert seen["smoothed"]["drawn"] == seen["before"]["drawn"] + 1
    # What one pin gives the others get.
    assert up(seen, "smoothed").sum() == pytest.approx(up(seen, "before").sum(), abs=625 * 0.01)


def test_the_stroke_begins_where_the_mouse_went_down(seen: dict[str, Any]) -> None:
    # A pixel is about 0.3 mm; a drag is told from a click after 3 of them.
    np.testing.assert_allclose(seen["smoothed"]["first"], [-HALF, 0.0], atol=0.5)


def test_pins_outside_the_ring_stay(seen: dict[str, Any]) -> None:
    rows = np.abs(np.arange(25) - 12) > 3
    np.testing.assert_array_equal(up(seen, "smoothed")[rows], up(seen, "before")[rows])


def test_ctrl_z_takes_the_smoothing_back(seen: dict[str, Any]) -> None:
    np.testing.assert_allclose(up(seen, "undone"), up(seen, "before"), rtol=0, atol=1e-3)


def test_the_brush_of_the_header_smooths_without_shift(seen: dict[str, Any]) -> None:
    assert up(seen, "by brush")[ABOVE] < 0.4e3 * SPIKE


def test_esc_in_mid_stroke_leaves_the_bed_as_before(seen: dict[str, Any]) -> None:
    np.testing.assert_allclose(up(seen, "escaped"), up(seen, "by brush"), rtol=0, atol=1e-3)
    assert seen["escaped"]["sessions"] == 1


def test_shift_and_a_click_still_form_a_line(seen: dict[str, Any]) -> None:
    assert up(seen, "line")[4, 3:22].max() < -1.0
