"""The tutorial of a first relief, followed by a hand: real events from outside Blender."""

import re
from pathlib import Path

import numpy as np
import trimesh
from digiclay.settings.devices import BEDS, FIRST

from tests.assemble import assert_near
from tests.window.blender_window import down, up
from tests.window.intended import find_distance

PLAYED = {"script": "first_minute.py", "size": (1100, 720), "by_hand": True}
TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "relief.md"


def test_the_script_takes_the_steps_of_the_page_and_each_does_what_it_says(seen):
    steps = re.findall(r"^\d\. \*\*(.*?)\*\*", TUTORIAL.read_text(encoding="utf-8"), re.MULTILINE)
    assert steps == seen["steps"]
    assert (seen["added"], seen["tab"]) == (1, "Digital Clay")
    # The factory file looks from 17 units away at its cube; bed and fingertip are 1.6 units wide.
    assert 1.0 < seen["distance"] < 6.0
    # No pin has an outline, and all the factory file has but its cube is kept.
    assert (seen["selected"], {"Camera", "Light"} <= set(seen["things"])) == ([], True)
    assert (
        np.array(seen["ridge"]["bed"]).shape
        == (BEDS[FIRST].rows, BEDS[FIRST].columns)
        == (100, 100)
    )
    assert (seen["started"], seen["tool"], seen["left"]) == (1, "digiclay.press_tool", 0)


def test_a_ridge_and_a_valley_stand_within_a_minute_along_the_hearts_that_were_drawn(seen):
    plan = BEDS[FIRST]
    x, y = np.meshgrid(
        *(1e3 * plan.pitch * (np.arange(n) - (n - 1) / 2) for n in (plan.columns, plan.rows))
    )
    outer, inner = (find_distance(seen[f"{name} drawn"], x, y) for name in ("ridge", "valley"))
    # A pixel of the picture is 0.3 mm; the top of a blister is flat in its middle.
    assert_near(up(seen, "ridge")[outer < 1.0], 6.0, 1.0)
    assert_near(down(seen, "valley")[inner < 1.0], 8.0, 1.0)
    # No blister is wider than the paper's, of 15 mm.
    assert_near(up(seen, "ridge")[outer > 20.0], 0.0, 0.1)
    # What other programs took of the processor is not the tutorial's; for a film the hand waits.
    assert seen["pictured"] or sum(took - waited for took, waited in seen["took"][1:6]) < 60.0


def test_the_exported_relief_is_watertight_and_at_true_size(seen):
    body = trimesh.load_mesh(next(seen["folder"].glob("*.stl")))
    assert body.is_watertight
    # 99 pitches of 1.5 mm; from 3 mm below the valley to the top of the ridge.
    np.testing.assert_allclose(body.extents, [148.5, 148.5, 17.0], rtol=0, atol=0.1)


def test_a_click_on_the_ball_takes_hold_of_the_fingertip_and_g_moves_it(seen):
    assert seen["taken hold of"]
    assert np.hypot(*seen["moved"][:2]) > 0.02
