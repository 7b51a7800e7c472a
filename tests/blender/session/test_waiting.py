"""What is edited, deleted or switched in mid-session has it wait or end, with a message."""

from __future__ import annotations

from typing import Any

import bpy
import digiclay
from digiclay.device import view
from digiclay.live import bed_state, handlers, running

from tests.blender.session.live import (
    Clock,
    goes_on,
    press,
    started,
    waits,
)


def test_a_session_waits_for_a_deleted_fingertip_and_goes_on_with_undo(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    bpy.ops.ed.undo_push(message="Formed")
    clock.tick()
    bpy.data.objects.remove(view.fingertip_of(bed))
    bpy.ops.ed.undo_push(message="Deleted")
    waits(bed, clock, words="fingertip is deleted")
    bpy.ops.ed.undo()
    goes_on(clock)


def test_a_session_waits_while_its_scene_is_not_shown(bed: Any, clock: Clock) -> None:
    started(bed)
    home = bpy.context.window.scene
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    waits(bed, clock, words="no window shows its scene")
    bpy.context.window.scene = home
    goes_on(clock)


def test_a_session_waits_while_the_bed_is_edited(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.mode_set(mode="EDIT")
    waits(bed, clock, words="back to Object Mode")
    bpy.ops.object.mode_set(mode="OBJECT")
    goes_on(clock)


def test_a_session_waits_while_its_pins_are_edited_through_another_bed(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.duplicate(linked=True)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bed.mode == "OBJECT"
    waits(bed, clock, words="back to Object Mode")
    bpy.ops.object.mode_set(mode="OBJECT")
    goes_on(clock)


def test_a_session_waits_while_pins_are_missing(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.data.vertices.add(1)
    waits(bed, clock, words="170 pins now instead of 169")


def test_a_session_waits_for_a_mesh_that_has_lost_its_attributes(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.data.attributes.remove(bed.data.attributes["mode"])
    waits(bed, clock, words="no longer that of its pins")


def test_a_session_waits_while_the_bed_is_scaled_unevenly(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.scale = (1.0, 2.0, 1.0)
    waits(bed, clock, words="must be the same along x, y and z")
    bed.scale = (1.0, 1.0, 1.0)
    goes_on(clock)


def test_a_session_waits_while_the_pins_are_not_those_of_the_layout(bed: Any, clock: Clock) -> None:
    started(bed)
    bed.digiclay.layout.rows = 14
    waits(bed, clock, words="169 pins, not 182")
    bed.digiclay.layout.rows = 13
    goes_on(clock)


def test_a_session_waits_for_a_fingertip_scaled_to_nothing(bed: Any, clock: Clock) -> None:
    started(bed)
    view.fingertip_of(bed).scale = (0.0, 0.0, 0.0)
    waits(bed, clock, words="scaled to nothing")


def test_a_deleted_bed_ends_its_session_with_a_message(bed: Any, clock: Clock) -> None:
    started(bed)
    bpy.ops.object.delete()
    notes = clock.tick()
    assert [note.level for note in notes] == ["WARNING"]
    assert running.list_sessions() == ()


def test_a_deleted_scene_ends_the_session_with_a_message(bed: Any, clock: Clock) -> None:
    started(bed)
    gone, other = bpy.context.window.scene, bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    bpy.data.scenes.remove(gone)
    assert ["was deleted" in note.message for note in clock.tick()] == [True]
    assert running.list_sessions() == ()


def test_disabling_the_extension_ends_the_session_and_leaves_the_state(bed: Any, clock: Clock) -> None:
    started(bed)
    press(bed, clock)
    kept = bed_state.read_snapshot(bed)
    digiclay.unregister()
    try:
        assert running.list_sessions() == ()
        assert bed_state.read_snapshot(bed) == kept
        assert handlers.reload_states not in bpy.app.handlers.undo_post
    finally:
        digiclay.register()
