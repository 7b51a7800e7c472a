"""A text and an imported SVG are formed as their lines are, judged by those that Blender makes of them."""

import numpy as np

from tests.assemble import assert_near
from tests.drawings import PITCH, judge
from tests.window.blender_window import up

PLAYED = {"script": "form_curves.py", "size": (1100, 720), "by_hand": True}


def grid(relief):
    rows, columns = relief.shape
    x, y = (
        PITCH * (np.arange(columns) - (columns - 1) / 2),
        PITCH * (np.arange(rows) - (rows - 1) / 2),
    )
    return np.tile(x, rows), np.repeat(y, columns)


def test_a_text_and_an_svg_are_raised_along_their_lines(seen):
    relief = up(seen, "formed")
    # Ring and roof; R and its eye.
    assert seen["queued"] == len(seen["lines"]) == 4
    assert judge([np.array(line) for line in seen["lines"]], 8.0, relief, *grid(relief)) == ""


def test_all_strokes_are_one_undo_step(seen):
    assert_near(up(seen, "undone"), 0.0, 1e-3)


def test_the_text_is_stamped_with_its_eye(seen):
    relief = up(seen, "stamped")
    assert (np.abs(relief - 8.0) < 0.1).sum() > 30
    assert (np.abs(relief) < 0.1).mean() > 0.8
    assert relief.max() < 8.1
