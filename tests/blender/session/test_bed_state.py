"""Undo, redo, files and copies carry the state of a session."""

import bpy
import numpy as np
import pytest
from digiclay.core.session import snapshot
from digiclay.live import beds, handlers, tick
from digiclay.sessions import running

from tests.assemble import assert_near
from tests.blender.at_hand import push_step
from tests.blender.session.live import (
    FLOAT32,
    exact,
    move,
    only_bed,
    only_session,
    press,
    record,
    shown,
    started,
    undone,
)


def test_undo_takes_back_one_gesture_exactly_and_the_session_goes_on(bed, clock):
    started(bed)
    push_step("Start")
    press(bed, clock, -6.0)
    push_step("First")
    first = beds.read_snapshot(bed)
    press(bed, clock, 6.0)
    push_step("Second")
    second = beds.read_snapshot(bed)
    undone(clock)
    session = only_session()
    assert snapshot.dump(session.system, session.state) == first
    # The finger has not come from elsewhere.
    assert session.pose[0] == pytest.approx(-6e-3, abs=FLOAT32)
    assert_near(shown(), exact(), FLOAT32)
    undone(clock)
    assert (exact() == 40e-3).all()
    bpy.ops.ed.redo()
    bpy.ops.ed.redo()
    clock.tick(handlers.STALE)
    assert beds.read_snapshot(only_bed()) == second
    press(only_bed(), clock)
    assert exact()[6 * 13 + 6] < 39e-3


def test_undo_takes_back_what_was_formed_after_a_gesture_in_a_pause(bed, clock):
    # Both steps hold the same heights, and what has been formed since is in neither.
    started(bed)
    clock.tick(3)
    bpy.ops.digiclay.session_pause()
    clock.tick()
    push_step("Start")
    clock.tick()
    move(bed, clock, [(0.0, 38.0)])
    push_step("Moved in the pause")
    bpy.ops.digiclay.session_pause()
    clock.tick(20)
    assert exact(bed).min() < 39.8e-3
    undone(clock)
    assert (exact() == 40e-3).all()


def test_undo_to_before_the_bed_was_there_ends_the_session_with_a_message(clock):
    push_step("Nothing")
    bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
    push_step("Bed")
    tick.start(bpy.context, bpy.context.object)
    bpy.ops.ed.undo()
    notes = clock.tick()
    assert [note.level for note in notes] == ["WARNING"]
    assert "was deleted" in notes[0].message
    assert running.list_sessions() == ()


def test_a_message_is_of_its_bed_and_not_of_a_copy_or_of_a_new_one(bed):
    started(bed)
    copy = bed.copy()
    copy.data = bed.data.copy()
    handlers.end(handlers.STOPPED)
    assert [bool(running.last_message(one)) for one in (bed, copy, None)] == [True, False, True]
    running.set_message("The session ended: its file was closed")
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    assert running.last_message(bpy.context.object) == ""


@pytest.mark.parametrize("recovered", [False, True], ids=["saved", "after a crash"])
def test_a_file_of_a_session_goes_on_bit_for_bit(bed, clock, tmp_path, recovered):
    # What Blender saves by itself is a copy of the open file as it stands in the last tick.
    started(bed)
    move(bed, clock, [(0.0, 38.0)] * 10)
    kept, periods = beds.read_snapshot(bed), running.find(bed).state.period
    path = str(tmp_path / "session.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=recovered)
    if recovered:
        move(bed, clock, [(0.0, 46.0)] * 10)
    bpy.ops.wm.open_mainfile(filepath=path)
    bed = only_bed()
    assert running.list_sessions() == ()
    assert "another file was loaded" in running.last_message()
    started(bed)
    session = running.find(bed)
    assert snapshot.dump(session.system, session.state) == kept
    assert session.state.period == periods


@pytest.mark.parametrize("linked", [False, True])
def test_a_duplicate_carries_its_own_state_and_gets_a_fingertip(bed, clock, linked):
    started(bed)
    press(bed, clock, lifted=22)
    kept = beds.read_snapshot(bed)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.object
    assert copy != bed
    assert running.find(copy) is None
    notes = tick.start(bpy.context, copy)
    assert any("new fingertip" in note.message for note in notes)
    assert any("pins of its own" in note.message for note in notes) is linked
    assert beds.read_snapshot(copy) == kept
    before = exact(bed)
    press(copy, clock, 6.0)
    # Nobody presses the first one: its pins come to rest, 0.07 mm from where they are.
    assert_near(exact(bed), before, 0.1e-3)
    # Pressed 6 mm beside the first place: 0.9 mm.
    assert np.abs(exact(copy) - exact(bed)).max() > 0.5e-3
    assert_near(shown(bed), exact(bed), FLOAT32)


def test_an_appended_bed_carries_its_state(bed, clock, tmp_path):
    started(bed)
    press(bed, clock)
    kept, name = beds.read_snapshot(bed), bed.name
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.objects = [name]
    bpy.context.collection.objects.link(wanted.objects[0])
    appended = only_bed()
    notes = tick.start(bpy.context, appended)
    session = running.find(appended)
    assert snapshot.dump(session.system, session.state) == kept
    assert all(note.level == "INFO" for note in notes)


@pytest.mark.parametrize("junk", [b"", b"nothing", "a text", 7, [1.0, 2.0]])
def test_a_state_somebody_has_broken_begins_at_rest_with_a_message(bed, junk):
    bed[beds.STATE] = junk
    bed[beds.POSE] = junk
    bed[beds.TICK] = "x"
    notes = tick.start(bpy.context, bed)
    assert [note.level for note in notes] == ["WARNING"]
    assert (exact(bed) == 40e-3).all()


def test_a_recording_that_undo_has_left_ends_with_a_message(bed, clock):
    started(bed)
    push_step("Start")
    press(bed, clock)
    push_step("Press")
    record(bed)
    clock.tick(3)
    bpy.ops.ed.undo()
    assert ["recording ended" in note.message for note in clock.tick(handlers.STALE)] == [True]
    assert only_session().recording is None
