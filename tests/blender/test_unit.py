"""A bed, its housing and its fingertip are one: appended, deleted, duplicated and hidden together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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

from tests.blender.at_hand import added, beds, done, housings, looked, older, redone, select, undone, whole
from tests.blender.session.live import Clock, press, started

pytestmark = pytest.mark.usefixtures("watched")


def still(bed: Any) -> bake.BakedFrames:
    """Return a bake of two frames in which nothing moves."""
    cells = bridge.read_cells(bed.data)
    twice = {name: np.array([cells[name]] * 2) for name in ("height", "mode", "force")}
    return bake.BakedFrames(cells["position"], **twice, pose=np.array([bridge.pose(fingertip_of(bed))] * 2))


@pytest.mark.parametrize("how", ["append", "append baked", "link"])
def test_a_bed_of_another_file_comes_with_its_fingertip_and_nothing_else(tmp_path: Path, how: str) -> None:
    bed = added()
    if how == "append baked":
        bake.apply(bed, still(bed), 1, [Fingertip()], keyframe_fingers=False)
    at = bridge.pose(fingertip_of(bed))
    name = bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bed.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    looked()
    source = {"directory": str(tmp_path / "bed.blend" / "Object") + "/", "filename": name}
    if how == "link":
        bpy.ops.wm.link(**source)
        done("Link")
        assert (len(bpy.context.scene.objects), housings()) == (1, 1)
        select(bpy.context.scene.objects[0])
        bpy.ops.object.make_local(type="ALL")
        done("Make Local")
        assert whole(*beds())
        return
    bpy.ops.wm.append(**source)
    # As Blender leaves it, without any help.
    (bed,) = beds()
    assert whole(bed)
    assert len(bpy.context.scene.collection.children) == 0
    done("Append")
    assert whole(bed)
    assert housings() == 1
    bpy.context.view_layer.update()
    np.testing.assert_allclose(bridge.pose(fingertip_of(bed)), at, rtol=0, atol=1e-7)


@pytest.mark.parametrize("by_hand", [True, False])
def test_undo_stops_where_the_fingertip_of_a_copy_was_deleted(by_hand: bool) -> None:
    added()
    bpy.ops.object.duplicate()
    done("Duplicate")
    copy = bpy.context.object
    if by_hand:
        select(fingertip_of(copy))
        bpy.ops.object.delete()
    else:
        bpy.data.objects.remove(fingertip_of(copy))
    done("Delete")
    copy.location.x = 1.0
    done("Move")
    undone()
    without = [bed for bed in beds() if fingertip_of(bed) is None]
    assert [bed.location.x for bed in without] == [0.0]


@pytest.mark.parametrize("everything", [False, True], ids=["the bed", "all that can be selected"])
def test_a_bed_is_deleted_with_its_fingertip_and_undo_brings_both_back(everything: bool) -> None:
    bed = added()
    bpy.ops.object.select_all(action="SELECT" if everything else "DESELECT")
    bed.select_set(True)
    done("Select")
    bpy.ops.object.delete()
    done("Delete")
    assert len(bpy.data.objects) == len([one for one in bpy.data.objects if one.get(ROLE) == "pin"])
    undone()
    assert whole(*beds())
    assert len(beds()) == 1
    redone()
    assert len(bpy.context.scene.objects) == 0
    undone()
    assert whole(*beds())


def test_a_click_on_the_ball_takes_hold_of_its_fingertip_alone() -> None:
    bed, other = added(), added(1.0)
    tip = fingertip_of(bed)
    tip[BALL].hide_select, tip[BALL].lock_location = True, (False, False, False)  # as in older files
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
    np.testing.assert_allclose(bridge.pose(tip)[:3] - before[:3], (0.01, 0.0, 0.0), rtol=0, atol=1e-7)
    undone()
    tip = fingertip_of(bed)
    np.testing.assert_allclose(bridge.pose(tip), before, rtol=0, atol=1e-7)
    assert tip.select_get()


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("along", [False, True], ids=["the bed", "its fingertip too"])
def test_a_copy_of_a_bed_has_a_fingertip_of_its_own(linked: bool, along: bool) -> None:
    bed = added()
    tip = fingertip_of(bed)
    tip.keyframe_insert("location", frame=1)
    select(*[tip] * along, bed)
    done("Select")
    bpy.ops.object.duplicate(linked=linked)
    bpy.context.object.location.x = 1.0
    done("Duplicate")
    assert len(beds()) == 2
    assert whole(*beds())
    assert housings() == 2
    tips = [fingertip_of(one) for one in beds()]
    poses = [bridge.pose(one) for one in tips]
    np.testing.assert_allclose(*poses, rtol=0, atol=1e-7)
    if not (linked and along):  # else Blender has copied it, and was asked to share
        assert tips[0].animation_data.action != tips[1].animation_data.action
    undone()
    assert len(beds()) == 1
    assert whole(*beds())
    redone()
    assert len(beds()) == 2
    assert whole(*beds())


def test_several_beds_are_copied_at_once_and_the_first_ones_deleted_before_anybody_looks() -> None:
    first = [added(), added(1.0)]
    select(*first)
    bpy.ops.object.duplicate()
    copies = list(bpy.context.selected_objects)
    select(*first)
    bpy.ops.object.delete()
    done("Delete")
    assert set(copies) == set(beds())
    assert whole(*copies)


def test_a_fingertip_deleted_alone_stays_deleted_and_comes_back_with_the_next_session() -> None:
    bed = added()
    tip = fingertip_of(bed)
    at = bridge.pose(tip)
    select(tip)
    bpy.ops.object.delete()
    done("Delete")
    assert list(bpy.context.scene.objects) == [bed]
    notes = tick.start(bpy.context, bed)
    assert [note.message for note in notes] == [f"{bed.name} got its fingertip back"]
    assert whole(bed)
    np.testing.assert_array_equal(bridge.pose(fingertip_of(bed)), at)


def test_a_bed_deleted_in_mid_session_ends_it_and_a_copy_goes_on_from_its_state() -> None:
    bed, clock = added(), Clock()
    bpy.ops.object.select_all(action="DESELECT")
    started(bed)
    press(bed, clock)
    select(bed)
    bpy.ops.object.duplicate()
    done("Duplicate")
    copy = bpy.context.object
    select(bed)
    bpy.ops.object.delete()
    clock.tick()
    done("Delete")
    assert running.list_sessions() == ()
    assert whole(copy)
    started(copy)
    assert running.find(copy).state.row(0).min() < 39e-3


def test_what_the_user_has_hung_on_the_fingertip_stays_where_it_is() -> None:
    bed = added()
    bed.location.z = 0.0  # what hangs on something that is deleted goes to the origin: that is Blender's way
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.collection.objects.link(camera)
    camera.parent, camera.location = fingertip_of(bed), (0.0, 0.0, 0.3)
    done("Hang")
    where = np.array(camera.matrix_world)
    bpy.data.objects.remove(bed)
    done("Delete")
    assert list(bpy.context.scene.objects) == [camera]
    np.testing.assert_allclose(camera.matrix_world, where, rtol=0, atol=1e-6)


def hidden(name: str, *things: Any) -> list[bool]:
    """Tell of objects whether they are hidden, by the eye or a switch of their own."""
    return [thing.hide_get() if name == "eye" else getattr(thing, name) for thing in things]


@pytest.mark.parametrize("name", ["eye", "hide_viewport", "hide_render"])
def test_a_bed_is_hidden_and_shown_with_its_fingertip(name: str) -> None:
    bed = added()
    tip = fingertip_of(bed)
    parts = bed, tip, tip[BALL]

    def hide(thing: Any, on: bool) -> None:
        thing.hide_set(on) if name == "eye" else setattr(thing, name, on)
        done("Hide")

    for _ in range(2):
        hide(bed, True)
        assert hidden(name, *parts) == [True] * 3
        hide(bed, False)
        assert hidden(name, *parts) == [False] * 3
    hide(tip, True)
    assert hidden(name, *parts) == [False, True, True]
    # What was hidden for itself is not shown along.
    hide(bed, True)
    hide(bed, False)
    assert hidden(name, *parts) == [False, True, True]
    hide(tip, False)
    assert hidden(name, *parts) == [False] * 3
    hide(bed, True)
    undone()
    tip = fingertip_of(beds()[0])
    assert hidden(name, beds()[0], tip, tip[BALL]) == [False] * 3


def test_a_bed_whose_settings_do_not_go_together_is_exported_as_it_is_drawn_and_copied() -> None:
    bed = added()
    bed.digiclay.layout.pitch = 1.0  # mm, less than the bore
    with pytest.raises(ParameterError, match="Pitch must be"):
        properties.read_scene(bed)
    assert bpy.ops.digiclay.find_features() == {"FINISHED"}
    np.testing.assert_array_equal(formed_bed.read_formed(bed).height, bridge.read_cells(bed.data)["height"])
    select(bed)
    bpy.ops.object.duplicate()
    done("Duplicate")
    assert whole(bed, bpy.context.object)
    # Not by an operator: what the outliner and scripts do is looked after as well.
    copy = bpy.context.object
    bpy.data.objects.remove(bed)
    done("Delete")
    assert whole(copy)


def test_a_bed_of_an_older_file_stays_as_it_is_and_is_one_all_the_same(tmp_path: Path) -> None:
    older(added())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "older.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "older.blend"))
    looked()
    (bed,) = beds()
    assert len(bpy.context.scene.objects) == 4
    assert housings() == 1
    bed.hide_set(True)
    done("Hide")
    assert not [thing for thing in bpy.context.scene.objects if thing.visible_get()]
    bed.hide_set(False)
    done("Show")
    select(bed)
    done("Select")
    bpy.ops.object.duplicate()
    done("Duplicate")
    copy = bpy.context.object
    assert len(bpy.context.scene.objects) == 7
    assert housings() == 2
    assert not view.shows_force(copy)
    select(bed)
    bpy.ops.object.delete()
    done("Delete")
    assert whole(copy)


def test_a_bed_appended_from_an_older_file_is_made_whole_and_its_helpers_put_away(tmp_path: Path) -> None:
    bed = added()
    older(bed)
    name = bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "older.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    looked()
    done("Empty")
    bpy.ops.wm.append(directory=str(tmp_path / "older.blend" / "Object") + "/", filename=name)
    assert len(bpy.context.scene.objects) == 1 + 27
    done("Append")
    assert whole(*beds())
    assert housings() == 1
    undone()
    assert len(bpy.context.scene.objects) == 0
