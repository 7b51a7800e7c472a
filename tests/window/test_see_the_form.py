"""A designer sees the form: a skin that can be pressed, no outline of pins, and nothing before the bed."""

import pytest

PLAYED = {"script": "see_the_form.py", "by_hand": True}
#: Orange pixels that have another cause than an outline: the dot at the origin of an object, icons.
FEW = 150


def test_ten_valleys_of_3_mm_are_read_from_above_and_the_light_that_a_user_chooses_remains(seen):
    # A tenth is seen at a glance. As pins in the light of the factory file they differ by color
    # alone.
    assert len(seen["lit"]) == 10
    assert min(seen["lit"]) > 0.35
    assert min(seen["lit"]) > 2.0 * max(seen["as pins"])
    assert (seen["shading"], seen["the user's"]) == (["MATCAP", True], "STUDIO")


@pytest.mark.parametrize("how", ["USER False", "USER True", "TOP False", "TOP True", "a sample"])
def test_a_bed_that_is_added_is_seen_whole_beside_the_sidebar(seen, how):
    (x0, y0, x1, y1), (left, bottom, right, top) = (seen[how][key] for key in ("bed", "room"))
    assert left <= x0 < x1 <= right
    assert bottom <= y0 < y1 <= top
    # It takes most of that; as much when the sidebar is opened later.
    assert max((x1 - x0) / (right - left), (y1 - y0) / (top - bottom)) > 0.5


def test_the_bed_is_whole_from_above_too_after_the_view_is_turned(seen):
    (left, bottom, right, top), width, height = seen["turned"]
    assert 0.0 <= left < right <= width
    assert 0.0 <= bottom < top <= height


def test_alt_s_shows_skin_or_pins_a_session_the_skin_and_a_bed_far_away_is_a_skin(seen):
    shown = [seen[name]["form"] for name in ("alt s", "alt s again", "pressed on the skin")]
    assert shown == ["skin", "automatic", "skin"]
    assert seen["pressed on the skin"]["lowest"] < seen["selected"]["lowest"] - 1e-3
    shown = [seen[name]["skin"] for name in ("near", "between", "far", "between again", "back")]
    assert shown == [False, False, True, True, False]


def test_no_pin_has_an_outline_unless_pins_are_chosen_and_selected(seen):
    assert max(seen[name]["orange"] for name in ("added by hand", "pins smooth")) < FEW
    assert seen["selected"]["orange"] > 10 * FEW  # what selected pins have: the count can fail
    assert seen["alt s"]["orange"] < seen["selected"]["orange"] / 2  # the skin has one
    selected = [seen[name]["selected"] for name in ("selected", "pins smooth", "stopped")]
    assert selected == [selected[0], [], selected[0]]
    assert len(selected[0]) == 1


def test_the_overlay_covers_no_bed_with_all_details_beside_an_open_sidebar_either(seen):
    left, bottom, right, top = seen["overlay"]
    from_left, from_bottom, to_right, to_top = seen["bed"]
    assert right - left > 100.0
    assert right <= from_left or left >= to_right or top <= from_bottom or bottom >= to_top
    assert seen["covered"] == [0, 0]


def test_the_text_at_the_cursor_can_be_off_while_its_ring_is_drawn(seen):
    shown, off = seen["texts"]
    assert any("Lower" in text for text in shown)
    assert not any(off)
