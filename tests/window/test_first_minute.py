"""The guide's first page, followed by a hand: real events from outside Blender."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from digiclay.settings.beds import BEDS, FIRST

from tests.window.blender_window import played

REST = 40.0
#: Half the length of the stroke, mm.
HALF = 27.0


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("first_minute.py", tmp_path_factory.mktemp("first"), size=(1100, 700), by_hand=True)


def test_add_frames_the_bed(seen: dict[str, Any]) -> None:
    assert seen["added"] == 1
    # The factory file looks from 17 units away at its cube; bed and fingertip are 1.6 units wide.
    assert 1.0 < seen["distance"] < 6.0


def test_add_makes_a_bed_to_design_on(seen: dict[str, Any]) -> None:
    assert np.array(seen["drawn"]["bed"]).shape == (BEDS[FIRST].rows, BEDS[FIRST].columns) == (100, 100)


def test_start_sculpting_takes_the_press_tool_in_hand(seen: dict[str, Any]) -> None:
    assert seen["tab"] == "Digital Clay"
    assert (seen["started"], seen["tool"]) == (1, "digiclay.press_tool")


def test_the_first_form_is_drawn_within_a_minute(seen: dict[str, Any]) -> None:
    bed = BEDS[FIRST]
    along = np.abs(np.arange(bed.columns) - (bed.columns - 1) / 2) * bed.pitch < HALF * 1e-3
    row = REST - np.array(seen["drawn"]["bed"])[bed.rows // 2, along]
    assert (row > 1.0).mean() > 0.9
    assert seen["took"] < 60.0


def test_a_click_on_the_ball_takes_hold_of_the_fingertip_and_g_moves_it(seen: dict[str, Any]) -> None:
    assert seen["taken hold of"]
    assert np.hypot(*seen["moved"][:2]) > 0.02
