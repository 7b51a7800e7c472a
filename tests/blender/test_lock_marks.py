"""Hatch over locked pins: whole over whole locks, shorter over those in part; it lies on skin and pins."""

import numpy as np
import pytest
from digiclay.press.lock_marks import ABOVE, HALF, find_hatch

from tests.assemble import assert_near
from tests.strokes import begin_bed

SHARES = np.zeros(35)
SHARES[[8, 16, 17]] = 1.0, 1.0, 0.5


@pytest.mark.parametrize("skin", [True, False])
def test_a_line_is_as_long_as_its_pin_is_locked_and_lies_on_what_is_drawn(skin):
    session = begin_bed("paper", 5, 7)
    grid, height = session.system.grid, session.state.row(0) + 1e-3 * np.arange(35)
    session.state.rows[0] = height
    session.state.active.block[0] = height[session.state.active.cells]
    ends = find_hatch(session, SHARES, skin).reshape(3, 2, 3)
    pitch = grid.layout.pitch
    middle, length = ends.mean(axis=1), np.linalg.norm(np.diff(ends[..., :2], axis=1)[:, 0], axis=1)
    pins = np.flatnonzero(SHARES)
    tops = np.column_stack([grid.positions, height])[pins] + (0.0, 0.0, ABOVE * pitch)
    assert_near(middle, tops, 1e-12)
    whole = np.sqrt(2.0) * pitch if skin else 2.0 * 0.7 * np.sqrt(2.0) * HALF * pitch
    assert_near(length, whole * SHARES[pins], 1e-12)
    if skin:
        # From one locked pin to the next along the diagonal it is one line, up and down with the skin.
        assert_near(ends[0, 0], ends[1, 1], 1e-12)
    else:
        assert_near(np.ptp(ends[..., 2], axis=1), 0.0, 1e-12)
