"""A bed stores the strokes still to be formed, whole: files, undo, redo and Backspace bring them back."""

import json
from functools import partial

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.session import live_session
from digiclay.live import beds, handlers, tick
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.sessions.sculpting import change_stroke, queue_stroke
from digiclay.settings import devices
from digiclay.strokes.stamps import load_stamp
from digiclay.strokes.stroke import Brush, Combine, lay_path, make_images, start

from tests.assemble import assert_near
from tests.blender.at_hand import new_bed, push_step
from tests.blender.session.live import (
    FLOAT32,
    exact,
    only_bed,
    only_session,
    shown,
    started,
    undone,
)

#: Rows of the strokes, mm, and where they begin and end.
ROWS, ENDS = (-12.0, 0.0, 12.0), (-9.0, 9.0)


def draw(y, **how):
    """Draw a stroke along a row, as the Press tool does, with its undo step."""
    session = only_session()
    path = [(1e-3 * x, 1e-3 * y) for x in ENDS]
    session, number = queue_stroke(session, start(0, *path[0], 3e-3, **how))
    beds.put(change_stroke(session, number, partial(lay_path, points=path)))
    push_step("Press")


def begin(bed, method="plastic"):
    bed.digiclay.method = method
    started(bed)
    push_step("Start Session")


def form(clock):
    clock.until(lambda: not only_session().strokes)
    clock.tick()


def rows():
    """Tell which strokes are formed, each wholly or not at all."""
    down = 40e-3 - exact().reshape(13, 13)[[round(6 + y / 3) for y in ROWS]][:, 4:9]
    assert all(row.min() > 1e-3 or row.max() < 0.7e-3 for row in down), down
    return [bool(row.min() > 1e-3) for row in down]


def redone(clock):
    bpy.ops.ed.redo()
    clock.tick(handlers.STALE)


def half_formed():
    return shown().min() < 39e-3


WHEN = {
    "queued": lambda: True,
    "begun": lambda: only_session().strokes[0].height is not None,
    "half-formed": half_formed,
}


@pytest.fixture
def slow(monkeypatch):
    """Wait for something on a machine that simulates a period in a tick; then it takes whole strokes."""

    def wait(clock, holds):
        monkeypatch.setattr(live_session, "find_spare", lambda *given: 0.0)
        clock.until(holds)
        monkeypatch.setattr(live_session, "find_spare", lambda *given: 1e9)

    return wait


@pytest.mark.parametrize(
    "when, how",
    [
        ("queued", "a session"), ("begun", "at once"),
        ("half-formed", "a session"), ("half-formed", "at once"),
    ],
)  # fmt: skip
def test_a_file_has_every_stroke_that_was_drawn(bed, clock, tmp_path, slow, when, how):
    begin(bed)
    stamp = {"brush": Brush.STAMP, "stamp": load_stamp("heart")}
    for y, kind in zip(
        ROWS, ({}, {"images": make_images("X"), "accumulate": True}, stamp), strict=True
    ):
        draw(y, **kind)
    slow(clock, WHEN[when])
    path = str(tmp_path / "queue.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    form(clock)
    formed = exact(bed)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert (exact() == 40e-3).all()  # nothing of it half
    assert len(beds.read_queue(only_bed())[-1]) == 3
    if how == "at once":
        handlers.form_left()
        assert running.list_sessions() == ()
    else:
        begin(only_bed())
        form(clock)
    np.testing.assert_array_equal(exact(), formed)
    assert_near(shown(), formed, FLOAT32)
    assert beds.read_queue(only_bed())[-1] == []


@pytest.mark.parametrize("when", [*WHEN, "all formed"])
def test_undo_takes_back_one_stroke_and_redo_brings_it_back(bed, clock, slow, when):
    begin(bed)
    for y in ROWS:
        draw(y)
    form(clock) if when == "all formed" else slow(clock, WHEN[when])
    for count in (2, 1, 0):
        before = only_session().state.period
        undone(clock)
        if count == 2 and when == "half-formed":  # the first one goes on
            assert only_session().state.period >= before
        if when == "all formed":  # and none is formed once more
            assert only_session().strokes == ()
        form(clock)
        assert rows() == [True] * count + [False] * (3 - count)
    for count in (1, 2, 3):
        redone(clock)
        assert only_session().strokes == () or when != "all formed"
        form(clock)
        assert rows() == [True] * count + [False] * (3 - count)
    gestures = [True] * 3
    while any(gestures):  # Backspace takes back one at a time, in the order they were drawn
        assert len(only_session().gestures) == sum(gestures)
        bpy.ops.digiclay.session_rewind("EXEC_DEFAULT", True)
        gestures[sum(gestures) - 1] = False
        clock.tick()
        assert rows() == gestures


def test_undo_of_backspace_and_of_a_reset_brings_the_gestures_back(bed, clock):
    begin(bed)
    for y in ROWS[:2]:
        draw(y)
        form(clock)
    for step in ("rewind", "reset"):
        getattr(bpy.ops.digiclay, f"session_{step}")("EXEC_DEFAULT", True)
        undone(clock)
        assert (rows(), len(only_session().gestures)) == ([True, True, False], 2)


def test_without_a_session_undo_and_redo_leave_no_stroke_unformed(bed, clock, slow):
    begin(bed)
    draw(ROWS[0])
    slow(clock, half_formed)
    other = bpy.data.objects["Cube"]
    other.location.x += 1.0
    push_step("Move")
    form(clock)
    handlers.end_all(handlers.STOPPED)
    formed = exact()
    for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.redo):
        step()
        handlers.form_left()
        # Pins settle by hundredths of a millimeter when the fingertip has left.
        assert_near(exact(), formed, 1e-4)
        assert_near(shown(), exact(), FLOAT32)
    for _ in range(3):
        bpy.ops.ed.undo()
    handlers.form_left()
    assert_near(shown(), 40e-3, FLOAT32)


@pytest.mark.parametrize("stopped", [False, True])
def test_a_session_that_is_stopped_keeps_strokes_for_the_next_one(bed, clock, slow, stopped):
    begin(bed)
    draw(ROWS[0])
    draw(ROWS[2])
    slow(clock, half_formed)
    if stopped:
        bpy.ops.digiclay.session_stop("EXEC_DEFAULT", True)
        assert_near(shown(bed), exact(bed), FLOAT32)
        begin(bed)
    form(clock)
    assert rows() == [True, False, True]


def press(y, base=False):
    """Draw a stroke from the base along a row, or set the base, as the tool does; see `draw`."""
    how = {"brush": Brush.SET_BASE} if base else {"combine": Combine.LOWEST}
    draw(y, **how)


def test_strokes_from_the_base_leave_one_depth_until_set_base_which_undo_takes_back(bed, clock):
    begin(bed)
    for base in (False, False, True, False):
        press(0.0, base)
    form(clock)
    row = slice(13 * 6 + 4, 13 * 6 + 9)
    # Pins that give way to a force stand 1.1 mm less deep than the fingertip came, and a little
    # deeper after each pass.
    once, twice = 40e-3 - 1.9e-3, 40e-3 - 3.8e-3
    assert_near(exact()[row], twice, 0.5e-3)
    assert_near(only_session().base[row], once, 0.5e-3)
    undone(clock, 2)
    form(clock)
    assert (only_session().base == 40e-3).all()
    assert_near(exact()[row], once, 0.5e-3)
    redone(clock)
    form(clock)
    assert_near(only_session().base[row], once, 0.5e-3)
    bpy.ops.digiclay.session_rewind("EXEC_DEFAULT", True)
    assert (only_session().base == 40e-3).all()
    bpy.ops.digiclay.session_reset("EXEC_DEFAULT", True)
    assert (only_session().base == 40e-3).all()


@pytest.mark.parametrize("when", ["formed", "queued"])
def test_a_file_and_the_next_session_have_the_base(bed, clock, tmp_path, when):
    begin(bed)
    press(0.0)
    press(0.0, base=True)
    form(clock)
    base = only_session().base
    press(0.0)
    if when == "formed":
        form(clock)
    path = str(tmp_path / "base.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    begin(only_bed())
    form(clock)
    np.testing.assert_array_equal(only_session().base, base)
    before = exact()
    press(0.0)
    form(clock)
    # What was pressed to its depth settles a little under the fingertip, no more.
    assert_near(exact(), before, 0.3e-3)


@pytest.mark.parametrize(
    "junk, count",
    [(np.zeros(7).tobytes(), 7), (b"abc", 0), ("text", 0), (np.full(169, np.nan).tobytes(), 0)],
)
def test_a_base_of_another_bed_is_refused_in_a_line_and_the_surface_taken(bed, junk, count):
    bed[beds.BASE] = junk
    (note,) = tick.start(bpy.context, bed)
    assert note.level == "WARNING"
    assert f"base must have the bed's 169 pins (got {count})" in note.message
    assert len(note.message) < 400
    assert (running.find(bed).base == 40e-3).all()


def test_a_take_brings_its_base(bed, clock):
    begin(bed)
    bpy.ops.digiclay.take_record("EXEC_DEFAULT")
    press(0.0)
    press(0.0, base=True)
    form(clock)
    base = running.find(bed).base
    bpy.ops.digiclay.take_keep("EXEC_DEFAULT")
    handlers.end_all(handlers.STOPPED)
    bpy.ops.digiclay.session_reset("EXEC_DEFAULT")
    assert beds.read_base(bed) is None
    bpy.ops.digiclay.take_replay("EXEC_DEFAULT")
    np.testing.assert_array_equal(beds.read_base(bed), base)


GOOD = '["LOWER", false, [[1, 0, 0, 1, 0, 0]], [[0, 0, 0.003, 1, [0, 0]]], null]'
JUNK = {
    "no JSON": "nothing",
    "another list": "[1, 2]",
    "no list": "7",
    "a nest": "[" * 100_000,
    "an unknown brush": GOOD.replace("LOWER", "CARVE"),
    "no path": GOOD.replace("[[0, 0, 0.003", "[[0"),
    "an empty path": GOOD.replace("[[0, 0, 0.003, 1, [0, 0]]]", "[]"),
    "far away": GOOD.replace("[[0", "[[1e9"),
    "not finite": GOOD.replace("[[0, 0", "[[NaN, 0"),
    "too deep": GOOD.replace("0.003", "300"),
    "a number too few": GOOD.replace("0.003, 1, ", "0.003, "),
    "a text": GOOD.replace("0.003", '"0.003"'),
    "a stamp of nothing": GOOD.replace("null", '["x", []]'),
    "half a stamp": GOOD.replace("null", "[]"),
}


@pytest.mark.parametrize("junk", JUNK.values(), ids=JUNK)
def test_a_stroke_somebody_has_broken_is_left_out_with_a_message(bed, clock, junk):
    bed[beds.QUEUE] = json.dumps([0, [], [GOOD, junk]])
    notes = tick.start(bpy.context, bed)
    assert [(note.level, "left out" in note.message) for note in notes] == [("WARNING", True)]
    assert len(running.find(bed).strokes) == 1
    form(clock)
    assert exact(bed).min() < 39e-3


@pytest.mark.parametrize(
    "junk", ["nothing", "[]", '["a", [], []]', "[0, 7, 7]", "[1e999, [], []]", 7, b"x", [1.0]]
)
def test_a_queue_somebody_has_broken_is_none(bed, junk):
    bed[beds.QUEUE] = junk
    started(bed)
    assert running.find(bed).strokes == ()


#: Sizes of the fingertip, mm, chosen before each of three strokes and after the last.
CHOSEN = (8.0, 16.0, 12.0, 20.0)


def size_shown():
    """Return the width of the fingertip that is drawn, mm."""
    return 2e3 * bridge.finger_of(fingertip_of(only_bed())).width


def height_of_tip():
    """Return the height of the fingertip's lowest point, m."""
    return bridge.poses(only_bed())[0, 2]


def form_with_sizes(clock, queued):
    """Return the heights (n,), m, that three strokes leave, each of a size of its own."""
    bed = new_bed(rows=13, columns=13)
    handlers.watch()
    begin(bed)
    for y, size in zip(ROWS, CHOSEN, strict=False):
        devices.set_size(bed, 1e-3 * size)
        draw(y, **devices.read_sizes(bed))
        if not queued:
            form(clock)
    devices.set_size(bed, 1e-3 * CHOSEN[-1])
    seen = {}
    while (session := running.find(bed)).strokes:
        clock.tick()
        seen.setdefault(session.finished_strokes, size_shown())
    assert list(seen.values()) == (pytest.approx(CHOSEN[:3], rel=1e-5) if queued else [])  # 32 bits
    # The fingertip has the size chosen last, and its lowest point is where it was.
    low = running.find(bed).pose[2]
    clock.tick(3)
    assert size_shown() == pytest.approx(CHOSEN[-1], rel=1e-5)
    assert height_of_tip() == pytest.approx(low, abs=1e-6)
    return exact(bed)


def test_strokes_are_formed_and_shown_with_the_fingertip_that_they_were_drawn_with(
    clock, monkeypatch
):
    monkeypatch.setattr(live_session, "find_spare", lambda *given: 1e9)  # a stroke a tick
    formed = [form_with_sizes(clock, queued) for queued in (False, True)]
    np.testing.assert_array_equal(*formed)
    down = (40e-3 - formed[0]).reshape(13, 13)
    # Pins that only give way do so up to a force: 1.1 mm less than the fingertip comes down.
    assert (down[[10, 6, 2], 6] > 1.8e-3).all()
