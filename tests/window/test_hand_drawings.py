"""Drawings of several strokes by pointer events have their height on each path, and flanks of one stroke."""

import numpy as np
import pytest

from tests.drawings import PITCH, judge, put, read_drawings
from tests.window.blender_window import up
from tests.window.hand_drawings import DRAWN

PLAYED = {"script": "hand_drawings.py", "size": (800, 560), "by_hand": True}
#: Pins of a row or a column, mm.
AXIS = PITCH * (np.arange(100) - 49.5)


@pytest.mark.parametrize("name", DRAWN)
def test_a_drawing_by_pointer_events_has_its_height_on_each_path(seen, name):
    _, amount, pose = DRAWN[name]
    x, y = (axis.ravel() for axis in np.meshgrid(AXIS, AXIS))
    assert judge(put(read_drawings()[name], *pose), amount, up(seen, name), x, y) == ""
