"""What outlives the view or the moment it was begun in, and beds that are whole, in a real Blender window."""

from __future__ import annotations

from typing import Any

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; a traceback anywhere in it ends `played`."""
    return played("outlive_a_view.py", tmp_path_factory.mktemp("outlive"), (800, 600))


def test_pins_are_picked_in_whichever_view_the_mouse_is_in(seen: dict[str, Any]) -> None:
    # Row 1 of 9 lies 9 mm before the middle; columns 2 and 6, 6 mm to either side.
    assert seen["picked"] == [9 + 2]
    assert seen["clicked in the timeline"] == [9 + 2]
    assert seen["picked elsewhere"] == [9 + 2, 9 + 6]


def test_the_keys_stand_in_the_workspace_that_is_shown_and_go_with_the_operator(seen: dict[str, Any]) -> None:
    assert seen["told in"] == ["Animation"]
    assert seen["after Enter"] == [[], []]


@pytest.mark.parametrize("area", ["VIEW_3D", "PROPERTIES"])
def test_esc_stops_a_session_that_has_stepped_aside_for_a_moment(seen: dict[str, Any], area: str) -> None:
    modal, running, after, later, token = seen[f"Esc over {area}"]
    assert (modal, running) == ([], 1)
    assert (after, later, token) == (0, [], 0)


#: Beds, those with a fingertip, objects in the scene (an ellipsoid each), hidden ones, sessions.
ONE, TWO, FOUR = [1, 1, 3, 0, 0], [2, 2, 6, 0, 0], [4, 4, 12, 0, 0]
WHOLE = {
    "one bed": ONE,
    "deleted": [0, 0, 0, 0, 0],
    "delete undone": ONE,
    "delete redone": [0, 0, 0, 0, 0],
    "delete undone again": ONE,
    # While it is dragged nothing is done to the file.
    "copy in hand": [2, 1, 4, 0, 0],
    "copied": TWO,
    "copy undone": ONE,
    "copy redone": TWO,
    "hidden": [2, 2, 6, 3, 0],
    "shown": TWO,
    "session": [2, 2, 6, 0, 1],
    "deleted in mid-session": ONE,
    "undone after it": TWO,
    "all copied": FOUR,
    "all deleted": [0, 0, 0, 0, 0],
    "all back": FOUR,
}


@pytest.mark.parametrize("name", WHOLE)
def test_a_bed_and_its_fingertip_are_one_under_the_hand(seen: dict[str, Any], name: str) -> None:
    assert seen[name] == WHOLE[name]
