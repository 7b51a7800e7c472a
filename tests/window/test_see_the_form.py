"""A designer sees the form: a skin that can be pressed, no outline of pins, and nothing before the bed."""

from __future__ import annotations

from tests.window.blender_window import Seen

PLAYED = {"script": "see_the_form.py", "by_hand": True}
#: Orange pixels that have another cause than an outline: the dot at the origin of an object, icons.
FEW = 150


def test_alt_s_shows_the_skin_which_can_be_pressed_and_the_pins_again(seen: Seen) -> None:
    shown = [
        seen[name]["form"] for name in ("alt s", "alt s again", "alt s once more", "pressed on the skin")
    ]
    assert shown == ["skin", "automatic", "skin", "skin"]
    assert seen["pressed on the skin"]["lowest"] < seen["selected"]["lowest"] - 1e-3


def test_a_bed_has_no_outline_while_it_is_new_and_in_a_session_and_is_selected_after_it(seen: Seen) -> None:
    assert max(seen[name]["orange"] for name in ("added", "pins smooth")) < FEW
    assert seen["selected"]["orange"] > 10 * FEW  # what a selected bed has: the count can fail
    assert (seen["pins smooth"]["selected"], seen["stopped"]["selected"]) == ([], ["Digital Clay"])


def test_the_overlay_does_not_cover_the_bed(seen: Seen) -> None:
    left, bottom, right, top = seen["overlay"]
    from_left, from_bottom, to_right, to_top = seen["bed"]
    assert right - left > 100.0
    assert right <= from_left or left >= to_right or top <= from_bottom or bottom >= to_top


def test_a_bed_far_away_is_a_skin_and_between_the_limits_what_it_was(seen: Seen) -> None:
    shown = [seen[name]["skin"] for name in ("near", "between", "far", "between again", "back")]
    assert shown == [False, False, True, True, False]
