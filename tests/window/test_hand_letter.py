"""The letter A of the gallery, drawn by a hand in a window, is what was intended: X events from outside."""

from __future__ import annotations

import numpy as np
from digiclay.core.model.layout import Layout, make_grid
from digiclay.settings.devices import BEDS

from benchmarks.made import find_relief
from tests.window.blender_window import Seen

PLAYED = {"script": "hand_letter.py", "size": (800, 560), "by_hand": True}
REST = 40.0


def test_a_letter_drawn_by_a_hand_is_what_was_intended(seen: Seen) -> None:
    bed = BEDS["design"]
    grid = make_grid(Layout(rows=bed.rows, columns=bed.columns, pitch=bed.pitch))
    intended = find_relief("letter_a", *grid.positions.T)
    formed = 1e-3 * (np.array(seen["formed"]["bed"]).ravel() - REST)
    assert seen["formed"]["drawn"] == 3
    assert np.corrcoef(formed, intended)[0, 1] >= 0.9
    slope = np.cov(formed, intended)[0, 1] / intended.var(ddof=1)
    assert 0.75 <= slope <= 1.25
