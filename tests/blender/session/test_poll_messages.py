"""A button that cannot be pressed says why: Blender shows it where the mouse rests on it."""

import bpy
import pytest
from digiclay.live import tick
from digiclay.roles import fingertip_of

from tests.blender.at_hand import OPERATORS, activate
from tests.blender.session.live import press, started

#: What Blender says of an operator that says nothing.
NOTHING = "failed, context is incorrect"
#: What is said of a bed at rest in the background, and of one with a session that has formed
#: something.
AT_REST = {
    "digiclay.bake_free": "The bed has no bake",
    "digiclay.clear_pins": "No pins are picked",
    "digiclay.forget_surface": "Features are measured from the bed at rest already",
    "digiclay.session": "A live session needs a window; takes can be baked without",
    "digiclay.session_pause": "No session runs on the active bed: start one first",
    "digiclay.session_reset": "The bed is at rest already",
    "digiclay.shape_from_object": (
        "Select the object first, then the bed with Shift: its upper side is displayed"
    ),
    "digiclay.shape_remove": "The bed has no shape",
    "digiclay.take_keep": "Record a take first",
    "digiclay.take_record": "Start a session first",
    "digiclay.take_replay": "The bed has no take: record one in a session first",
}
IN_A_SESSION = {
    "digiclay.bake": "Stop the session on this bed first",
    "digiclay.rebuild": "Stop the session first: its pins cannot be exchanged",
    "digiclay.session": "A session runs on this bed already: Esc stops it",
    "digiclay.shape_from_file": "Stop the session first: the bed will be reshaped",
    "digiclay.shape_keep": "Stop the session first",
    "digiclay.take_replay": "Stop the session on this bed first",
}


#: What can be called without a bed, and what while one is edited or painted.
WITHOUT_A_BED = {
    "digiclay.add_sample",
    "digiclay.open_scene",
    "import_scene.digital_clay_run",
    "mesh.digital_clay_add",
}
IN_EDIT_MODE = {"digiclay.leave_mode"}


def refused(name):
    """Return why an operator declines to be called, or an empty text when it does not."""
    area, _, own = name.partition(".")
    operator = getattr(getattr(bpy.ops, area), own)
    if operator.poll():
        return ""
    with pytest.raises(RuntimeError) as told:
        operator()
    assert NOTHING not in str(told.value)
    return str(told.value).partition(".poll() ")[2]


def declining():
    """Return what every operator that declines says."""
    return {name: words for name in OPERATORS if (words := refused(name))}


def test_the_reasons_at_rest_name_what_is_missing(bed):
    assert AT_REST.items() <= declining().items()


def test_the_reasons_in_a_session_name_the_session(bed, clock):
    started(bed)
    press(bed, clock)
    assert IN_A_SESSION.items() <= declining().items()


def test_in_another_mode_and_without_a_bed_nothing_can_be_changed(bed, clock):
    started(bed)
    press(bed, clock)
    tick.stop(bed.session_uid)
    for mode in ("EDIT", "WEIGHT_PAINT"):
        bpy.ops.object.mode_set(mode=mode)
        activate(fingertip_of(bed))
        assert bpy.context.mode == "OBJECT"
        assert refused("digiclay.session_reset") == "Go back to Object Mode first"
        activate(bed)
        assert set(OPERATORS) - declining().keys() == IN_EDIT_MODE
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects.remove(bed)
    assert set(OPERATORS) - declining().keys() == WITHOUT_A_BED
    activate(bpy.data.objects["Cube"])
    bpy.ops.object.mode_set(mode="SCULPT")
    assert refused("mesh.digital_clay_add")


@pytest.mark.usefixtures("bed")
def test_from_sculpt_mode_too_it_goes_back_to_object_mode():
    bpy.ops.object.mode_set(mode="SCULPT")
    bpy.ops.digiclay.leave_mode()
    assert bpy.context.mode == "OBJECT"
