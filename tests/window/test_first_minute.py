"""The guide's first page, followed by a hand: real events from outside Blender."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.settings.devices import BEDS, FIRST

from tests.window.blender_window import played

REST = 40.0
GUIDE = Path(__file__).parents[2] / "docs" / "guide.md"


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("first_minute.py", tmp_path_factory.mktemp("first"), size=(1100, 720), by_hand=True)


def test_the_script_takes_the_steps_of_the_page(seen: dict[str, Any]) -> None:
    page = GUIDE.read_text(encoding="utf-8").partition("## First ridge")[2].partition("##")[0]
    steps = re.findall(r"^\d\. (.*?\.)(?=\s)", page, re.MULTILINE | re.DOTALL)
    assert [" ".join(step.split()) for step in steps] == seen["steps"]


def test_add_frames_the_bed(seen: dict[str, Any]) -> None:
    assert seen["added"] == 1
    # The factory file looks from 17 units away at its cube; bed and fingertip are 1.6 units wide.
    assert 1.0 < seen["distance"] < 6.0


def test_all_the_factory_file_has_is_kept_and_no_pin_has_an_outline(seen: dict[str, Any]) -> None:
    assert {"Cube", "Camera", "Light"} <= set(seen["things"])
    assert seen["selected"] == []


def test_add_makes_a_bed_to_design_on(seen: dict[str, Any]) -> None:
    assert np.array(seen["drawn"]["bed"]).shape == (BEDS[FIRST].rows, BEDS[FIRST].columns) == (100, 100)


def test_start_sculpting_takes_the_press_tool_in_hand(seen: dict[str, Any]) -> None:
    assert seen["tab"] == "Digital Clay"
    assert (seen["started"], seen["tool"]) == (1, "digiclay.press_tool")


def test_a_ridge_stands_within_a_minute(seen: dict[str, Any]) -> None:
    bed = BEDS[FIRST]
    height = np.array(seen["drawn"]["bed"]) - REST
    x, y = (1e3 * bed.pitch * (np.arange(count) - (count - 1) / 2) for count in (bed.columns, bed.rows))
    # The ends of the line, drawn from -24 to 24 mm, are round.
    assert (height[np.abs(y).argmin(), np.abs(x) < 20.0] > 12.0).mean() > 0.9
    section = height[:, np.abs(x) < 10.0].mean(axis=1)
    assert abs(y[section.argmax()]) <= 3.0
    assert 13.0 < section.max() < 18.0
    # No blister is wider than the paper's, of 15 mm.
    assert np.abs(section[np.abs(y) > 20.0]).max() < 1.0
    # What other programs took of the processor is not the guide's.
    assert seen["took"] - seen["waited"] < 60.0


def test_esc_ends_the_session(seen: dict[str, Any]) -> None:
    assert seen["left"] == 0


def test_a_click_on_the_ball_takes_hold_of_the_fingertip_and_g_moves_it(seen: dict[str, Any]) -> None:
    assert seen["taken hold of"]
    assert np.hypot(*seen["moved"][:2]) > 0.02
