"""Mesh objects press the bed: live, moved or deformed by whatever, undone, kept, baked and replayed."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.compat import curves
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import COLORS
from digiclay.core.engine.bodies import PlacedMesh
from digiclay.core.session.take import from_bytes, to_bytes
from digiclay.device import view
from digiclay.live import handlers, tick
from digiclay.overlay import views
from digiclay.recorded import takes
from digiclay.recorded.bake import is_baked
from digiclay.roles import PRESSES, bed_of, list_pressers
from digiclay.sessions import running, sculpting
from digiclay.strokes.stroke import make_images, start

from tests.assemble import assert_near, replayed
from tests.blender.at_hand import delete, done, looked, save_and_open, select
from tests.blender.session.balls import ABOVE, place, press, sphere
from tests.blender.session.live import exact, goes_on, only_bed, shown, started, waits
from tests.hand import let_go


def test_a_ball_leaves_its_shape_and_is_told_by_force_and_pins(bed, ball, clock):
    assert bed_of(bpy.context) == bed
    assert bed.digiclay.method == "plastic"
    started(bed)
    assert press(ball, clock, lift=False) == []
    session = running.find(bed)
    told = views.read_session(bed, session, COLORS)
    pressed = sphere(bed) < 39.9e-3
    forces = session.state.finger_forces()
    assert (told.pressed, told.hardest) == (np.count_nonzero(pressed), None)
    assert (forces[0], told.force[-1]) == (0.0, pytest.approx(forces[1], rel=1e-9))
    assert forces[1] > 0.2
    assert press(ball, clock) == []
    assert np.count_nonzero(running.find(bed).state.row(session.system.rows.force)) == 0
    # The spring of the contact gives 0.05 mm under the 0.02 N of a pin.
    assert np.abs(exact(bed) - sphere(bed)).max() < 0.1e-3
    assert_near(shown(bed), exact(bed), 1e-8)  # Blender's 32 bits
    clock.until(lambda: running.find(bed).errors)
    assert 0.0 < running.find(bed).errors.height < 0.1e-3


def keyed(ball, bed, clock):
    for frame, z in ((1, ABOVE), (10, 36e-3)):
        place(ball, z)
        ball.keyframe_insert("location", frame=frame)
    for frame in range(1, 12):
        bpy.context.scene.frame_set(frame)
        clock.tick()


def parented(ball, bed, clock):
    bpy.ops.object.empty_add(location=(0.3, 0.1, 0.2), rotation=(0.3, 0.2, 0.1))
    empty, where = bpy.context.object, ball.matrix_world.copy()
    ball.parent = empty
    looked()
    ball.matrix_world = where
    for _ in range(9):
        empty.location.z -= 1e-3 * bridge.SCALE
        clock.tick()


def deformed(ball, bed, clock):
    key = [ball.shape_key_add(name=name) for name in ("Basis", "Down")][1]
    for point in key.data:
        point.co.z -= 9e-3 * bridge.SCALE
    for value in np.linspace(0.0, 1.0, 10):
        key.value = value
        clock.tick()


def skinned(ball, bed, clock):
    bpy.ops.object.armature_add(location=ball.location)
    armature = bpy.context.object
    ball.vertex_groups.new(name="Bone").add(range(len(ball.data.vertices)), 1.0, "REPLACE")
    ball.modifiers.new("Armature", "ARMATURE").object = armature
    bone = armature.pose.bones["Bone"]
    for _ in range(9):
        bone.location.y -= 1e-3 * bridge.SCALE  # along the bone, which points up
        clock.tick()


@pytest.mark.parametrize("way", [keyed, parented, deformed, skinned], ids=lambda way: way.__name__)
def test_whatever_moves_a_mesh_it_presses(bed, ball, clock, way):
    looked()
    started(bed)
    clock.tick()
    way(ball, bed, clock)
    clock.tick(3)
    assert np.abs(exact(bed) - sphere(bed)).max() < 0.1e-3


def test_undo_copies_deletion_and_saving_leave_a_session_and_its_pressers_in_order(
    bed, ball, clock, tmp_path
):
    started(bed)
    clock.tick()
    done("Start")
    assert press(ball, clock) == []
    done("Press")
    formed = exact(bed)
    assert len(running.find(bed).gestures) == 1
    select(ball)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    looked()
    assert clock.tick() == []
    assert list_pressers(bed) == [ball, copy]
    assert len(running.find(bed).scene.bodies) == 2
    place(copy, 37e-3, x=9e-3)
    clock.tick(6)
    both = exact(bed)
    assert (both - formed).min() < -2e-3
    delete(copy)
    assert clock.tick() == []
    assert len(running.find(bed).scene.bodies) == 1
    assert np.abs(exact(bed) - both).max() < 0.2e-3  # the commands under way are carried out
    bpy.ops.ed.undo()
    looked()
    clock.tick(handlers.STALE)
    np.testing.assert_array_equal(exact(only_bed()), formed)
    tick.stop(only_bed().session_uid)
    save_and_open(tmp_path / "pressed.blend")
    bed = only_bed()
    assert [presser.name for presser in list_pressers(bed)] == ["Ball"]
    np.testing.assert_array_equal(exact(bed), formed)
    started(bed)
    assert press(bpy.data.objects["Ball"], clock, depth=6e-3) == []
    # A faster press meets more force: 0.2 mm of indentation.
    assert np.abs(exact(bed) - sphere(bed, 6e-3)).max() < 0.25e-3


def exclude(ball, excluded):
    """Put a ball into a collection of its own that the view layer leaves out, or not."""
    if "Out" not in bpy.data.collections:
        bpy.context.scene.collection.children.link(bpy.data.collections.new("Out"))
        bpy.data.collections["Out"].objects.link(ball)
        bpy.context.collection.objects.unlink(ball)
    bpy.context.view_layer.layer_collection.children["Out"].exclude = excluded


ODD = {
    "is being edited": (
        lambda ball: bpy.ops.object.mode_set(mode="EDIT"),
        lambda ball: bpy.ops.object.mode_set(mode="OBJECT"),
    ),
    "is hidden: show": (lambda ball: exclude(ball, True), lambda ball: exclude(ball, False)),
    "is hidden": (lambda ball: ball.hide_set(True), lambda ball: ball.hide_set(False)),
    "must have from 1 to 1,000,000 triangles to press the pins (got 0)": (
        lambda ball: setattr(ball, "data", bpy.data.meshes.new("None")),
        lambda ball: setattr(ball, "data", bpy.data.meshes["Icosphere"]),
    ),
    "that are finite": (
        lambda ball: setattr(ball.data.vertices[7], "co", (np.nan, 0.0, 0.0)),
        lambda ball: setattr(ball.data.vertices[7], "co", (0.0, 0.0, 0.0)),
    ),
    "Ball.mesh must have a thickness (got a flat mesh)": (
        lambda ball: setattr(ball.scale, "z", 0.0),
        lambda ball: setattr(ball.scale, "z", 1.0),
    ),
    "Ball.samples must be odd (got 4)": (
        lambda ball: setattr(ball.digiclay.presser, "samples", 4),
        lambda ball: setattr(ball.digiclay.presser, "samples", 3),
    ),
    "follows a fingertip": (
        lambda ball: setattr(ball[PRESSES].digiclay, "method", "virtual_master"),
        lambda ball: setattr(ball[PRESSES].digiclay, "method", "elastic"),
    ),
}


@pytest.mark.parametrize("what", ODD)
def test_with_an_odd_presser_the_session_waits_and_says_why(bed, ball, clock, what):
    spoil, mend = ODD[what]
    started(bed)
    press(ball, clock)
    before = exact(bed)
    spoil(ball)
    looked()
    waits(bed, clock, words=what)
    mend(ball)
    looked()
    np.testing.assert_array_equal(exact(bed) if "follows" not in what else before, before)
    goes_on(clock)


def swell(ball, clock):
    """Press a ball that is deformed on its way."""
    key = [ball.shape_key_add(name=name) for name in ("Basis", "Wide")][1]
    key.value = 0.0  # Blender 5.2 begins with 1
    for point in key.data:
        point.co *= 1.1
    looked()
    press(ball, clock, lift=False)
    key.value = 1.0
    clock.tick(3)


PRESSED = {
    "lifted": (lambda ball, clock: press(ball, clock), True),
    "held": (lambda ball, clock: press(ball, clock, lift=False), True),
    "deformed": (swell, False),
}


@pytest.mark.parametrize("how", PRESSED)
def test_a_take_of_a_mesh_is_replayed_to_the_bit_and_baked(bed, ball, clock, how):
    started(bed)
    clock.tick()
    running.put(sculpting.set_recording(running.find(bed), True))
    move, rigid = PRESSED[how]
    move(ball, clock)
    place(ball, ABOVE, x=5e-3)
    clock.tick(2)
    session = running.find(bed)
    take = takes.read_recording(session)
    entry = takes.add(bed, take, session=session)
    read = takes.read(bed)
    assert read.scene.bodies == take.scene.bodies
    # Of one that deforms the take has the undersides from then on.
    placed = [isinstance(bodies[0], PlacedMesh) for _, bodies in read.knots]
    assert placed[0]
    assert all(placed) == rigid
    tick.stop(bed.session_uid)
    looked()
    formed = exact(bed)
    select(bed)
    bpy.ops.digiclay.session_reset()
    assert bpy.ops.digiclay.take_replay() == {"FINISHED"}
    np.testing.assert_array_equal(exact(bed), formed)
    assert replayed(read)
    assert bpy.ops.digiclay.bake(source="TAKE", take=entry.number) == {"FINISHED"}
    bpy.context.scene.frame_set(200)
    # The last frame shows a period before the end, in which pins still move.
    assert_near(drawn(bed), formed, 1e-5)


def drawn(bed):
    """Return the pin tops that Blender draws of a bake, m."""
    next(one for one in bed.modifiers if one.name == view.MODIFIER).show_viewport = False
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    return bridge.read_cells(bed.evaluated_get(graph).data)["height"]


def test_an_animated_mesh_is_baked_with_subframes(bed, ball):
    for frame, x in (
        (1, -30e-3),
        (4, 30e-3),
    ):  # 20 mm per frame: it is nowhere in between but on the way
        place(ball, 36e-3, x=x)
        ball.keyframe_insert("location", frame=frame)
    for curve in curves(ball):
        for line in curve:
            for key in line.keyframe_points:
                key.interpolation = "LINEAR"
    select(bed)
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=6) == {"FINISHED"}
    bpy.context.scene.frame_set(6)
    formed = drawn(bed)
    middle = np.abs(bridge.read_cells(bed.data)["position"][:, 1]) < 1e-3
    # Valves let pins down by 1.7 mm or so while it is over them, all alike.
    assert formed[middle].max() < 38.5e-3


def test_a_bake_refuses_a_hidden_mesh_and_keeps_the_frame(bed, ball):
    ball.hide_set(True)
    select(bed)
    bpy.context.scene.frame_set(3)
    with pytest.raises(RuntimeError, match="Ball is hidden: show it"):
        bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=6)
    assert (bpy.context.scene.frame_current, is_baked(bed)) == (3, False)


def test_a_mesh_must_begin_above_the_floor_and_may_go_below_it(bed, ball, clock):
    place(ball, -1e-3)
    looked()
    fault = r"Ball must begin above the floor of the bed \(got -1 mm\): lift it"
    with pytest.raises(DigiclayError, match=fault):
        tick.start(bpy.context, bed)
    select(bed)
    with pytest.raises(RuntimeError, match=fault):
        bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=6)
    place(ball, ABOVE)
    looked()
    started(bed)
    clock.tick(2)
    press(ball, clock, depth=41e-3, lift=False)
    assert not running.find(bed).blocking_reason
    assert exact(bed).min() < 39e-3
    running.put(sculpting.rewind(running.find(bed)))
    waits(bed, clock, words="Ball must begin above the floor")
    place(ball, ABOVE)
    goes_on(clock)


def test_a_mesh_presses_on_when_the_fingertip_is_left_out(bed, ball, clock):
    bed.digiclay.use_relaxation = False
    started(bed)
    clock.tick(2)
    bed.digiclay.use_fingertip = False
    (note,) = clock.tick()
    assert "heights and locks were kept" in note.message
    assert press(ball, clock) == []
    # A pulp that does not relax is deeper in the pins: 0.15 mm.
    assert np.abs(exact(bed) - sphere(bed)).max() < 0.2e-3


@pytest.mark.usefixtures("machine")
def test_strokes_and_their_images_are_formed_beside_a_mesh_and_kept_in_a_take(bed, ball, clock):
    started(bed)
    press(ball, clock, lift=False)
    pressed = sphere(bed) < 39.9e-3
    running.put(sculpting.set_recording(running.find(bed), True))
    stroke = start(0, 14e-3, 8e-3, 3e-3, make_images("RADIAL", 2))
    session, number = sculpting.queue_stroke(running.find(bed), stroke)
    running.put(session)
    clock.until(lambda: (running.find(bed).state.finger_forces() > 0.01).sum() == 3)
    assert len(running.find(bed).state.finger_forces()) == 3
    running.put(let_go(running.find(bed), number))
    clock.until(lambda: not running.find(bed).strokes)
    session = running.find(bed)
    formed = session.state.row(0)
    assert len(session.state.finger_forces()) == 2
    assert np.abs(formed - sphere(bed))[pressed].max() < 0.1e-3
    assert np.count_nonzero(formed[~pressed] < 39e-3) > 6
    take = takes.read_recording(session)
    assert replayed(take)


def test_recorded_strokes_are_played_on_a_bed_that_a_mesh_presses(bed, ball, tmp_path):
    path = tmp_path / "strokes.toml"
    path.write_text("[[stroke]]\ndepth = 0.003\nmoves = [[0, 0.014, 0.008], [0.1, 0.014, 0]]\n")
    select(bed)
    assert bpy.ops.digiclay.play_strokes(filepath=str(path)) == {"FINISHED"}
    assert exact(bed).min() < 38.5e-3


def test_a_shape_comes_up_beside_a_mesh_which_then_presses_it(bed, ball, clock):
    select(bed)
    place(ball, 56e-3)
    assert bpy.ops.digiclay.shape_sample(sample="dome") == {"FINISHED"}
    raised = shown(bed)
    assert raised.max() > 54e-3
    started(bed)
    clock.tick(3)
    assert_near(exact(bed), raised, 1e-5)  # within the dead band
    place(ball, 53e-3)
    clock.tick(6)
    assert (raised - exact(bed)).max() > 1e-3


@pytest.mark.parametrize("back", [sculpting.rewind, None], ids=["a gesture", "undo"])
def test_what_is_taken_back_while_a_mesh_presses_leaves_no_dent(bed, ball, clock, back):
    started(bed)
    clock.tick(3)
    done("Start")
    before = exact(bed)
    press(ball, clock, lift=False)
    done("Pressed")
    if back:  # which leaves the mesh where it is
        place(ball, ABOVE)
        running.put(back(running.find(bed)))
    else:
        bpy.ops.ed.undo()
        looked()
    clock.tick(handlers.STALE + 3)
    np.testing.assert_array_equal(exact(only_bed()), before)


@pytest.mark.parametrize("back", ["a gesture", "undo"])
def test_what_is_taken_back_while_a_mesh_is_recorded_is_in_no_take(bed, ball, clock, back):
    started(bed)
    clock.tick(3)
    running.put(sculpting.set_recording(running.find(bed), True))
    press(ball, clock)
    done("Pressed")
    first = exact(bed)
    press(ball, clock, depth=6e-3, lift=False)
    if back == "undo":
        done("Deeper")
        bpy.ops.ed.undo()
        looked()
        clock.tick(handlers.STALE - 1)
        bed, ball = only_bed(), bpy.data.objects["Ball"]
    else:
        running.put(sculpting.rewind(running.find(bed)))
    place(ball, 38e-3, x=6e-3)
    clock.tick(3)
    assert (exact(bed) - first).min() < -1e-3
    take = from_bytes(to_bytes(takes.read_recording(running.find(bed))))
    assert replayed(take)
