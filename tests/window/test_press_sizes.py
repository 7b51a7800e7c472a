"""Clicks past an object, sizes by F, symmetric strokes, lines and rings, by a hand in a real window."""

import numpy as np
import pytest

from tests.window.blender_window import FORMED, down
from tests.window.press_sizes import MIRRORED, RADIUS, WIDER

PLAYED = {"script": "press_sizes.py", "size": (800, 560), "by_hand": True}


@pytest.mark.parametrize(
    "name, size, tolerance",
    [
        # A pixel is 0.3 mm of the bed.
        pytest.param("larger", 16.0 + 2.0 * WIDER, 1.2, id="the rim follows the mouse"),
        pytest.param("undone", 16.0, 1e-4, id="Ctrl-Z leaves the size before"),
        pytest.param("escaped", 16.0, 1e-4, id="so does Esc"),
        pytest.param("typed", 24.0, 1e-4, id="a value is typed in mm"),
        pytest.param("typed cm", 10.0, 1e-4, id="or with a unit"),
        pytest.param("brackets", 11.0, 1e-3, id="brackets make the fingertip larger and smaller"),
    ],
)
def test_the_session_goes_on_with_the_size_that_is_set(seen, name, size, tolerance):
    found = [seen[name][key] for key in ("size", "drawn size", "simulated")]
    assert found == pytest.approx([size] * 3, abs=tolerance)
    assert np.ptp(found) < 1e-3
    assert seen[name]["blister"] == pytest.approx(15.0 / 16.0 * seen[name]["size"], rel=1e-5)
    assert seen[name]["sessions"] == 1
    assert seen["deeper"]["period"] > seen[name]["period"]


def test_depth_and_strength_have_keys_of_their_own(seen):
    assert seen["begun"]["depth"] == pytest.approx(4.0)
    assert seen["deeper"]["depth"] == pytest.approx(6.0, abs=0.2)
    assert (seen["strength"]["depth"], seen["strength"]["strength"]) == pytest.approx(
        (4.0, 0.5), abs=1e-6
    )


#: Brush, size, mm, and strength after brushes were chosen by the pie.
CHOSEN = {
    "raise chosen": ("RAISE", 16.0, 1.0),
    "raise": ("RAISE", 24.0, 0.3),
    "lower again": ("LOWER", 16.0, 1.0),
    "raise again": ("RAISE", 24.0, 0.3),
    "raise undone": ("RAISE", 16.0, 0.3),
}


@pytest.mark.parametrize("name", CHOSEN)
def test_e_opens_a_pie_of_brushes_and_each_has_its_size_and_strength_while_the_session_goes_on(
    seen, name
):
    kind, size, strength = CHOSEN[name]
    found = [seen[name][key] for key in ("size", "drawn size", "simulated")]
    assert (seen[name]["brush"], seen[name]["strength"]) == (kind, pytest.approx(strength))
    assert found == pytest.approx([size] * 3, abs=1e-3)
    assert seen[name]["sessions"] == 1


def test_each_preset_has_a_picture_of_its_own(seen):
    icons = seen["icons"]
    assert len(set(icons)) == len(icons) == 6
    assert min(icons) > 0


def test_a_symmetric_stroke_forms_its_images_and_is_one_undo_step(seen):
    (start, y), (end, _) = MIRRORED
    columns = np.arange(round(start / 3) + 12, round(end / 3) + 13)
    for row in (12 + round(y / 3), 12 - round(y / 3)):
        for side in (columns, 24 - columns):
            assert (down(seen, "symmetric")[row, side] > FORMED).mean() >= 0.95
    assert np.abs(down(seen, "symmetric undone")).max() < 1e-3


def test_a_line_that_of_a_shift_click_a_stabilized_stroke_and_a_ring_cover_their_pins_alone(seen):
    assert (down(seen, "stabilized")[12, 3:22] > FORMED).mean() >= 0.95
    formed = down(seen, "lines") > FORMED
    assert formed[4, 3:22].mean() >= 0.95
    assert formed[4:22, 21].mean() >= 0.95
    # The blister reaches 15 mm to the side.
    assert not formed[10:22, 3:15].any()
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    rows, columns = (
        np.rint(12.0 + RADIUS / 3.0 * part).astype(int) for part in (np.sin(angle), np.cos(angle))
    )
    formed = down(seen, "ring") > FORMED
    assert formed[rows, columns].mean() >= 0.95
    assert not formed[11:14, 11:14].any()


@pytest.mark.parametrize("name", ["perspective", "orthographic", "camera"])
def test_a_click_on_an_object_selects_it_and_one_beside_it_presses(seen, name):
    before = seen[name]["covered"]
    assert seen[name]["covered selected"] == ["Cube"]
    assert seen[name]["bare"] == before + 1


def test_pins_that_are_seen_are_pressed_through_xray_behind_an_object_and_in_each_quarter(seen):
    assert seen["xray"]["covered selected"] == []
    assert seen["xray"]["bare"] == seen["camera"]["bare"] + 2
    # 24 mm to either side of the middle, 3 mm a pin; the fingertip presses 4 mm deep.
    assert np.max(seen["drawn under"][4:21]) < 40.0 - 1.0
    found = seen["quarters"]
    assert (found["count"], found["top covered"], found["top bare"]) == (4, [False], [True])
    assert seen["reported"].count("Cube hides the bed here") == 3  # in three views


def test_a_bed_that_is_added_in_a_cube_goes_on_top_of_it_or_beside_it_where_that_is_seen(seen):
    # Its origin is the floor of the bed, a little above its underside; the cube is 2 units large.
    where = {axis: tuple(one > 1.0 for one in seen[axis]) for axis in ("TOP", "FRONT", "BOTTOM")}
    assert where == {"TOP": (False, True), "FRONT": (False, True), "BOTTOM": (True, False)}
