"""Sessions with several fingertips, which come and go meanwhile: the session goes on with the others."""

import bpy
import numpy as np
import pytest
from digiclay import bridge, roles
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import COLORS
from digiclay.core.scene.scene_source import load
from digiclay.core.session import snapshot
from digiclay.device import part_watch, parts
from digiclay.live import beds, handlers, tick
from digiclay.overlay import views
from digiclay.recorded import takes
from digiclay.roles import fingertips_of
from digiclay.sessions import running, sculpting
from digiclay.settings import properties
from digiclay.strokes.stroke import make_images, start

from tests.assemble import assert_near
from tests.blender.at_hand import looked, push_step, select
from tests.blender.session.live import (
    exact,
    only_bed,
    only_session,
    queue,
    record,
    shown,
    started,
    waits,
)
from tests.hand import let_go

#: Where fingertips press, by number: x and y, mm.
PLACES = {1: (-10.0, -10.0), 2: (10.0, 10.0), 3: (10.0, -10.0)}


@pytest.fixture(autouse=True)
def watched():
    """Look after beds as in a window."""
    yield
    part_watch.unregister()


@pytest.fixture
def pair(bed):
    """A bed with two fingertips above it."""
    part_watch.watch()
    select(bed)
    bpy.ops.digiclay.add_fingertip()
    select(bed)
    move(bed, {1: 46.0, 2: 46.0})
    push_step("Two")
    looked()
    return bed


def move(bed, heights):
    """Put the lowest points of fingertips to heights, mm, each at its place."""
    for number, z in heights.items():
        # The semi-axis upwards is 8 mm: the empty is the ellipsoid's center.
        tip = fingertips_of(bed)[number]
        tip.location = np.array([*PLACES[number], z + 8.0]) * 1e-3 * bridge.SCALE


def press(bed, clock, *numbers, lift=True):
    """Press fingertips 3 mm deep, and lift them; return the messages."""
    notes = []
    down = np.linspace(46.0, 37.0, 8)
    for z in [*down, *[37.0] * 4, *([*down[::-1], *[46.0] * 2] if lift else [37.0] * 4)]:
        move(bed, dict.fromkeys(numbers, z))
        notes += clock.tick()
    return notes


def depth(bed, number):
    """Return how far the pins below the place of a fingertip are pressed, mm."""
    places = bridge.read_cells(bed.data)["position"]
    under = np.linalg.norm(places - 1e-3 * np.array(PLACES[number]), axis=1) < 4e-3
    return float(40.0 - 1e3 * exact(bed)[under].min())


def test_each_fingertip_forms_and_is_recorded_and_told_with_its_own_force(pair, clock):
    started(pair)
    record(pair)
    move(pair, {1: 46.0, 2: 46.0})
    assert press(pair, clock, 2, lift=False) == []
    session = running.find(pair)
    one, two = session.state.finger_forces()
    assert (one, two > 0.01) == (0.0, True)
    assert depth(pair, 2) > 1.0 > 0.01 > depth(pair, 1)
    told = views.read_session(pair, session, COLORS)
    assert [number for number, _ in told.fingers] == [1, 2]
    np.testing.assert_array_equal(told.finger_force[-1], [one, two])
    assert told.force[-1] == pytest.approx(one + two, rel=1e-9)
    take = takes.read_recording(session)
    assert take.poses.shape == (session.state.period + 1, 2, 7)
    np.testing.assert_array_equal(beds.read_poses(pair), session.poses)
    move(pair, {2: 46.0})
    clock.tick(20)
    press(pair, clock, 1, 2)
    assert depth(pair, 1) > 1.0


def test_a_fingertip_that_is_added_in_mid_session_forms_too(pair, clock):
    started(pair)
    record(pair)
    assert press(pair, clock, 1, 2) == []
    before = exact(pair)
    bpy.ops.digiclay.add_fingertip()
    push_step("Add")
    looked()
    notes = clock.tick()
    assert ["kept as Take 1" in note.message for note in notes] == [True]
    session = running.find(pair)
    assert (session.numbers, len(session.poses)) == ((1, 2, 3), 3)
    # What moves still moves on for a tick, nothing else.
    assert np.abs(exact(pair) - before).max() < 1e-5
    assert press(pair, clock, 3) == []
    assert min(depth(pair, number) for number in (1, 2, 3)) > 1.0
    depths = []
    while running.find(pair).gestures:
        bpy.ops.digiclay.session_rewind()
        depths.append([depth(pair, number) for number in (1, 2, 3)])
    # Back to where the third one had not touched, and on to before there was a third one.
    assert any(min(one, two) > 1.0 > 0.1 > three for one, two, three in depths)
    assert max(depths[-1]) < 0.01
    assert clock.tick(3) == []


@pytest.mark.parametrize("how, gone", [("deleted", 1), ("removed", 2)])
def test_the_session_goes_on_with_the_fingertips_that_are_left(pair, clock, gone, how):
    started(pair)
    press(pair, clock, 1, 2, lift=False)
    left = 3 - gone
    force = running.find(pair).state.finger_forces()[left - 1]
    push_step("Pressed")
    pressed = beds.read_snapshot(pair)
    if how == "deleted":
        select(fingertips_of(pair)[gone])
        bpy.ops.object.delete()
    else:
        bpy.data.objects.remove(fingertips_of(pair)[gone])
    push_step("Delete")
    looked()
    assert [note for note in clock.tick(1) if note.level != "INFO"] == []
    session = running.find(pair)
    assert (session.numbers, beds.read_numbers(pair), session.blocking_reason) == (
        (left,),
        (left,),
        "",
    )
    # Its pulp relaxes on, by some percent in a tick: one that begins anew would press 2.6 times as
    # hard.
    assert session.state.finger_forces().tolist() == [pytest.approx(force, rel=0.05)]
    clock.tick(20)
    deep = depth(pair, left)
    assert press(pair, clock, left) == []
    assert depth(pair, left) > deep - 1.0
    bpy.ops.ed.undo()
    looked()
    clock.tick(handlers.STALE)
    bed = only_bed()
    assert tuple(fingertips_of(bed)) == (1, 2)
    session = running.find(bed)
    assert session.numbers == (1, 2)
    assert snapshot.dump(session.system, session.state) == pressed
    assert press(bed, clock, 1, 2) == []


def hang(part, where, bone=""):
    """Parent an object to another one, or to a bone of it; it stays where it is."""
    place = part.matrix_world.copy()
    part.parent, part.parent_type, part.parent_bone = where, "BONE" if bone else "OBJECT", bone
    looked()
    part.matrix_world = place
    looked()


HUNG = (
    "a fingertip on an empty",
    "a fingertip on a bone",
    "a thumb on an empty",
    "a palm on an empty",
    "a palm on nothing",
)


@pytest.mark.parametrize("what", HUNG)
def test_what_hangs_on_something_else_follows_that_and_is_still_the_bed_s(pair, clock, what):
    bpy.ops.digiclay.add_hand()
    palm, own = bpy.context.object, fingertips_of(pair)
    (bpy.ops.object.armature_add if "bone" in what else bpy.ops.object.empty_add)(
        location=(0.1, 0.2, 0.3)
    )
    where = bpy.context.object
    where.rotation_euler, where.scale = (0.3, -0.2, 1.0), (1.5, 1.5, 1.5)
    looked()
    started(pair)
    part = palm if "palm" in what else own[3 if "thumb" in what else 2]
    hang(part, None if "nothing" in what else where, "Bone" if "bone" in what else "")
    select(part)
    assert (clock.tick(2), roles.bed_of(bpy.context), fingertips_of(pair)) == ([], pair, own)
    assert running.find(pair).numbers == tuple(own)
    before = bridge.poses(pair)
    where.location.z += 0.1
    clock.tick()
    follows = ["nothing" not in what and part in (tip, tip.parent) for tip in own.values()]
    wanted = before + np.outer(follows, [0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
    assert_near(bridge.poses(pair), wanted, 2e-6)  # Blender's 32 bits
    wanted = before + np.array([0.01, -0.02, 0.003, 0.0, 0.0, 0.0, 0.0])
    bridge.move_fingertips(pair, wanted, [bridge.finger_of(tip) for tip in own.values()])
    tick.stop(pair.session_uid)
    for thing in (pair, own[2]):
        looked()
        select(thing)
        bpy.ops.object.duplicate()
        looked()
    copy = next(
        thing for thing in bpy.context.scene.objects if roles.is_bed(thing) and thing != pair
    )
    assert len(fingertips_of(pair)) == 8
    for bed in (pair, copy):
        assert_near(bridge.poses(bed)[:7, :3], wanted[:, :3], 2e-6)
    hang(own[2], copy)  # from one bed to another
    assert (len(fingertips_of(pair)), len(fingertips_of(copy))) == (7, 8)


@pytest.mark.parametrize("scale", [(1.5, 1.5, 1.5), (-1.0, 1.0, 1.0), (0.8, -0.8, 0.8)])
def test_a_palm_that_is_scaled_spreads_or_mirrors_its_fingertips_which_keep_their_sizes(
    pair, clock, scale
):
    bpy.ops.digiclay.add_hand()
    started(pair)
    bpy.context.object.scale, before = scale, bridge.poses(pair)[2:, :2]
    assert clock.tick(2) == []
    looked()
    middle = np.array(bpy.context.object.location)[:2] / bridge.SCALE
    wanted = middle + (before - middle) * scale[:2]
    assert_near(bridge.poses(pair)[2:, :2], wanted, 1e-6)  # Blender's 32 bits
    for tip in fingertips_of(pair).values():
        size = np.abs(tip[roles.BALL].matrix_world.to_scale()) / bridge.SCALE
        np.testing.assert_allclose(size, tip[bridge.AXES], rtol=1e-5)


def test_fingertips_keep_their_numbers_where_one_between_is_deleted_or_comes_after_a_take(
    pair, clock, tmp_path
):
    bpy.ops.digiclay.add_fingertip()
    bpy.data.objects.remove(fingertips_of(pair)[2])
    looked()
    started(pair)
    record(pair)
    press(pair, clock, 3)
    tick.stop(pair.session_uid)
    select(pair)
    # A scene file counts from 1 on.
    bpy.ops.digiclay.take_export(filepath=str(tmp_path / "take.toml"))
    assert load(tmp_path / "take.toml").description.endswith(": 1 = 1, 2 = 3")
    third = fingertips_of(pair)[3]
    assert third.name.endswith("Fingertip 3")
    for typed in ("0.1, 0.2", "soft"):
        usual, third.digiclay.relaxation.weights = third.digiclay.relaxation.weights, typed
        with pytest.raises(ParameterError, match=r"^Fingertip 3: Relaxation: Weights must "):
            properties.scene_of(pair)
        third.digiclay.relaxation.weights = usual
    bpy.ops.digiclay.add_fingertip()
    looked()
    before = bridge.poses(pair)
    bpy.ops.digiclay.take_replay()
    assert (tuple(fingertips_of(pair)), beds.read_numbers(pair)) == ((1, 2, 3), (1, 3))
    bpy.ops.digiclay.bake(source="TAKE")
    assert_near(bridge.poses(pair)[1], before[1], 1e-6)
    assert [number for number, tip in fingertips_of(pair).items() if tip.animation_data] == [1, 3]


def test_the_size_and_the_pulp_of_one_fingertip_change_in_mid_session(pair, clock):
    started(pair)
    press(pair, clock, 1, 2)
    formed, own = exact(pair), fingertips_of(pair)[2].digiclay
    own.fingertip.width = 5.0
    own.contact.stiffness *= 2.0
    assert clock.tick() == []
    one, two = running.find(pair).scene.fingers
    assert (one.fingertip.width, two.fingertip.width) == (8e-3, 5e-3)
    assert two.contact.stiffness == pytest.approx(2.0 * one.contact.stiffness)
    assert bridge.finger_of(fingertips_of(pair)[2]) == two.fingertip
    assert np.abs(exact(pair) - formed).max() < 1e-5  # what moves still moves on for a tick


def test_a_session_waits_without_any_fingertip(pair, clock):
    started(pair)
    for tip in fingertips_of(pair).values():
        bpy.data.objects.remove(tip)
    waits(pair, clock, words="fingertip is deleted")


@pytest.mark.usefixtures("machine")
@pytest.mark.parametrize("palm", [False, True])
def test_a_press_stroke_moves_the_first_fingertip_alone(pair, clock, palm):
    hand = parts.make_palm(pair) if palm else pair
    for tip in fingertips_of(pair).values():
        tip.parent = hand
    looked()
    started(pair)
    move(pair, {1: 46.0, 2: 45.0})
    clock.tick(5)
    before = bridge.poses(pair)
    queue(pair, start(0, -10e-3, -10e-3, 4e-3))
    clock.until(lambda: shown(pair).min() < 39e-3)
    now = bridge.poses(pair)
    assert_near(now[1], before[1], 1e-6)  # Blender's 32 bits
    assert np.abs(now[0] - before[0]).max() > 1e-3
    move(pair, {2: 43.0})  # it waits there for the end of the stroke
    clock.tick(2)
    assert bridge.poses(pair)[1, 2] == pytest.approx(43e-3, abs=1e-6)
    assert depth(pair, 1) == depth(pair, 2) == 0.0  # the bed stores no half of it


def keyframe(pair):
    """Have both fingertips pressed down and lifted from frame 1 to 20, one after the other."""
    for number, frames in ((1, (1, 5, 10)), (2, (10, 15, 20))):
        for frame, z in zip(frames, (46.0, 37.0, 46.0), strict=True):
            move(pair, {number: z})
            fingertips_of(pair)[number].keyframe_insert("location", frame=frame)


def test_animated_fingertips_are_baked_and_takes_of_several_replayed_and_exported(
    pair, clock, tmp_path
):
    started(pair)
    record(pair)
    press(pair, clock, 1, 2)
    formed = exact(pair)
    tick.stop(pair.session_uid)
    looked()
    bpy.ops.digiclay.take_replay()
    np.testing.assert_array_equal(exact(pair), formed)
    bpy.ops.digiclay.take_export(filepath=str(tmp_path / "pair.toml"))
    assert len(load(tmp_path / "pair.toml").fingers) == 2
    # That leads it elsewhere now.
    fingertips_of(pair)[2].constraints.new("COPY_LOCATION").target = pair
    assert bpy.ops.digiclay.bake(source="TAKE") == {"FINISHED"}
    take = takes.read(pair)
    bpy.context.scene.frame_set(15)
    row = round(14 / 24 / take.scene.simulation.control_period)
    assert_near(bridge.poses(pair), take.poses[row], 1e-6)  # Blender's 32 bits
    bpy.ops.digiclay.bake_free()
    for tip in fingertips_of(pair).values():
        tip.animation_data_clear()
    keyframe(pair)
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=20) == {"FINISHED"}
    bpy.context.scene.frame_set(20)
    graph = bpy.context.evaluated_depsgraph_get()
    tops = np.array(
        [item.matrix_world.translation.z for item in graph.object_instances if item.is_instance]
    )
    assert tops.size > 0


@pytest.mark.usefixtures("machine")
def test_strokes_end_with_the_fingertip_that_goes_along_them_and_say_so(pair, clock):
    started(pair)
    queue(pair, start(0, 0.0, 0.0, 4e-3))
    clock.tick(2)
    bpy.data.objects.remove(fingertips_of(pair)[1])
    looked()
    assert ["ended unfinished (1)" in note.message for note in clock.tick(3)] == [True]
    assert running.find(pair).numbers == (2,)


ODD = {
    "is scaled to nothing": lambda tip: tip.scale.zero(),
    "has no finite location": lambda tip: setattr(tip, "location", (np.nan, 0.0, 0.0)),
}


@pytest.mark.parametrize("what", ODD)
def test_an_odd_fingertip_has_the_session_wait_and_nothing_is_lost(pair, clock, what):
    started(pair)
    press(pair, clock, 1, 2)
    before = exact(pair)
    ODD[what](fingertips_of(pair)[2])
    waits(pair, clock, words=f"Digital Clay Fingertip 2 {what}")
    np.testing.assert_array_equal(exact(pair), before)
    assert_near(shown(pair), before, 1e-8)


def test_the_state_of_two_is_continued_by_three_and_by_one(pair, clock):
    started(pair)
    press(pair, clock, 1, 2)
    tick.stop(pair.session_uid)
    formed = exact(pair)
    bpy.ops.digiclay.add_fingertip()
    looked()
    started(pair)
    assert running.find(pair).numbers == (1, 2, 3)
    np.testing.assert_array_equal(running.find(pair).state.row(0), formed)
    tick.stop(pair.session_uid)
    for number in (1, 3):
        bpy.data.objects.remove(fingertips_of(pair)[number])
    looked()
    started(pair)
    assert running.find(pair).numbers == (2,)
    np.testing.assert_array_equal(running.find(pair).state.row(0), formed)


@pytest.mark.usefixtures("machine")
def test_a_symmetric_stroke_survives_saving_undo_and_a_stop_in_its_middle(pair, clock, tmp_path):
    started(pair)
    move(pair, {1: 46.0, 2: 46.0})
    clock.tick(3)
    record(pair)
    images = make_images("RADIAL", 2)

    def press_down():
        session, number = sculpting.queue_stroke(
            only_session(), start(0, 14e-3, 8e-3, 3e-3, images)
        )
        running.put(session)
        clock.until(lambda: (only_session().state.finger_forces() > 0.01).sum() == 2)
        return number

    number = press_down()
    session = running.find(pair)
    assert (len(session.poses), beds.read_numbers(pair)) == (3, (1, 2))
    assert [number for number, _ in views.read_session(pair, session, COLORS).fingers] == [1, 2]
    push_step("In its middle")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "middle.blend"), copy=True)
    running.put(let_go(running.find(pair), number))
    clock.until(lambda: not running.find(pair).strokes)
    assert (len(running.find(pair).poses), beds.read_numbers(pair)) == (2, (1, 2))
    assert clock.tick() == []
    table = running.find(pair).state.row(0).reshape(13, 13)
    assert_near(table, np.rot90(table, 2), 2e-6)
    assert table.min() < 37.1e-3
    push_step("Done")
    bpy.ops.ed.undo()
    looked()
    clock.tick(handlers.STALE)
    bed = only_bed()
    session = running.find(bed)
    assert (session.numbers, len(session.poses), session.strokes) == ((1, 2), 2, ())
    assert_near(shown(bed), 40e-3, 1e-6)  # nothing half-formed
    # It goes on from there, and stops in the middle of another one.
    press_down()
    handlers.end("was stopped")
    take = takes.read(bed)
    assert max(take.fingers) == 3
    assert started(bed) is None
    assert (running.find(bed).numbers, len(running.find(bed).poses)) == ((1, 2), 2)
    handlers.end("was stopped")
    bpy.ops.digiclay.take_replay()
    assert beds.read_numbers(bed) == (1, 2)
    bpy.ops.digiclay.bake(source="TAKE")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "middle.blend"))
    looked()
    started(only_bed())
    assert_near(shown(), 40e-3, 1e-6)
