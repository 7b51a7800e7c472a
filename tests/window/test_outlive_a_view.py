"""What outlives the view or the moment it was begun in, and beds that are whole, in a real Blender window."""

import pytest

from tests.window.blender_window import Seen

PLAYED = {"script": "outlive_a_view.py", "size": (800, 600)}


def test_pins_are_picked_in_whichever_view_the_mouse_is_in_and_its_workspace_has_the_keys(seen: Seen) -> None:
    # Row 1 of 9 lies 9 mm before the middle; columns 2 and 6, 6 mm to either side.
    places = ("picked", "clicked in the timeline", "picked elsewhere")
    assert [seen[name] for name in places] == [[9 + 2], [9 + 2], [9 + 2, 9 + 6]]
    assert (seen["told in"], seen["after Enter"]) == (["Animation"], [[], []])


@pytest.mark.parametrize("area", ["VIEW_3D", "PROPERTIES"])
def test_esc_stops_a_session_that_has_stepped_aside_for_a_moment(seen: Seen, area: str) -> None:
    # Modal operators and sessions before, and with the session's token after.
    assert seen[f"Esc over {area}"] == [[], 1, 0, [], 0]


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
def test_a_bed_and_its_fingertip_are_one_under_the_hand(seen: Seen, name: str) -> None:
    assert seen[name] == WHOLE[name]
