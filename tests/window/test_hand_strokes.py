"""What a hand draws with the Press tool is formed whole: X events from outside, without a pause."""

import numpy as np
import pytest
from digiclay.core.model.layout import Layout, make_grid
from digiclay.recorded.pointer_strokes import read_strokes
from digiclay.settings.devices import BEDS

from tests.window.blender_window import FORMED, down
from tests.window.hand_strokes import DRAWN, HALF, STROKES, TAPS, THINGS
from tests.window.intended import find_relief

PLAYED = {"script": "hand_strokes.py", "size": (800, 560), "by_hand": True}
#: The columns of the bed that lie on the strokes, 3 mm a pin, and their row.
COLUMNS = np.abs(np.arange(-36, 37, 3)) <= HALF
ROW = 12


@pytest.mark.parametrize("when", [*(f"{duration:g}" for duration, _ in STROKES), "under a message"])
def test_a_stroke_is_formed_in_all_its_columns_and_nowhere_else(seen, when):
    # The timer of a message gives every operator events that name the release of the stroke before.
    assert seen["message"].endswith("goes on")
    assert (down(seen, f"stroke {when}")[ROW, COLUMNS] > FORMED).mean() >= 0.95
    np.testing.assert_allclose(down(seen, "stroke 3")[:4], 0.0, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    "name, formed",
    [
        ("before the taps", [False, False, False]),
        pytest.param("taps", [True, True, True], id="three presses within a second all form"),
        pytest.param("one tap undone", [True, True, False], id="one undo takes back one"),
    ],
)
def test_each_tap_is_a_press_of_its_own(seen, name, formed):
    cells = [(round((y + 36) / 3), round((x + 36) / 3)) for x, y in TAPS]
    assert [bool(down(seen, name)[cell] > FORMED) for cell in cells] == formed


def test_the_view_turns_and_zooms_in_mid_stroke_and_the_stroke_goes_on(seen):
    before, middle, after = (
        seen[name] for name in ("before orbit", "in mid-stroke", "after orbit")
    )
    assert np.abs(np.subtract(before["view"], middle["view"])).max() > 0.02
    assert middle["distance"] < before["distance"]
    assert (middle["drawn"], after["drawn"]) == (before["drawn"], before["drawn"] + 1)
    assert down(seen, "after orbit")[ROW, [3, 21]].min() > FORMED


def test_a_stroke_pans_in_its_middle_and_ends_where_a_pie_menu_has_taken_the_release(seen):
    assert np.abs(seen["pie menu"]["panned"]).max() > 0.01
    row = down(seen, "pie menu")[ROW]
    # Formed up to the middle, and not to where the mouse went after the release.
    assert row[4:12].min() > FORMED
    assert np.abs(row[20:]).max() < 0.5


@pytest.mark.parametrize("name", ["undone", "escaped"])
def test_an_unfinished_stroke_is_taken_back_and_the_session_goes_on(seen, name):
    assert np.abs(down(seen, name)).max() < 1e-3
    assert seen[name]["sessions"] == 1


@pytest.mark.parametrize("name", THINGS)
def test_a_thing_drawn_by_a_hand_is_what_was_intended(seen, name):
    plan = BEDS["design"]
    grid = make_grid(Layout(rows=plan.rows, columns=plan.columns, pitch=plan.pitch))
    intended = find_relief(name, *grid.positions.T)
    formed = -1e-3 * down(seen, name).ravel()
    strokes = read_strokes(DRAWN / f"{name}.toml").strokes
    # Before a stroke of an older file Y sets the base.
    count = len(strokes) + sum(stroke.combine == "usual" for stroke in strokes[1:])
    assert seen[name]["drawn"] - seen[f"before {name}"]["drawn"] == count
    assert np.corrcoef(formed, intended)[0, 1] >= 0.96
    slope = np.cov(formed, intended)[0, 1] / intended.var(ddof=1)
    assert 0.9 <= slope <= 1.1
