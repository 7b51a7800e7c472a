"""The guide's first page, followed by a hand: real events from outside Blender."""

import re
from pathlib import Path

import numpy as np
from digiclay.settings.devices import BEDS, FIRST

PLAYED = {"script": "first_minute.py", "size": (1100, 720), "by_hand": True}
REST = 40.0
GUIDE = Path(__file__).parents[2] / "docs" / "guide.md"


def test_the_script_takes_the_steps_of_the_page_and_each_does_what_it_says(seen):
    page = GUIDE.read_text(encoding="utf-8").partition("## First ridge")[2].partition("##")[0]
    steps = re.findall(r"^\d\. (.*?\.)(?=\s)", page, re.MULTILINE | re.DOTALL)
    assert [" ".join(step.split()) for step in steps] == seen["steps"]
    assert (seen["added"], seen["tab"]) == (1, "Digital Clay")
    # The factory file looks from 17 units away at its cube; bed and fingertip are 1.6 units wide.
    assert 1.0 < seen["distance"] < 6.0
    # No pin has an outline, and all the factory file has is kept.
    assert (seen["selected"], {"Cube", "Camera", "Light"} <= set(seen["things"])) == ([], True)
    assert np.array(seen["drawn"]["bed"]).shape == (BEDS[FIRST].rows, BEDS[FIRST].columns) == (100, 100)
    assert (seen["started"], seen["tool"], seen["left"]) == (1, "digiclay.press_tool", 0)


def test_a_ridge_stands_within_a_minute(seen):
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


def test_a_click_on_the_ball_takes_hold_of_the_fingertip_and_g_moves_it(seen):
    assert seen["taken hold of"]
    assert np.hypot(*seen["moved"][:2]) > 0.02
