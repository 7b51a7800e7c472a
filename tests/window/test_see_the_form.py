"""A designer sees the form: a skin that can be pressed, no outline of pins, and nothing before the bed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.window.blender_window import BLENDER, played

pytestmark = pytest.mark.skipif(not BLENDER, reason="needs Blender's path in DIGICLAY_BLENDER_WINDOW")

#: Orange pixels that have another cause than an outline: the dot at the origin of an object, icons.
FEW = 150


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once."""
    folder: Path = tmp_path_factory.mktemp("see_the_form")
    return played("see_the_form.py", folder, by_hand=True)


def test_alt_s_shows_the_skin_and_the_pins_again(seen: dict[str, Any]) -> None:
    shown = [seen[name]["form"] for name in ("alt s", "alt s again", "alt s once more")]
    assert shown == ["skin", "automatic", "skin"]


def test_a_bed_shown_as_its_skin_can_be_pressed(seen: dict[str, Any]) -> None:
    assert seen["pressed on the skin"]["form"] == "skin"
    assert seen["pressed on the skin"]["lowest"] < seen["selected"]["lowest"] - 1e-3


def test_pins_have_no_outline_in_a_new_bed_and_during_a_session(seen: dict[str, Any]) -> None:
    assert seen["added"]["orange"] < FEW
    assert seen["selected"]["orange"] > 10 * FEW  # what a selected bed has: the count can fail
    assert seen["pins smooth"]["orange"] < FEW
    assert seen["pins smooth"]["selected"] == []


def test_after_the_session_the_bed_is_selected_again(seen: dict[str, Any]) -> None:
    assert seen["stopped"]["selected"] == ["Digital Clay"]


def test_the_overlay_does_not_cover_the_bed(seen: dict[str, Any]) -> None:
    left, bottom, right, top = seen["overlay"]
    from_left, from_bottom, to_right, to_top = seen["bed"]
    assert right - left > 100.0
    assert right <= from_left or left >= to_right or top <= from_bottom or bottom >= to_top


def test_a_bed_far_away_is_a_skin_and_between_the_limits_what_it_was(seen: dict[str, Any]) -> None:
    shown = [seen[name]["skin"] for name in ("near", "between", "far", "between again", "back")]
    assert shown == [False, False, True, True, False]
