"""Takes: what the buttons of their panel do, what a bake shows, and what undoing them leaves."""

import functools

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.take import Take
from digiclay.device import view
from digiclay.device.instant import Instant
from digiclay.live import beds, tick
from digiclay.overlay.sections import effort_message, error_message
from digiclay.recorded import bake, takes
from digiclay.roles import ROLE, fingertip_of
from digiclay.sessions import running
from numpy.typing import NDArray

from tests.blender.at_hand import evaluate, new_bed, open_bed, save_and_open

#: Time between two ticks, s: a session follows ten control periods in each.
TICK = 0.05


@pytest.fixture
def clay(extension):
    """Return a bed added as a user adds it, active, in a file that plays 40 frames a second."""
    made = new_bed(rows=12, columns=12)
    bpy.context.scene.render.fps = 40
    return made


def press(clay, ticks=12, *, deep=0.008):
    """Let a session live while the finger goes down from 2 mm above the pins."""
    tip = fingertip_of(clay)
    top = bridge.read_cells(clay.data)["height"].max() * bridge.SCALE
    reach = bridge.pose(tip)[2] * bridge.SCALE - tip.location.z
    for count in range(ticks + 1):
        tip.location.z = top - reach + (2e-3 - deep * count / ticks) * bridge.SCALE
        bpy.context.view_layer.update()
        tick.tick(bpy.context, 100.0 + TICK * count)


def find_heights(clay):
    return bridge.read_cells(clay.data)["height"]


def begin_recording(clay):
    tick.start(bpy.context, clay)
    bpy.ops.digiclay.take_record()


def record(clay):
    """Record a press and keep it; return the take's number. The session is stopped."""
    begin_recording(clay)
    press(clay)
    assert bpy.ops.digiclay.take_keep(name="A press") == {"FINISHED"}
    tick.stop(clay.session_uid)
    return takes.list_takes(clay)[-1].number


def test_a_take_states_time_and_error_of_its_session_also_in_another_file(clay, tmp_path):
    begin_recording(clay)
    press(clay)
    session, name = running.find(clay), clay.name
    assert session.errors is not None
    bpy.ops.digiclay.take_keep(name="A press")
    takes.add(clay, takes.read(clay), "Without a session")
    tick.stop(clay.session_uid)
    save_and_open(tmp_path / "kept.blend")
    known, unknown = (one.effort for one in takes.list_takes(bpy.data.objects[name]))
    # 120 periods, as long as one took of late.
    assert known == pytest.approx((120 * session.clock.cost, *session.errors[:2]))
    assert effort_message(known).endswith(error_message(session.errors[:2]))
    assert "not estimated" in effort_message(unknown)
    assert "not estimated yet" in effort_message(known[:1])


def test_a_replay_in_another_state_ends_bit_for_bit_as_the_take_did(clay):
    number = record(clay)
    kept, drawn = beds.read_snapshot(clay), find_heights(clay)
    tick.start(bpy.context, clay)
    press(clay, deep=11e-3)
    tick.stop(clay.session_uid)
    assert beds.read_snapshot(clay) != kept
    assert bpy.ops.digiclay.take_replay(take=number) == {"FINISHED"}
    assert beds.read_snapshot(clay) == kept == takes.read(clay, number).end
    assert np.array_equal(find_heights(clay), drawn)
    tick.start(bpy.context, clay)  # it goes on from there
    assert running.find(clay).state.period == takes.read(clay, number).periods
    tick.stop(clay.session_uid)
    # Finer steps end near, but not at, the same heights: steps of 5 ms leave some µm.
    assert bpy.ops.digiclay.take_replay(take=number, parts=8) == {"FINISHED"}
    assert 0.0 < np.abs(find_heights(clay) - drawn).max() < 20e-6


@pytest.mark.parametrize(
    "layout",
    [{"pitch": 4.0}, {"rows": 9, "columns": 16}, {"arrangement": "staggered"}, {"rows": 11}],
)
def test_a_take_of_another_layout_is_refused_though_it_may_have_as_many_pins(clay, layout):
    number = record(clay)
    for name, value in layout.items():
        setattr(clay.digiclay.layout, name, value)
    assert bpy.ops.digiclay.rebuild() == {"FINISHED"}
    places = bridge.read_cells(clay.data)["position"].tolist()
    for use in (
        bpy.ops.digiclay.take_replay,
        functools.partial(bpy.ops.digiclay.bake, source="TAKE"),
    ):
        with pytest.raises(RuntimeError, match="must have the layout of the bed"):
            use(take=number)
    assert not bake.is_baked(clay)
    assert bridge.read_cells(clay.data)["position"].tolist() == places


def test_a_baked_take_shows_its_end_at_its_last_frame_and_starts_no_session(clay):
    record(clay)
    drawn = find_heights(clay)
    assert bpy.ops.digiclay.bake(source="TAKE", first=10) == {"FINISHED"}
    # 0.6 s at 40 frames a second; float32.
    assert np.abs(shown(clay, 10 + 24) - drawn).max() < 1e-7
    with pytest.raises(Exception, match="free the bake"):
        tick.start(bpy.context, clay)


def test_an_animated_fingertip_bakes_in_the_background_without_a_session(clay):
    tip = fingertip_of(clay)
    for frame, down in ((1, 0.0), (21, 14e-3)):
        tip.location.z -= down * bridge.SCALE
        tip.keyframe_insert("location", frame=frame)
    curves = sum(map(len, bake.curves(tip)))
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=41) == {"FINISHED"}
    assert bake.is_baked(clay)
    assert sum(map(len, bake.curves(tip))) == curves  # its own animation stays
    assert bpy.ops.digiclay.bake_free() == {"FINISHED"}
    assert not bake.is_baked(clay)


def test_an_exported_take_is_a_scene_that_runs_as_long(clay, tmp_path):
    number = record(clay)
    begin_recording(clay)  # meanwhile a session may record
    press(clay, deep=12e-3)
    file = tmp_path / "ein Täke 1.5.toml"
    # What follows the point of a number is no ending.
    assert bpy.ops.digiclay.take_export(filepath=str(file).removesuffix(".toml")) == {"FINISHED"}
    scene = load(file)
    assert scene.name == "A press"
    assert scene.simulation.duration == pytest.approx(0.6)
    assert scene.cells == 144
    assert len(running.find(clay).recording.path) > 1
    tick.stop(clay.session_uid)
    assert bpy.ops.digiclay.take_remove(take=number) == {"FINISHED"}
    assert number not in [entry.number for entry in takes.list_takes(clay)]


def test_a_take_from_a_formed_bed_is_not_exported_and_the_file_is_not_made(clay, tmp_path):
    record(clay)
    record(clay)
    file = tmp_path / "late.toml"
    with pytest.raises(RuntimeError, match="begins on a bed that is formed already"):
        bpy.ops.digiclay.take_export(filepath=str(file))
    assert not file.exists()


def test_keeping_a_take_of_nothing_says_so_and_a_reset_keeps_what_was_recorded(clay):
    begin_recording(clay)
    assert bpy.ops.digiclay.take_keep() == {"CANCELLED"}
    assert running.find(clay).recording is None
    bpy.ops.digiclay.take_record()
    press(clay)
    assert bpy.ops.digiclay.session_reset() == {"FINISHED"}
    assert [one.seconds for one in takes.list_takes(clay)] == [pytest.approx(0.6)]
    assert running.find(clay).recording is None
    tick.stop(clay.session_uid)


def test_a_changed_parameter_ends_the_recording_and_keeps_it_as_a_take_of_the_former_scene(clay):
    begin_recording(clay)
    press(clay)
    clay.digiclay.control.virtual_master.force_setpoint = 0.8
    (note,) = tick.tick(bpy.context, 101.0)
    assert "The recording ended and was kept as Take 1" in note.message
    (entry,) = takes.list_takes(clay)
    assert takes.read(clay, entry.number).scene.set_point.force == 0.4
    assert running.find(clay).recording is None
    tick.stop(clay.session_uid)
    assert bpy.ops.digiclay.take_replay() == {"FINISHED"}


Floats = NDArray[np.float64]
COUNT = 100  # control periods of 5 ms: half a second


def scene():
    return resolve({"layout": {"rows": 12, "columns": 12}})


@functools.cache
def taken(count=COUNT):
    """Press 5 mm deep; return the take, and all heights (t + 1, n)."""
    made = scene()
    system = assemble(made)
    state = begin(system)
    first, heights = snapshot.dump(system, state), [state.row(0)]
    poses = np.tile([0.0, 0.0, 0.0, *LEVEL], (count + 1, 1))
    poses[:, 2] = np.linspace(41e-3, 35e-3, count + 1)
    for state in simulate_path(system, state, poses[:, None]):  # noqa: B020
        heights.append(state.row(0))
    return Take(made, first, poses[:, None], snapshot.dump(system, state)), np.array(heights)


def build():
    made = scene()
    rest = Instant.at_rest(made.layout, made.actuator)
    return view.build(rest, bpy.context.collection)


@pytest.fixture
def bed():
    made = open_bed("rest", build)
    bpy.context.scene.render.fps = 40  # a frame is five control periods
    return made


def shown(bed, frame):
    """Return the heights drawn at a frame, m."""
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
    bed.modifiers["Pins"].show_viewport = False  # leaves the vertices the pins stand on
    bpy.context.view_layer.update()
    return bridge.read_cells(evaluate(bed))["height"]


def baked(bed, take, first=1):
    *_, moments = bake.simulate_frames(take, 40.0)
    assert isinstance(moments, bake.BakedFrames)
    bake.apply(bed, moments, first, [Fingertip()], [1])
    return moments


def test_a_number_is_not_used_again_while_later_takes_stand(bed):
    take, _ = taken(5)
    numbers = [takes.add(bed, take).number for _ in range(3)]
    takes.remove(bed, numbers[1])
    assert takes.add(bed, take).number == "4"
    assert [one.number for one in takes.list_takes(bed)] == ["1", "3", "4"]
    with pytest.raises(DigiclayError, match="has no take '7': its takes are 1"):
        takes.read(bed, "7")


def test_every_frame_shows_heights_modes_forces_and_fingertip_of_its_moment(bed):
    take, heights = taken()
    moments = baked(bed, take, first=10)
    between = (heights[50] + heights[55]) / 2.0
    assert np.ptp(heights[50] - heights[55]) > 1e-5
    rows = {10: 0, 17: 35, 1: 0, 99: 100, 30: 100}
    wanted = {20.5: between} | {frame: heights[row] for frame, row in rows.items()}
    for frame, height in wanted.items():
        # Pins are drawn in float32 at ten units a meter: 3e-8 of 0.4.
        assert np.abs(shown(bed, frame) - height).max() < 1e-7, frame
    cells = bridge.read_cells(evaluate(bed))
    assert np.array_equal(cells["force"], moments.force[20])
    assert np.array_equal(cells["mode"], moments.mode[20])
    assert cells["force"].max() > 0.0
    bpy.context.scene.frame_set(10 + 12)
    assert np.abs(bridge.pose(fingertip_of(bed))[:3] - take.poses[60, 0, :3]).max() < 1e-7


def test_a_bake_replaces_the_former_and_freed_leaves_nothing(bed):
    meshes, trees = len(bpy.data.meshes), len(bpy.data.node_groups)
    for count in (2, COUNT):  # baked again, the former bake is replaced
        moments = baked(bed, taken(count)[0])
        assert len(moments.height) == 1 + count // 5
        assert len(bed.modifiers) == 2
        assert len([one for one in bpy.data.objects if one.get(ROLE) == bake.BAKE]) == 1
    assert bake.is_baked(bed)
    assert bake.free(bed)
    assert (len(bpy.data.meshes), len(bpy.data.node_groups)) == (meshes, trees)
    assert not bake.is_baked(bed)
    assert not bake.free(bed)
    assert [curve for group in bake.curves(bed) for curve in group] == []


def same_action(bed):
    """Return a second bed that was baked into the action of the first."""
    other = build()
    other.animation_data_create().action = bed.animation_data.action
    baked(other, taken()[0])
    return other


@pytest.mark.parametrize(
    "made", [same_action, lambda bed: bed.copy()], ids=["an action", "its curves"]
)
@pytest.mark.parametrize("freed", [0, 1])
def test_freeing_one_of_two_bakes_that_share_leaves_the_other(bed, made, freed):
    take, heights = taken()
    baked(bed, take)
    beds = [bed, made(bed)]
    if beds[1].name not in bpy.context.scene.objects:
        bpy.context.collection.objects.link(beds[1])
        beds[1].data = bed.data.copy()
    assert bake.free(beds.pop(freed))
    (left,) = beds
    assert np.abs(shown(left, 11) - heights[50]).max() < 1e-7
    assert np.abs(shown(left, 21) - heights[100]).max() < 1e-7


def test_a_bake_is_keyframed_in_the_beds_own_curves_where_it_shares_them(bed):
    bed.keyframe_insert("location", frame=1)
    other = bed.copy()
    bpy.context.collection.objects.link(other)
    baked(bed, taken()[0])
    paths = [
        [curve.data_path for group in bake.curves(one) for curve in group] for one in (other, bed)
    ]
    assert [len(one) for one in paths] == [3, 4]


def test_a_bake_plays_without_the_extension(bed, tmp_path):
    # No handler and no driver: what plays is a modifier and its curve.
    take, heights = taken()
    baked(bed, take)
    name = bed.name
    save_and_open(tmp_path / "baked.blend")
    assert not bpy.app.handlers.frame_change_pre
    assert not bpy.app.handlers.frame_change_post
    assert np.abs(shown(bpy.data.objects[name], 21) - heights[100]).max() < 1e-7


def test_an_animated_fingertip_is_read_once_a_control_period(bed):
    tip = fingertip_of(bed)
    bridge.place_fingertips(bed, np.array([[0.0, 0.0, 45e-3, *LEVEL]]), [Fingertip()])
    tip.keyframe_insert("location", frame=1)
    tip.location.z -= 8e-3 * bridge.SCALE
    tip.keyframe_insert("location", frame=21)
    for _, curve in ((group, curve) for group in bake.curves(tip) for curve in group):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    bpy.context.scene.frame_set(3)
    *_, path = bake.sample_path(bpy.context.scene, bed, 1, 21, resolve({}))
    assert path.knots == ()
    # 20 frames at 40 a second are 100 periods; a subframe is read to 1e-4 of a frame or better.
    assert np.abs(path.poses[:, 0, 2] - np.linspace(45e-3, 37e-3, 101)).max() < 1e-7
    assert bpy.context.scene.frame_current == 3


@pytest.mark.parametrize("rate, last", [(24, 24), (25, 24), (30, 7), (24, 2)])
def test_a_bake_has_each_of_its_frames(extension, rate, last):
    bed = new_bed(rows=5, columns=5)
    bpy.context.scene.render.fps = rate
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=last) == {"FINISHED"}
    assert len(bake.read_moments(bed)[1]) == last


@pytest.mark.parametrize("first, last", [(5, 5), (9, 2), (1, 300_000)])
def test_a_range_of_frames_that_cannot_be_is_refused(bed, first, last):
    with pytest.raises(DigiclayError, match="The frames to bake must have from 1 to"):
        next(bake.sample_path(bpy.context.scene, bed, first, last, resolve({})))


def test_a_scene_whose_time_is_stretched_is_not_baked(bed, monkeypatch):
    render = bpy.context.scene.render
    monkeypatch.setattr(render, "frame_map_new", 200)
    with pytest.raises(DigiclayError, match=r"must have two equal numbers \(got 100 to 200\)"):
        next(bake.sample_path(bpy.context.scene, bed, 1, 10, resolve({})))


def test_each_frame_shows_the_nearest_period():
    take, _ = taken()
    assert bake.frame_periods(take, 24.0).tolist() == [
        0,
        8,
        17,
        25,
        33,
        42,
        50,
        58,
        67,
        75,
        83,
        92,
        100,
    ]
