"""A scene in millimeters: a bed of its true size, seen whole, formed by the mouse."""

import pytest

from tests.assemble import assert_near
from tests.window.blender_window import up
from tests.window.in_millimeters import PLACES

PLAYED = {"script": "in_millimeters.py", "size": (1000, 700), "by_hand": True}


def test_a_bed_has_its_true_size_and_a_millimeter_is_a_millimeter(seen):
    # Outermost pins are 72 mm apart; about them are the housing's gap and wall.
    assert 72.0 < seen["size"][0] < 100.0
    assert seen["millimeter"] == pytest.approx(1.0, rel=1e-6)


def test_a_stroke_of_the_mouse_has_its_height(seen):
    ridge = up(seen, "raised")[12, 4:21]
    assert_near(ridge, 6.0, 0.1)
    assert_near(up(seen, "raised")[[0, 24]], 0.0, 0.1)


@pytest.mark.parametrize("name", ["large", "small"])
def test_the_view_cuts_nothing_off_a_bed_that_is_added(seen, name):
    assert seen[name] == [list(map(int, place)) for place in PLACES]
