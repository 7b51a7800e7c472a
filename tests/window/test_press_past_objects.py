"""A click on an object in front of a bed is for that object; pins that are seen are pressed."""

import numpy as np
import pytest

from tests.window.blender_window import Seen

PLAYED = {"script": "press_past_objects.py", "size": (800, 560), "by_hand": True}


@pytest.mark.parametrize("name", ["perspective", "orthographic", "camera"])
def test_a_click_on_an_object_selects_it_and_one_beside_it_presses(seen: Seen, name: str) -> None:
    before = seen[name]["covered"]
    assert seen[name]["covered selected"] == ["Cube"]
    assert seen[name]["bare"] == before + 1


def test_pins_that_are_seen_are_pressed_through_xray_and_on_the_way_behind_an_object(seen: Seen) -> None:
    assert seen["xray"]["covered selected"] == []
    assert seen["xray"]["bare"] == seen["camera"]["bare"] + 2
    # 24 mm to either side of the middle, 3 mm a pin; the fingertip presses 4 mm deep.
    assert np.max(seen["drawn under"][4:21]) < 40.0 - 1.0


def test_in_a_quad_view_each_quarter_sees_for_itself_and_a_click_says_what_hides_the_bed(seen: Seen) -> None:
    found = seen["quarters"]
    assert (found["count"], found["top covered"], found["top bare"]) == (4, [False], [True])
    assert seen["reported"].count("Cube hides the bed here") == 3  # in three views


def test_a_bed_that_is_added_in_a_cube_goes_on_top_of_it_or_beside_it_where_that_is_seen(seen: Seen) -> None:
    # Its origin is the floor of the bed, a little above its underside; the cube is 2 units large.
    where = {axis: tuple(one > 1.0 for one in seen[axis]) for axis in ("TOP", "FRONT", "BOTTOM")}
    assert where == {"TOP": (False, True), "FRONT": (False, True), "BOTTOM": (True, False)}
