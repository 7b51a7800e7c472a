"""What is edited, deleted or switched in mid-session has it wait or end, with a message."""

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.live import beds, handlers, tick
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.sessions.sculpting import withdraw_stroke
from digiclay.strokes.stroke import start

from tests.blender.at_hand import push_step
from tests.blender.session.live import FLOAT32, goes_on, press, queue, shown, started, waits


def test_a_session_waits_for_a_deleted_fingertip_and_goes_on_with_undo(bed, clock):
    started(bed)
    press(bed, clock)
    push_step("Formed")
    clock.tick()
    bpy.data.objects.remove(fingertip_of(bed))
    push_step("Deleted")
    waits(bed, clock, words="fingertip is deleted")
    bpy.ops.ed.undo()
    goes_on(clock)


def look_at(name):
    bpy.context.window.scene = bpy.data.scenes.get(name) or bpy.data.scenes.new(name)


def edit(mode="EDIT"):
    bpy.ops.object.mode_set(mode=mode)


def scale(bed, y):
    bed.scale.y = y


def lay_out(bed, rows):
    bed.digiclay.layout.rows = rows


def edit_through_a_linked_duplicate(bed):
    bpy.ops.object.duplicate(linked=True)
    edit()
    assert bed.mode == "OBJECT"


@pytest.mark.parametrize(
    "hinder, words, free",
    [
        (lambda bed: look_at("Other"), "no window shows its scene", lambda bed: look_at("Scene")),
        (lambda bed: edit(), "back to Object Mode", lambda bed: edit("OBJECT")),
        (lambda bed: edit("SCULPT"), "back to Object Mode", lambda bed: edit("OBJECT")),
        (edit_through_a_linked_duplicate, "back to Object Mode", lambda bed: edit("OBJECT")),
        (
            lambda bed: scale(bed, 2.0),
            "must be the same along x, y and z",
            lambda bed: scale(bed, 1.0),
        ),
        (lambda bed: lay_out(bed, 14), "169 pins, not 182", lambda bed: lay_out(bed, 13)),
        (lambda bed: bed.data.vertices.add(1), "170 pins now instead of 169", None),
        (
            lambda bed: bed.data.attributes.remove(bed.data.attributes["mode"]),
            "no longer that of",
            None,
        ),
        (lambda bed: fingertip_of(bed).scale.zero(), "scaled to nothing", None),
    ],
)
def test_a_session_waits_while_it_is_hindered(bed, clock, hinder, words, free):
    started(bed)
    hinder(bed)
    waits(bed, clock, words=words)
    if free is not None:
        free(bed)
        goes_on(clock)


@pytest.mark.usefixtures("machine")
def test_a_stroke_taken_back_in_edit_mode_is_drawn_so_afterwards(bed, clock):
    started(bed)
    queue(bed, start(0, 0.0, 0.0, 4e-3))
    clock.until(lambda: shown(bed).min() < 39e-3)
    edit()
    clock.tick()
    tick.bring_back(bpy.context, bed, withdraw_stroke(running.find(bed)))
    edit("OBJECT")
    goes_on(clock)
    np.testing.assert_allclose(shown(bed), 40e-3, rtol=0, atol=FLOAT32)


@pytest.mark.parametrize("what", ["bed", "scene"])
def test_a_deleted_bed_or_scene_ends_the_session_with_a_message(bed, clock, what):
    started(bed)
    if what == "bed":
        bpy.ops.object.delete()
    else:
        gone = bpy.context.window.scene
        bpy.context.window.scene = bpy.data.scenes.new("Other")
        bpy.data.scenes.remove(gone)
    assert [(note.level, "was deleted" in note.message) for note in clock.tick()] == [
        ("WARNING", True)
    ]
    assert running.list_sessions() == ()


def test_disabling_the_extension_ends_the_session_and_leaves_the_state(bed, clock):
    started(bed)
    press(bed, clock)
    kept = beds.read_snapshot(bed)
    digiclay.unregister()
    try:
        assert running.list_sessions() == ()
        assert beds.read_snapshot(bed) == kept
        assert handlers.reload_states not in bpy.app.handlers.undo_post
    finally:
        digiclay.register()
