"""Curve, text and imported SVG are formed as their lines are, judged by those that Blender makes of them."""

import numpy as np

from tests.assemble import assert_near
from tests.drawings import PITCH, judge
from tests.window.blender_window import up

PLAYED = {"script": "form_curves.py", "size": (1100, 760), "by_hand": True}


def grid(relief):
    rows, columns = relief.shape
    x, y = (
        PITCH * (np.arange(columns) - (columns - 1) / 2),
        PITCH * (np.arange(rows) - (rows - 1) / 2),
    )
    return np.tile(x, rows), np.repeat(y, columns)


def test_a_curve_a_text_and_an_svg_are_raised_along_their_lines(seen):
    relief = up(seen, "formed")
    # Ring, disc and roof; R and its eye; a curve.
    assert seen["selected"] == 5
    assert seen["queued"] == len(seen["lines"]) == 6
    assert judge([np.array(line) for line in seen["lines"]], 8.0, relief, *grid(relief)) == ""


def test_all_strokes_are_one_undo_step(seen):
    assert_near(up(seen, "undone"), 0.0, 1e-3)


def test_a_text_with_its_eye_and_what_an_svg_fills_are_stamped(seen):
    relief = up(seen, "stamped")
    # The disc of 9.6 mm, 31 of 80 parts of 128 mm to the left of the middle and above it.
    disc = np.hypot(*np.add(grid(relief), [[49.6], [-49.6]])).reshape(relief.shape)
    assert (np.abs(relief[disc < 7.0] - 8.0) < 0.1).all()
    assert (np.abs(relief[(disc > 12.0) & (disc < 20.0)]) < 0.1).all()
    assert (np.abs(relief - 8.0) < 0.1).sum() > 30
    assert (np.abs(relief) < 0.1).mean() > 0.8
    assert relief.max() < 8.1
