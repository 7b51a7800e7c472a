"""A live session follows the fingertip, by whatever means it is moved."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.compat import curves
from digiclay.core.session import snapshot
from digiclay.live import beds
from digiclay.recorded import bake
from digiclay.roles import fingertip_of
from digiclay.sessions import running

from tests.assemble import assert_near
from tests.blender.session.live import FLOAT32, TICK, exact, move, press, record, shown, started


def test_the_bed_forms_while_the_fingertip_moves_and_keeps_and_shows_what_the_session_is(
    bed, clock
):
    started(bed)
    lowest = []
    for z in np.linspace(46, 37, 8):
        move(bed, clock, [(0.0, z)])
        lowest.append(shown(bed).min())
    assert lowest[0] == pytest.approx(40e-3, abs=FLOAT32)
    assert (np.diff(lowest)[-2:] < 0).all()  # it touches at 40 mm, three ticks before the end
    clock.tick(8)
    session = running.find(bed)
    assert beds.read_snapshot(bed) == snapshot.dump(session.system, session.state)
    assert np.array_equal(beds.read_poses(bed), session.poses)
    assert_near(shown(bed), exact(bed), FLOAT32)
    assert exact(bed).min() < 39e-3


def drive(tip, how):
    """Have the fingertip pressed down between the frames 1 and 20, by other means than by hand."""
    low, high = 0.45, 0.54
    if how == "driver":
        curve = tip.driver_add("location", 2)
        curve.driver.expression = f"{high} - frame / 20 * {high - low}"
    else:
        other = bpy.data.objects.new("Other", None)
        bpy.context.collection.objects.link(other)
        for frame, z in ((1, high), (20, low)):
            other.location.z = z
            other.keyframe_insert("location", index=2, frame=frame)
        constraint = tip.constraints.new("COPY_LOCATION")
        constraint.target = other
        bpy.context.view_layer.objects.active.location.z = 0.0


@pytest.mark.parametrize("how", ["driver", "constraint"])
def test_the_bed_follows_a_fingertip_moved_by_other_means(bed, clock, how):
    tip = fingertip_of(bed)
    drive(tip, how)
    bpy.context.scene.frame_set(1)
    started(bed)
    for frame in range(1, 21):
        bpy.context.scene.frame_set(frame)
        clock.tick()
    clock.tick(5)
    assert exact(bed).min() < 39e-3


#: A playback: time between two ticks, s, ticks from a frame that is shown to the next, frames till
#: then, the first frame, and settings of the scene's time.
PLAYBACKS = {
    "in time": (TICK, 1.25, 1, 1, {}),
    "at a fifth of the speed, ticks between": (TICK, 6.25, 1, 1, {}),
    "five of six frames left out": (6.0 / 24.0, 1.0, 6, 1, {}),
    "of 29.97 frames a second": (TICK, 1.0, 1, 1, {"fps": 30, "fps_base": 1.001}),
    "from before frame 0 on": (
        TICK,
        1.25,
        1,
        -30,
        {"use_preview_range": True, "frame_preview_start": -30},
    ),
    "stretched to twice its time": (TICK, 1.25, 1, 1, {"frame_map_new": 200}),
    "pressed into half its time": (TICK, 1.25, 1, 1, {"frame_map_new": 50}),
}


@pytest.mark.parametrize("how", PLAYBACKS)
def test_a_session_in_a_playback_has_the_path_that_a_bake_has(bed, clock, how):
    wall, ticks, frames, start, settings = PLAYBACKS[how]
    tip, scene = fingertip_of(bed), bpy.context.scene
    keys, heights = start + np.array([0, 12, 24, 48]), (46.0, 37.0, 37.0, 43.0)
    for frame, z in zip(keys.tolist(), heights, strict=True):
        tip.location.z = (z + 8.0) * 1e-3 * bridge.SCALE
        tip.keyframe_insert("location", frame=frame)
    for name, value in settings.items():
        setattr(scene.render if hasattr(scene.render, name) else scene, name, value)
    for key in (key for group in curves(tip) for curve in group for key in curve.keyframe_points):
        key.interpolation = "LINEAR"
    scene.frame_set(start)
    started(bed)
    period, render = running.find(bed).system.period, scene.render
    stretched = render.frame_map_new / 100
    rate = render.fps / render.fps_base
    frame_numbers = start + np.arange(49)
    of_frames = 1e-3 * np.interp(frame_numbers / stretched, keys, heights)
    in_frames = start + np.arange(int(48 / rate / period + 1e-6) + 1) * period * rate
    expected = np.interp(in_frames, frame_numbers, of_frames)
    if stretched == 1.0:
        *_, baked = bake.sample_path(scene, bed, start, start + 48, running.find(bed).scene)
        # A bake also has the period in which its last frame is.
        assert_near(baked.poses[: len(expected), 0, 2], expected, 1e-7)
    clock.tick(3)
    bpy.ops.screen.animation_play()
    clock.tick()
    record(bed)
    for count in range(int(ticks * 48 / frames) + 2):
        scene.frame_set(start + min(frames * int(count / ticks), 48))
        clock.now += wall - TICK
        assert clock.tick() == []
    bpy.ops.screen.animation_cancel(restore_frame=False)
    path = running.find(bed).recording.path
    assert len(path) == len(expected)
    # A frame lasts no whole number of periods: the way of one, at 0.75 mm a frame, may be gone
    # early.
    assert_near(path[:, 0, 2], expected, 0.75e-3 / stretched * rate * period)
    clock.tick(3)
    assert len(running.find(bed).recording.path) == len(path) + 20  # 0.1 s by the wall's clock


def test_beds_go_on_at_once_and_those_turned_moved_and_scaled_form_like_another(bed, clock):
    started(bed)
    turned = []
    for scale in (2.0, 100.0, 1e-5):
        bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
        other = bpy.context.object
        other.location, other.rotation_euler, other.scale = (
            (1.5 * scale, -scale, 0.5 * scale),
            (0.4, 0.0, 0.7),
            (scale,) * 3,
        )
        started(other)
        press(other, clock)
        turned.append(exact(other))
    assert (exact(bed) == 40e-3).all()  # each has a fingertip of its own
    press(bed, clock)
    # The matrices are float32: some 1e-7 of 1.5 units of the bed, at 0.1 m a unit.
    assert_near(turned, [exact(bed)] * 3, 2e-5)
    assert len(running.list_sessions()) == 4


def test_a_method_that_is_changed_in_mid_session_takes_over_with_the_heights(bed, clock):
    started(bed)
    press(bed, clock)
    before = exact(bed)
    bed.digiclay.method = "plastic"
    notes = clock.tick()
    assert ["heights and locks were kept" in note.message for note in notes] == [True]
    assert_near(exact(bed), before, 1e-5)  # pins were still coming to rest
    assert running.find(bed).scene.method == "plastic"


def test_a_bed_nothing_moves_on_is_not_drawn_anew(bed, clock):
    started(bed)
    clock.tick(40)
    bed.data.vertices[0].co.z = 9.0
    clock.tick(5)
    assert bed.data.vertices[0].co.z == 9.0
    move(bed, clock, [(0.0, 38.0)] * 2)
    assert bed.data.vertices[0].co.z < 1.0
