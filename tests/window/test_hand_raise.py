"""A quick drag of the Press tool raises clay all along its way: X events from outside, without a pause."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played

REST = 40.0
#: The columns of the bed that lie on the strokes, 3 mm a pin.
COLUMNS = np.abs(np.arange(-36, 37, 3)) <= 30.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("hand_raise.py", tmp_path_factory.mktemp("hand"), size=(1100, 640), by_hand=True)


def up(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return how far the pins are up, mm, rows by columns."""
    return np.array(seen[name]["bed"]) - REST


@pytest.mark.parametrize(("name", "row"), [("raised", 12), ("inverted", 5)])
def test_a_quick_drag_of_60_mm_raises_all_its_columns_by_15_mm(
    seen: dict[str, Any], name: str, row: int
) -> None:
    risen = up(seen, name)[row, COLUMNS]
    assert (np.abs(risen - 15.0) < 2.0).mean() >= 0.95


def test_a_raised_ridge_is_one_undo_step(seen: dict[str, Any]) -> None:
    # The reset before it, called by the script, was none: what it removed is there again, as it was when the
    # stroke ended; pins still settled then by some µm.
    np.testing.assert_allclose(up(seen, "undone"), up(seen, "raised"), rtol=0, atol=0.05)
    assert np.abs(up(seen, "inverted") - up(seen, "raised")).max() > 10.0


def test_ctrl_makes_raise_lower(seen: dict[str, Any]) -> None:
    assert (up(seen, "lowered")[12, COLUMNS] < -1.0).mean() >= 0.95


def test_level_fills_a_valley_that_it_crosses(seen: dict[str, Any]) -> None:
    assert up(seen, "lowered")[12, 12] < -1.0
    # The pin in the middle of the crossing, and its neighbors along the stroke.
    np.testing.assert_allclose(up(seen, "leveled")[10:15, 12], 0.0, rtol=0, atol=1.5)
