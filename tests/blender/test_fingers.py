"""Further fingertips of a bed, and hands: added, moved, copied, deleted, undone, appended as the first is."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.cli import main
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.finished_run import read_run
from digiclay.device import view
from digiclay.recorded import takes
from digiclay.roles import BALL, PALM, ROLE, ellipsoid, fingertips_of, is_linked
from digiclay.settings import own_presets, properties

from tests.assemble import assert_near
from tests.blender.at_hand import (
    added,
    beds,
    delete,
    done,
    duplicate,
    fetch,
    looked,
    redone,
    select,
    undone,
)

pytestmark = pytest.mark.usefixtures("watched")


def with_finger():
    """Add a bed with two fingertips."""
    bed = added()
    assert bpy.ops.digiclay.add_fingertip() == {"FINISHED"}
    done("Add Fingertip")
    return bed


def with_hand(side="RIGHT"):
    """Add a bed with a hand beside its fingertip; the palm is active."""
    bed = added()
    assert bpy.ops.digiclay.add_hand(side=side) == {"FINISHED"}
    done("Add Hand")
    return bed


def palms():
    """Return the palms that stand in a collection."""
    return [thing for thing in bpy.data.objects if thing.get(ROLE) == PALM and is_linked(thing)]


def sound(bed, *numbers):
    """Tell whether a bed has fingertips of these numbers, each with an ellipsoid of its own that stands."""
    tips = fingertips_of(bed)
    balls = {ellipsoid(tip) for tip in tips.values()}
    scene = set(bpy.context.scene.objects)
    whole = len(balls) == len(tips) and None not in balls and {*tips.values(), *balls} <= scene
    return (
        whole and tuple(tips) == numbers and len(properties.read_scene(bed).fingers) == len(numbers)
    )


def test_fingertips_are_apart_above_the_pins_and_sized_each_for_itself():
    bed = with_finger()
    view.show_arrows(bed, True)
    bpy.ops.digiclay.add_hand()
    done("Add Hand")
    assert sound(bed, *range(1, 8))
    for ball in map(ellipsoid, fingertips_of(bed).values()):
        assert ball.material_slots[0].material[ROLE].endswith("_clear")
    poses = bridge.poses(bed)
    away = np.linalg.norm(poses[:, None, :2] - poses[:, :2], axis=-1)[~np.eye(7, dtype=bool)]
    assert away.min() >= 18e-3 - 1e-6  # Blender's 32 bits
    assert poses[:, 2].min() > bridge.read_cells(bed.data)["height"].max()
    before, second = properties.read_scene(bed), fingertips_of(bed)[2]
    second.digiclay.fingertip.width *= 1.5
    looked()
    after = properties.read_scene(bed)
    assert after.fingers[1].fingertip.width == pytest.approx(
        1.5 * before.fingers[0].fingertip.width
    )
    assert [one for number, one in enumerate(after.fingers) if number != 1] == [
        before.fingers[0]
    ] * 6
    assert (after.blister, bridge.finger_of(second)) == (before.blister, after.fingers[1].fingertip)
    bed.digiclay.fingertip.whole_width *= 0.5  # the first one's, which the blister follows
    last = properties.read_scene(bed)
    assert last.fingers[1:] == after.fingers[1:]
    assert last.fingers[0] != after.fingers[0]
    assert last.blister != after.blister


def test_a_left_hand_is_the_image_of_a_right_one_and_stands_so_on_a_bed_that_is_turned_and_scaled():
    hands = {}
    for side in ("RIGHT", "LEFT"):
        bed = with_hand(side)
        poses = bridge.poses(bed)[1:]
        headings = 2.0 * np.arctan2(poses[:, 6], poses[:, 3])
        middle = np.array(palms()[-1].location)[:2] / bridge.SCALE
        hands[side] = np.column_stack([poses[:, :2] - middle, np.cos(headings), np.sin(headings)])
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
        done("Empty")
    # 32 bits of a few tenths of a Blender unit.
    assert_near(hands["LEFT"], hands["RIGHT"] * [-1.0, 1.0, -1.0, 1.0], 1e-6)
    assert (hands["RIGHT"][:, 3] > 0.0).all()  # all of them point away from the wrist
    bed = added()
    bed.location, bed.rotation_euler, bed.scale = (
        (3.0, -2.0, 1.0),
        (0.2, -0.4, 0.9),
        (2.5, 2.5, 2.5),
    )
    looked()
    bpy.ops.digiclay.add_hand()
    done("Add Hand")
    poses, palm = bridge.poses(bed)[1:], palms()[0]
    assert_near(
        poses[:, :2] - np.array(palm.location)[:2] / bridge.SCALE, hands["RIGHT"][:, :2], 2e-6
    )
    wanted = bridge.poses(bed) + np.array([0.01, 0.02, 0.003, 0.0, 0.0, 0.0, 0.0])
    bridge.move_fingertips(
        bed, wanted, [bridge.finger_of(tip) for tip in fingertips_of(bed).values()]
    )
    looked()
    assert_near(bridge.poses(bed), wanted, 2e-6)


def test_two_hands_have_no_fingertip_between_those_of_the_other_one():
    bed = with_hand()
    select(bed)
    bpy.ops.digiclay.add_hand(side="LEFT")
    done("Add Hand")
    one, two = bridge.poses(bed)[1:6, :2], bridge.poses(bed)[6:, :2]
    apart = np.maximum(one.min(axis=0) - two.max(axis=0), two.min(axis=0) - one.max(axis=0))
    assert apart.max() > 18e-3 - 1e-6  # Blender's 32 bits


def test_a_fingertip_whose_own_size_is_set_stays_where_its_lowest_point_is():
    bed = with_hand()
    palms()[0].rotation_euler = (0.2, 0.1, 0.7)
    looked()
    before = bridge.poses(bed)
    fingertips_of(bed)[4].digiclay.fingertip.whole_height *= 1.7
    looked()
    assert_near(bridge.poses(bed), before, 1e-6)  # Blender's 32 bits


@pytest.mark.parametrize("hand", [False, True], ids=["of the bed", "of a hand"])
def test_a_copy_of_a_fingertip_is_a_further_one_with_the_size_of_the_one_copied(hand):
    bed = with_hand() if hand else added()
    last = len(fingertips_of(bed))
    if hand:
        fingertips_of(bed)[last].digiclay.fingertip.length = 7.0
    bed.digiclay.fingertip.width = 6.0
    select(fingertips_of(bed)[last])
    bpy.ops.object.duplicate()
    bpy.context.object.location.x += 0.3
    done("Duplicate")
    assert sound(bed, *range(1, last + 2))
    tips = fingertips_of(bed)
    assert tips[last].parent == tips[last + 1].parent
    assert tips[last + 1].name == f"Digital Clay Fingertip {last + 1}"
    fingers = properties.read_scene(bed).fingers
    assert fingers[-1] == fingers[-2]
    undone()
    assert sound(beds()[0], *range(1, last + 1))
    redone()
    assert sound(beds()[0], *range(1, last + 2))


def test_the_size_of_the_press_tool_is_that_of_the_first_fingertip_left_and_the_blister_follows_it():
    bpy.ops.mesh.digital_clay_add(rows=21, columns=21)
    bed = bpy.context.object
    done("Add")
    bpy.ops.digiclay.add_fingertip()
    fingertips_of(bed)[2].digiclay.fingertip.whole_width = 10.0
    radius = bed.digiclay.blister.radius
    assert bed.digiclay.size == pytest.approx(16.0)
    bpy.data.objects.remove(fingertips_of(bed)[1])
    done("Delete")
    assert bed.digiclay.size == pytest.approx(10.0)
    bed.digiclay.size = 12.0
    (finger,) = properties.read_scene(bed).fingers
    assert (
        finger.fingertip.width
        == pytest.approx(6e-3)
        == bridge.finger_of(fingertips_of(bed)[2]).width
    )
    assert bed.digiclay.blister.radius == pytest.approx(1.2 * radius)
    assert bed.digiclay.fingertip.width == pytest.approx(8.0)


def test_a_deleted_fingertip_leaves_its_number_to_the_next_one_and_comes_back_with_undo():
    bed = with_finger()
    bpy.ops.digiclay.add_fingertip()
    done("Add Fingertip")
    delete(fingertips_of(bed)[2])
    assert sound(bed, 1, 3)
    undone()
    assert sound(beds()[0], 1, 2, 3)
    redone()
    (bed,) = beds()
    assert sound(bed, 1, 3)
    select(bed)
    bpy.ops.digiclay.add_fingertip()
    done("Add Fingertip")
    assert sound(bed, 1, 2, 3)
    delete(*fingertips_of(bed).values())
    assert fingertips_of(bed) == {}


@pytest.mark.parametrize("where", ["bed", "palm"])
def test_a_hand_moves_is_hidden_and_is_deleted_with_its_palm(where):
    bed = with_hand()
    palm, before = palms()[0], bridge.poses(bed)
    palm.location.x += 0.1
    looked()
    moved = bridge.poses(bed) - before
    assert_near(moved[:, 0], [0.0] + [0.01] * 5, 1e-6)  # Blender's 32 bits
    whole = bed if where == "bed" else palm
    whole.hide_set(True)
    done("Hide")
    hidden = [tip.hide_get() for tip in fingertips_of(bed).values()]
    assert hidden == [where == "bed"] + [True] * 5
    whole.hide_set(False)
    done("Show")
    assert not any(tip.hide_get() for tip in fingertips_of(bed).values())
    delete(whole)
    assert palms() == []
    if where == "bed":
        assert len(bpy.context.scene.objects) == 0
    else:
        assert sound(bed, 1)
        assert len(bpy.context.scene.objects) == 3
    undone()
    (bed,) = beds()
    assert sound(bed, *range(1, 7))
    assert [tip.parent for tip in fingertips_of(bed).values()] == [bed] + palms() * 5
    redone()
    assert palms() == []


COPIES = {
    "the bed": lambda bed: select(bed),
    "the bed and its palm": lambda bed: select(palms()[0], bed),
    "the bed and one fingertip": lambda bed: select(fingertips_of(bed)[3], bed),
    "all": lambda bed: (
        bpy.ops.object.select_all(action="SELECT"),
        select(*bpy.context.selected_objects, bed),
    ),
}


@pytest.mark.parametrize("what", COPIES)
def test_a_copy_of_a_bed_has_a_hand_of_its_own(what):
    bed = with_hand()
    fingertips_of(bed)[5].digiclay.fingertip.length = 7.0
    before, scene = bridge.poses(bed), properties.read_scene(bed)
    COPIES[what](bed)
    bpy.ops.object.duplicate()
    done("Duplicate")
    copy = next(one for one in beds() if one != bed)
    assert sound(bed, *range(1, 7))
    assert sound(copy, *range(1, 7))
    assert sorted(palm.parent.name for palm in palms()) == sorted([bed.name, copy.name])
    assert len(bpy.context.scene.objects) == 2 * (1 + 2 * 6 + 1)
    for each in (bed, copy):
        assert_near(bridge.poses(each), before, 1e-6)  # Blender's 32 bits
        assert properties.read_scene(each).fingers == scene.fingers
    undone()
    assert len(beds()) == 1
    assert sound(beds()[0], *range(1, 7))


def test_a_copy_of_a_palm_alone_is_another_hand():
    bed = with_hand()
    select(palms()[0])
    bpy.ops.object.duplicate()
    bpy.context.object.location.y += 0.5
    done("Duplicate")
    assert sound(bed, *range(1, 12))
    assert len(palms()) == 2
    poses = bridge.poses(bed)
    assert_near(poses[6:, :3] - poses[1:6, :3], [[0.0, 0.05, 0.0]] * 5, 1e-6)


# In a scene in millimeters, beside its origin, matrices have 0.1 µm of the device, as they have near it.
@pytest.mark.parametrize("scale, place", [(1.0, (0.0, 0.0, 0.0)), (100.0, (900.0, -800.0, 300.0))])
def test_poses_are_given_to_a_hand_by_its_palm_where_it_moves_as_one_and_else_by_its_fingertips(
    scale, place
):
    bed = with_hand()
    bed.scale, bed.location, bed.rotation_euler = (scale,) * 3, place, (0.3, -0.2, 1.0)
    looked()
    palm, wanted = palms()[0], bridge.poses(bed)
    own = [tuple(tip.location) for tip in palm.children]
    fingers = [bridge.finger_of(tip) for tip in fingertips_of(bed).values()]
    wanted[1:, :3] += [0.01, -0.02, 0.003]
    bridge.move_fingertips(bed, wanted, fingers)
    looked()
    assert_near(bridge.poses(bed), wanted, 1e-6)  # Blender's 32 bits
    assert_near([tuple(tip.location) for tip in palm.children], own, 1e-5)
    stood = tuple(palm.location)
    wanted[1, 2] += 0.002
    bridge.move_fingertips(bed, wanted, fingers)
    looked()
    assert_near(bridge.poses(bed), wanted, 1e-6)
    assert_near(palm.location, stood, 1e-5)
    wanted[2, 1] += 0.002  # of one alone, as a press stroke moves the first one
    bridge.move_fingertips(bed, wanted[:3], fingers)
    looked()
    assert_near(bridge.poses(bed), wanted, 1e-6)


def test_a_bed_has_at_most_32_fingertips():
    bed = added()
    for _ in range(6):
        bpy.ops.digiclay.add_hand(side="LEFT")
    bpy.ops.digiclay.add_fingertip()
    done("Add")
    assert sound(bed, *range(1, 33))
    places = bridge.poses(bed)[:, :2]
    away = np.linalg.norm(places[:, None] - places, axis=-1)[~np.eye(32, dtype=bool)]
    assert away.min() >= 18e-3 - 1e-6  # Blender's 32 bits
    other = added()
    objects = len(bpy.data.objects)
    other.scale = (1.0, 2.0, 1.0)
    for one, rule in (
        (bed, r"A bed has at most 32 fingertips \(got 3[37]\)\."),
        (other, "The scale of .* y and z"),
    ):
        select(one)
        for add in (bpy.ops.digiclay.add_fingertip, bpy.ops.digiclay.add_hand):
            with pytest.raises(RuntimeError, match=rf"^(Error:|\S* \S*\.poll\(\)) {rule}"):
                add()
    assert len(bpy.data.objects) == objects
    duplicate(fingertips_of(bed)[7])  # it stays what it looks like, and touches nothing
    assert tuple(fingertips_of(bed)) == tuple(range(1, 33))


@pytest.mark.parametrize("how", ["append", "link"])
def test_a_bed_of_another_file_comes_with_its_hand(tmp_path, how):
    bed = with_hand()
    before, name = bridge.poses(bed), bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bed.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    looked()
    fetch(tmp_path / "bed.blend", name, how)
    done("Append")
    (bed,) = beds()
    assert sound(bed, *range(1, 7))
    assert_near(bridge.poses(bed), before, 1e-6)  # Blender's 32 bits
    assert len(bpy.context.scene.objects) == 1 + 2 * 6 + 1


def test_a_copy_of_a_fingertip_that_a_loaded_file_has_stays_one_to_look_at(tmp_path):
    bed = added()
    (tip,) = fingertips_of(bed).values()
    stray = tip.copy()
    stray[BALL] = None
    bpy.context.collection.objects.link(stray)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bed.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "bed.blend"))
    done("Open")
    bpy.ops.object.empty_add()
    done("Add")
    assert tuple(fingertips_of(beds()[0])) == (1,)


TWO = """\
layout = {rows = 13, columns = 13}
[[finger]]
fingertip.width = 6e-3
trajectory = {waypoints = [
  {time = 0.0, position = [-8e-3, 0.0, 45e-3]}, {time = 0.2, position = [-8e-3, 0.0, 38e-3]},
]}
[[finger]]
contact.stiffness = 300.0
trajectory = {waypoints = [
  {time = 0.0, position = [8e-3, 2e-3, 47e-3]}, {time = 0.2, position = [8e-3, 2e-3, 38e-3]},
]}
"""


def test_a_scene_of_several_fingers_opens_with_them_and_a_preset_of_it_has_the_first_one(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO, encoding="utf-8")
    assert bpy.ops.digiclay.open_scene(filepath=str(path)) == {"FINISHED"}
    done("Open")
    (bed,) = beds()
    assert sound(bed, 1, 2)
    scene, made = load(path), properties.read_scene(bed)
    parts = [
        [(one.fingertip, one.contact, one.relaxation) for one in each.fingers]
        for each in (scene, made)
    ]
    assert parts[0] == parts[1]
    # 32 bits of a few tenths of a Blender unit.
    start = [[-8e-3, 0.0, 45e-3], [8e-3, 2e-3, 47e-3]]
    assert_near(bridge.poses(bed)[:, :3], start, 1e-7)
    assert [bridge.finger_of(tip) for tip in fingertips_of(bed).values()] == [
        one for one, *_ in parts[0]
    ]
    assert takes.read(bed).poses.shape[1:] == (2, 7)
    bed.digiclay.layout.arrangement = (
        "hexagonal"  # each finger's law has the share that goes with it
    )
    shares = [one.contact.share for one in properties.read_scene(bed).fingers]
    assert (
        shares == [resolve({"layout": {"arrangement": "hexagonal"}}).fingers[0].contact.share] * 2
    )
    assert shares[0] != scene.fingers[0].contact.share
    bpy.ops.digiclay.preset_save(name="two")
    try:
        assert load(own_presets.path("two")).fingers[0].fingertip == parts[0][0][0]
        assert bpy.ops.mesh.digital_clay_add(preset="two", rows=5, columns=5) == {"FINISHED"}
        assert tuple(fingertips_of(bpy.context.object)) == (1,)
    finally:
        own_presets.remove("two")


def test_a_run_of_several_fingers_is_imported_with_them(tmp_path):
    (tmp_path / "two.toml").write_text(TWO, encoding="utf-8")
    assert main(["run", str(tmp_path / "two.toml"), "--out", str(tmp_path / "run"), "--quiet"]) == 0
    run = read_run(tmp_path / "run", "fingertip")
    path = str(tmp_path / "run" / "history.npz")
    assert bpy.ops.import_scene.digital_clay_run(filepath=path, row=-1) == {"FINISHED"}
    bpy.context.view_layer.update()
    bed = bpy.context.object
    assert_near(bridge.poses(bed), run.history["fingertip"][-1], 1e-6)
    assert len(properties.read_scene(bed).fingers) == 2
