"""A bed, its housing and its fingertip are one: appended, deleted, duplicated and hidden together."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.fingertip import Fingertip
from digiclay.device import view
from digiclay.exchange import formed_bed
from digiclay.live import tick
from digiclay.recorded import bake
from digiclay.roles import BALL, ROLE, fingertip_of
from digiclay.sessions import running
from digiclay.settings import properties

from tests.assemble import assert_near
from tests.blender.at_hand import (
    activate,
    added,
    beds,
    delete,
    done,
    duplicate,
    fetch,
    housings,
    looked,
    older,
    redone,
    save_and_open,
    select,
    undone,
    whole,
)
from tests.blender.session.live import Clock, press, started

pytestmark = pytest.mark.usefixtures("watched")


def still(bed):
    """Return a bake of two frames in which nothing moves."""
    cells = bridge.read_cells(bed.data)
    twice = {name: np.array([cells[name]] * 2) for name in ("height", "mode", "force")}
    twice["waiting"] = np.zeros_like(twice["mode"], bool)
    return bake.BakedFrames(
        cells["position"], **twice, pose=np.array([bridge.pose(fingertip_of(bed))] * 2)
    )


def reset_to_empty():
    bpy.ops.wm.read_homefile(use_empty=True)
    looked()
    done("Empty")


@pytest.mark.parametrize("how", ["append", "append baked", "link"])
def test_a_bed_of_another_file_comes_with_its_fingertip_and_nothing_else(tmp_path, how):
    bed = added()
    if how == "append baked":
        bake.apply(bed, still(bed), 1, [Fingertip()], [])
    at, name = bridge.pose(fingertip_of(bed)), bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bed.blend"))
    reset_to_empty()
    fetch(tmp_path / "bed.blend", name, how)
    # An appended one as Blender leaves it, without any help.
    assert whole(*beds())
    assert len(bpy.context.scene.collection.children) == 0
    done("Append")
    (bed,) = beds()
    assert (whole(bed), housings()) == (True, 1)
    assert_near(bridge.pose(fingertip_of(bed)), at, 1e-7)


def test_pins_that_were_made_real_stay_in_the_scene_as_long_as_the_user_wants():
    bed, counts = added(), []
    bed.digiclay_display.form = "both"
    bpy.ops.object.duplicates_make_real()
    for step in (
        lambda: done("Make Instances Real"),
        lambda: duplicate(*beds()),
        undone,
        undone,
        redone,
    ):
        step()
        counts.append(len([one for one in bpy.context.scene.objects if one.get(ROLE) == "pin"]))
    assert counts == [25, 25, 25, 0, 25]


def test_a_mesh_that_a_bed_was_converted_to_comes_alone_beside_the_bed():
    bed = added()
    for kind in ("MESH", "CURVE"):
        bpy.ops.object.convert(target=kind, keep_original=kind == "MESH")
        done("Convert")
        others = set(bpy.context.scene.objects) - {bed, *bed.children_recursive}
        assert others == {bpy.context.object}


@pytest.mark.parametrize("by_hand", [True, False])
def test_undo_stops_where_the_fingertip_of_a_copy_was_deleted(by_hand):
    copy = duplicate(added())
    if by_hand:
        delete(fingertip_of(copy))
    else:
        bpy.data.objects.remove(fingertip_of(copy))
        done("Delete")
    copy.location.x = 1.0
    done("Move")
    undone()
    assert [bed.location.x for bed in beds() if fingertip_of(bed) is None] == [0.0]


@pytest.mark.parametrize("everything", [False, True], ids=["the bed", "all that can be selected"])
def test_a_bed_is_deleted_with_its_fingertip_and_undo_brings_both_back(everything):
    bed = added()
    delete(*(bpy.context.selectable_objects if everything else ()), bed)
    assert len(bpy.data.objects) == len([one for one in bpy.data.objects if one.get(ROLE) == "pin"])
    undone()
    assert (whole(*beds()), len(beds())) == (True, 1)
    redone()
    assert len(bpy.context.scene.objects) == 0
    undone()
    assert whole(*beds())


@pytest.mark.parametrize("what", ["cube", "bed", "cube, with a hand"])
def test_a_bed_joined_into_another_object_takes_its_fingertips_along_and_undo_brings_them_back(
    what,
):
    if what == "bed":
        into = added(1.0)
    else:
        bpy.ops.mesh.primitive_cube_add()
        into = bpy.context.object
    stays = into.name
    bed = added()
    if "hand" in what:
        assert bpy.ops.digiclay.add_hand() == {"FINISHED"}
        done("Add Hand")
    name, before = bed.name, {one.name for one in bpy.context.scene.objects}
    select(bed)
    into.select_set(True)
    activate(into)
    assert bpy.ops.object.join() == {"FINISHED"}
    done("Join")
    (kept,) = (one for one in bpy.context.scene.objects if one.parent is None)
    assert kept.name == stays
    assert whole(*beds()) if what == "bed" else len(bpy.context.scene.objects) == 1
    undone()
    assert {one.name for one in bpy.context.scene.objects} == before
    assert {fingertip_of(each) is not None for each in beds()} == {True}
    assert bpy.data.objects[name] in beds()


def test_a_click_on_the_ball_takes_hold_of_its_fingertip_alone():
    bed, other = added(), added(1.0)
    tip = fingertip_of(bed)
    # Older files have it so.
    tip[BALL].hide_select, tip[BALL].lock_location = (
        True,
        (False, False, False),
    )
    done("Older")
    assert (tip[BALL].hide_select, all(tip[BALL].lock_location)) == (False, True)
    select(tip[BALL])
    done("Select")
    assert bpy.context.view_layer.objects.active == tip
    assert set(bpy.context.selected_objects) == {tip, tip[BALL]}
    assert not fingertip_of(other).select_get()
    before = bridge.pose(tip)
    bpy.ops.transform.translate(value=(0.1, 0.0, 0.0))
    done("Move")
    # A millimeter of the device is a centimeter in Blender; its matrices are of 32 bits.
    assert_near(bridge.pose(tip)[:3] - before[:3], (0.01, 0.0, 0.0), 1e-7)
    undone()
    tip = fingertip_of(bed)
    assert_near(bridge.pose(tip), before, 1e-7)
    assert tip.select_get()


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("along", [False, True], ids=["the bed", "its fingertip too"])
def test_a_copy_of_a_bed_has_a_fingertip_of_its_own(linked, along):
    bed = added()
    tip = fingertip_of(bed)
    tip.keyframe_insert("location", frame=1)
    select(*[tip] * along, bed)
    done("Select")
    bpy.ops.object.duplicate(linked=linked)
    bpy.context.object.location.x = 1.0
    done("Duplicate")
    assert (len(beds()), whole(*beds()), housings()) == (2, True, 2)
    tips = [fingertip_of(one) for one in beds()]
    np.testing.assert_allclose(*map(bridge.pose, tips), rtol=0, atol=1e-7)
    if not (linked and along):  # else Blender has copied it, and was asked to share
        assert tips[0].animation_data.action != tips[1].animation_data.action
    for step, count in ((undone, 1), (redone, 2)):
        step()
        assert (len(beds()), whole(*beds())) == (count, True)


def test_what_is_done_right_after_undo_is_not_undone_with_it():
    duplicate(added())
    bpy.ops.ed.undo()  # to the copy as Blender made it, without a fingertip
    # The operator is listed, with an undo step.
    bpy.ops.transform.translate("EXEC_DEFAULT", True, value=(1.0, 0.0, 0.0))
    looked()
    assert (sorted(bed.location.x for bed in beds()), whole(*beds())) == ([0.0, 1.0], True)
    undone()
    assert (len(beds()), whole(*beds())) == (1, True)


def test_several_beds_are_copied_at_once_and_the_first_ones_deleted_before_anybody_looks():
    first = [added(), added(1.0)]
    select(*first)
    bpy.ops.object.duplicate()
    copies = list(bpy.context.selected_objects)
    delete(*first)
    assert set(copies) == set(beds())
    assert whole(*copies)


def test_a_fingertip_deleted_alone_stays_deleted_and_comes_back_with_the_next_session():
    bed = added()
    at = bridge.pose(fingertip_of(bed))
    delete(fingertip_of(bed))
    assert list(bpy.context.scene.objects) == [bed]
    notes = tick.start(bpy.context, bed)
    assert [note.message for note in notes] == [f"{bed.name} got its fingertip back"]
    assert whole(bed)
    np.testing.assert_array_equal(bridge.pose(fingertip_of(bed)), at)


@pytest.mark.parametrize("hung", [False, True], ids=["on its bed", "on nothing"])
def test_a_copy_of_a_bed_has_a_fingertip_though_the_first_one_was_deleted(hung):
    bed = added()
    if hung:
        select(fingertip_of(bed))
        bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
        done("Clear Parent")
    delete(fingertip_of(bed))
    copy = duplicate(bed)
    assert fingertip_of(bed) is None
    assert fingertip_of(copy).parent == copy


def test_a_bed_deleted_in_mid_session_ends_it_and_a_copy_goes_on_from_its_state():
    bed, clock = added(), Clock()
    started(bed)
    press(bed, clock)
    copy = duplicate(bed)
    select(bed)
    bpy.ops.object.delete()
    clock.tick()
    done("Delete")
    assert running.list_sessions() == ()
    assert whole(copy)
    started(copy)
    assert running.find(copy).state.row(0).min() < 39e-3


def test_what_the_user_has_hung_on_the_fingertip_stays_where_it_is():
    bed = added()
    bed.location.z = (
        0.0  # what hangs on something that is deleted goes to the origin: that is Blender's way
    )
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.collection.objects.link(camera)
    camera.parent, camera.location = fingertip_of(bed), (0.0, 0.0, 0.3)
    done("Hang")
    where = np.array(camera.matrix_world)
    bpy.data.objects.remove(bed)
    done("Delete")
    assert list(bpy.context.scene.objects) == [camera]
    assert_near(camera.matrix_world, where, 1e-6)


@pytest.mark.parametrize("name", ["eye", "hide_viewport", "hide_render"])
def test_a_bed_is_hidden_and_shown_with_its_fingertip(name):
    bed = added()
    tip = fingertip_of(bed)

    def hide(thing, on):
        """Hide or show by the eye or a switch; return what is hidden of bed, fingertip and ball."""
        thing.hide_set(on) if name == "eye" else setattr(thing, name, on)
        done("Hide")
        return hidden()

    def hidden():
        tip = fingertip_of(beds()[0])
        parts = beds()[0], tip, tip[BALL]
        return [thing.hide_get() if name == "eye" else getattr(thing, name) for thing in parts]

    steps = [(bed, True, [True] * 3), (bed, False, [False] * 3)] * 2
    # What was hidden for itself is not shown along.
    steps += [
        (tip, True, [False, True, True]),
        (bed, True, [True] * 3),
        (bed, False, [False, True, True]),
    ]
    for thing, on, wanted in [*steps, (tip, False, [False] * 3), (bed, True, [True] * 3)]:
        assert hide(thing, on) == wanted
    undone()
    assert hidden() == [False] * 3


def test_a_bed_whose_settings_do_not_go_together_is_exported_as_it_is_drawn_and_copied():
    bed = added()
    bed.digiclay.layout.pitch = 1.0  # mm, less than the bore
    with pytest.raises(ParameterError, match="Pitch must be"):
        properties.read_scene(bed)
    assert bpy.ops.digiclay.find_features() == {"FINISHED"}
    np.testing.assert_array_equal(
        formed_bed.read_formed(bed).height, bridge.read_cells(bed.data)["height"]
    )
    copy = duplicate(bed)
    assert whole(bed, copy)
    # Not by an operator: what the outliner and scripts do is looked after as well.
    bpy.data.objects.remove(bed)
    done("Delete")
    assert whole(copy)


def test_a_bed_of_an_older_file_stays_as_it_is_and_is_one_all_the_same(tmp_path):
    older(added())
    save_and_open(tmp_path / "older.blend")
    looked()
    (bed,) = beds()
    assert (len(bpy.context.scene.objects), housings()) == (4, 1)
    bed.hide_set(True)
    done("Hide")
    assert not [thing for thing in bpy.context.scene.objects if thing.visible_get()]
    bed.hide_set(False)
    done("Show")
    copy = duplicate(bed)
    assert (len(bpy.context.scene.objects), housings()) == (7, 2)
    assert not view.shows_force(copy)
    delete(bed)
    assert whole(copy)


def test_a_bed_appended_from_an_older_file_is_made_whole_and_its_helpers_put_away(tmp_path):
    bed = added()
    older(bed)
    name = bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "older.blend"))
    reset_to_empty()
    fetch(tmp_path / "older.blend", name, "append")
    assert len(bpy.context.scene.objects) == 1 + 28
    done("Append")
    assert (whole(*beds()), housings()) == (True, 1)
    undone()
    assert len(bpy.context.scene.objects) == 0
