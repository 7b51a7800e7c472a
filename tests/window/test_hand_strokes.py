"""What a hand draws with the Press tool is formed whole: X events from outside, without a pause."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played
from tests.window.hand_strokes import HALF, STROKES, TAPS

REST = 40.0
#: The columns of the bed that lie on the strokes, 3 mm a pin, and their row.
COLUMNS = np.abs(np.arange(-36, 37, 3)) <= HALF
ROW = 12
#: A pin that a finger of 4 mm depth has passed is down by more than this, mm.
FORMED = 1.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("hand_strokes.py", tmp_path_factory.mktemp("hand"), size=(800, 560), by_hand=True)


def down(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return how far the pins are down, mm, rows by columns."""
    return REST - np.array(seen[name]["bed"])


@pytest.mark.parametrize("duration", [duration for duration, _ in STROKES])
def test_a_stroke_is_formed_in_all_its_columns(seen: dict[str, Any], duration: float) -> None:
    formed = down(seen, f"stroke {duration:g}")[ROW, COLUMNS] > FORMED
    assert formed.mean() >= 0.95


def test_a_stroke_is_formed_while_blender_shows_a_message(seen: dict[str, Any]) -> None:
    # The timer of a message gives every operator events that name the release of the stroke before.
    assert seen["message"].endswith("goes on")
    assert (down(seen, "stroke under a message")[ROW, COLUMNS] > FORMED).mean() >= 0.95


def test_a_stroke_leaves_alone_what_it_does_not_pass(seen: dict[str, Any]) -> None:
    np.testing.assert_allclose(down(seen, "stroke 1")[:4], 0.0, rtol=0, atol=1e-3)


def test_three_presses_within_a_second_all_form_and_one_undo_takes_back_one(seen: dict[str, Any]) -> None:
    def formed(name: str) -> list[bool]:
        cells = [(round((y + 36) / 3), round((x + 36) / 3)) for x, y in TAPS]
        return [bool(down(seen, name)[cell] > FORMED) for cell in cells]

    assert formed("before the taps") == [False] * 3
    assert formed("taps") == [True] * 3
    assert formed("one tap undone") == [True, True, False]


def test_the_view_turns_and_zooms_in_mid_stroke_and_the_stroke_goes_on(seen: dict[str, Any]) -> None:
    before, middle, after = (seen[name] for name in ("before orbit", "in mid-stroke", "after orbit"))
    assert np.abs(np.subtract(before["view"], middle["view"])).max() > 0.02
    assert middle["distance"] < before["distance"]
    assert (middle["drawn"], after["drawn"]) == (before["drawn"], before["drawn"] + 1)
    ends = down(seen, "after orbit")[ROW, [3, 21]]
    assert ends.min() > FORMED


def test_a_stroke_pans_in_its_middle_and_ends_where_a_pie_menu_has_taken_the_release(
    seen: dict[str, Any],
) -> None:
    assert np.abs(seen["pie menu"]["panned"]).max() > 0.01
    row = down(seen, "pie menu")[ROW]
    # Formed up to the middle, and not to where the mouse went after the release.
    assert row[4:12].min() > FORMED
    assert np.abs(row[20:]).max() < 0.5


@pytest.mark.parametrize("name", ["undone", "escaped"])
def test_an_unfinished_stroke_is_taken_back_by_ctrl_z_and_by_esc_and_the_session_goes_on(
    seen: dict[str, Any], name: str
) -> None:
    assert np.abs(down(seen, name)).max() < 1e-3
    assert seen[name]["sessions"] == 1
