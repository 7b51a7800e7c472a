"""A recording under way outlives what ends or interrupts its session."""

import shutil
from dataclasses import replace

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.core.session.live_session import Recording
from digiclay.live import handlers
from digiclay.recorded import takes
from digiclay.sessions import running
from digiclay.strokes.stroke import let_go, start

from tests.blender.at_hand import activate, push_step
from tests.blender.session.live import move, only_bed, only_session, queue, started, undone

#: Ticks that are recorded, and the time they take, s: ten periods of 5 ms in three ticks.
TICKS, SECONDS = 15, 0.5


@pytest.fixture(autouse=True)
def own_folder(tmp_path):
    """Have Blender keep what can be recovered in a folder of the test."""
    (tmp_path / "temporary").mkdir()
    bpy.context.preferences.filepaths.temporary_directory = str(tmp_path / "temporary")


@pytest.fixture
def recording(bed, clock):
    """A bed whose session records, with half a second in it."""
    started(bed)
    clock.tick()
    bpy.ops.digiclay.take_record()
    recorded_on(bed, clock)
    return bed


def recorded_on(bed, clock):
    """Press and record for half a second."""
    move(bed, clock, [(0.0, 38.0)] * TICKS)


def seconds(bed):
    """Return how long the takes of a bed are, s."""
    return [round(entry.seconds, 1) for entry in takes.list_takes(bed)]


def save(path, **how):
    """Save the open file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **how)


def load(path):
    """Open another file; return its bed."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return only_bed()


def test_disabling_the_extension_keeps_what_was_recorded_in_an_undo_step(recording):
    digiclay.unregister()
    try:
        assert "kept as Take 1" in running.last_message()
        assert seconds(recording) == [SECONDS]
        push_step("Later")
        bpy.ops.ed.undo()
        assert seconds(only_bed()) == [SECONDS]
    finally:
        digiclay.register()


def test_stopping_one_of_two_sessions_keeps_its_recording_alone(recording, clock):
    name = recording.name
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    other = bpy.context.object
    started(other)
    activate(bpy.data.objects[name])
    assert bpy.ops.digiclay.session_stop() == {"FINISHED"}
    assert seconds(bpy.data.objects[name]) == [SECONDS]
    assert [session.uid for session in running.list_sessions()] == [other.session_uid]
    assert handlers.reload_states in bpy.app.handlers.undo_post


def test_a_saved_file_has_the_take_so_far_and_recording_goes_on(recording, clock, tmp_path):
    with pytest.raises(RuntimeError):
        save(tmp_path / "nowhere" / "saved.blend")
    assert (seconds(recording), handlers.has_unsaved()) == ([], True)
    save(tmp_path / "saved.blend")
    assert (seconds(recording), handlers.has_unsaved()) == ([], False)
    recorded_on(recording, clock)
    save(tmp_path / "copy.blend", copy=True)  # does not count as the file
    assert handlers.has_unsaved()
    bpy.ops.digiclay.session_stop()
    assert seconds(recording) == [2 * SECONDS]
    bed = load(tmp_path / "saved.blend")
    assert seconds(bed) == [SECONDS]
    assert bpy.ops.digiclay.take_replay() == {"FINISHED"}


def test_a_recording_that_was_just_saved_is_not_left_once_more(recording, tmp_path):
    save(tmp_path / "saved.blend")
    started(load(tmp_path / "saved.blend"))  # and nothing where nothing is recorded
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not handlers.file_path().exists()


@pytest.mark.parametrize(
    "how, kept",
    [("the recording goes on", []), ("session_stop", ["Take 1"]), ("take_keep", ["Take 1"])],
)
def test_while_blender_may_save_by_itself_the_bed_has_the_take_and_never_twice(
    recording, clock, how, kept
):
    for _ in range(2):
        handlers.write_recovery()
        assert seconds(recording) == [SECONDS]
    if kept:
        getattr(bpy.ops.digiclay, how)()
    handlers.clear_recovery()
    assert [entry.name for entry in takes.list_takes(recording)] == kept


def test_what_undo_has_taken_back_meanwhile_is_not_missed(recording, clock):
    push_step("Before")
    handlers.write_recovery()
    push_step("After")
    bpy.ops.ed.undo()
    handlers.clear_recovery()
    assert seconds(only_bed()) == []


def test_the_former_file_can_be_recovered_with_its_take(recording, clock, tmp_path):
    save(tmp_path / "saved.blend")
    recorded_on(recording, clock)
    bpy.ops.wm.read_homefile(use_empty=True)
    told = "Take 1 (1.0 s). Restore it with File > Recover > Auto Save: digiclay_recording.blend"
    assert running.last_message().endswith(told)
    assert handlers.file_path().parent == tmp_path / "temporary"
    bpy.ops.wm.recover_auto_save(filepath=str(handlers.file_path()))
    assert seconds(only_bed()) == [2 * SECONDS]


def test_what_is_recorded_anew_after_undo_is_not_what_was_saved():
    recorded = Recording.begin(b"", 0, np.zeros(7), 0).extend(np.zeros((9, 7)), 1)
    back = replace(recorded, saved=recorded.count).cut_at_period(5)
    assert not back.unsaved
    assert back.extend(np.zeros((4, 7)), 2).unsaved


def test_what_cannot_be_left_is_told(recording, tmp_path):
    shutil.rmtree(tmp_path / "temporary")
    bpy.ops.wm.read_homefile(use_empty=True)
    assert "It could not be saved for recovery: " in running.last_message()


def test_undoing_the_first_gesture_of_a_recording_leaves_it_recording(bed, clock):
    started(bed)
    push_step("Start")
    clock.tick()
    bpy.ops.digiclay.take_record("EXEC_DEFAULT", True)
    recorded_on(bed, clock)
    push_step("Gesture")
    undone(clock)
    assert only_session().recording is not None


def test_a_stroke_of_another_size_keeps_what_was_recorded_as_a_take_of_the_size_before(
    recording, clock
):
    finger = running.find(recording).scene.fingers[0].fingertip
    wide = replace(finger, width=1.5 * finger.width)
    for y, tip in ((-9e-3, finger), (9e-3, wide)):
        stroke = let_go(start(0, 0.0, y, 2e-3, finger=tip))
        queue(recording, stroke)
    notes = clock.until(lambda: not running.find(recording).strokes)
    assert ["kept as Take 1" in note.message for note in notes] == [True]
    assert running.find(recording).recording is None
    take = takes.read(recording)
    assert take.scene.fingers[0].fingertip == finger
    # The stroke before belongs to it.
    assert seconds(recording)[0] > SECONDS
