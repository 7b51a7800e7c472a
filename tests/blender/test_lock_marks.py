"""Hatch over locked pins: whole over whole locks, shorter over those in part; on skin and pins of any bed."""

import bpy
import numpy as np
import pytest
from digiclay.core.base.errors import StateError
from digiclay.core.session.snapshot import read_shares
from digiclay.live import beds as stored
from digiclay.live import tick
from digiclay.press.lock_marks import ABOVE, HALF, find_hatch, find_shares, identify
from digiclay.sessions import running
from digiclay.sessions.sculpting import queue_stroke
from digiclay.strokes.stroke import Brush, let_go, start

from tests.assemble import assert_near
from tests.blender.at_hand import added, beds, new_bed, save_and_open
from tests.blender.session.live import Clock
from tests.strokes import begin_bed

SHARES = np.zeros(35)
SHARES[[8, 16, 17]] = 1.0, 1.0, 0.5


@pytest.mark.parametrize("skin", [True, False])
def test_a_line_is_as_long_as_its_pin_is_locked_and_lies_on_what_is_drawn(skin):
    session = begin_bed("paper", 5, 7)
    grid, height = session.system.grid, session.state.row(0) + 1e-3 * np.arange(35)
    session.state.rows[0] = height
    session.state.active.block[0] = height[session.state.active.cells]
    ends = find_hatch(grid, height, SHARES, skin).reshape(3, 2, 3)
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


def lock(*rows):
    """Have beds' sessions lock pins, (brush, pins), and go on until they are locked."""
    for bed, *changes in rows:
        session = running.find(bed)
        for kind, pins in changes:
            stroke = let_go(start(0, 0.0, 0.0, 1e-3, brush=kind, pins=pins))
            session, _ = queue_stroke(session, stroke)
        stored.put(session)
    Clock().until(lambda: not any(one.strokes for one in running.list_sessions()))


def test_locks_of_several_beds_are_seen_in_sessions_after_them_and_in_a_file_opened_again(
    extension, tmp_path
):
    new_bed(rows=5, columns=5)
    added(3.0)
    first, second = beds()
    for bed in (first, second):
        assert tick.start(bpy.context, bed) == []
    lock(
        (first, (Brush.LOCK_PINS, (3, 7))),
        (second, (Brush.LOCK_PINS, (12,)), (Brush.BLUR_LOCKS, None)),
    )
    wanted = [find_shares(bed) for bed in (first, second)]
    assert np.flatnonzero(wanted[0] == 1.0).tolist() == [3, 7]
    assert ((wanted[1] > 0.0) & (wanted[1] < 1.0)).sum() == 5
    for opened in (False, True):
        for session in running.list_sessions():
            tick.stop(session.uid)
        if opened:
            save_and_open(tmp_path / "locked.blend")
        for bed, shares in zip(beds(), wanted, strict=True):
            np.testing.assert_array_equal(find_shares(bed), shares)
    # Hatches of two beds are told apart, and those of a bed before and after its locks are changed.
    first, second = beds()
    before = identify(first)
    assert before == identify(first) != identify(second)
    tick.start(bpy.context, first)
    lock((first, (Brush.INVERT_LOCKS, None)))
    tick.stop(first.session_uid)
    assert identify(first) != before
    np.testing.assert_array_equal(find_shares(first), 1.0 - wanted[0])
    # A take that is played shows other modes than those stored: whole locks are seen as it has them.
    modes = np.zeros(25, np.int32)
    modes[4] = 8
    first.data.attributes["mode"].data.foreach_set("value", modes)
    assert np.flatnonzero(find_shares(first)).tolist() == [4]
    first[stored.STATE] = b"no state"
    with pytest.raises(StateError):
        read_shares(stored.read_snapshot(first))
