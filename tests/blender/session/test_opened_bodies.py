"""Scenes with bodies in Blender: opened, their meshes press there, and a take of them is a scene again."""

import bpy
import numpy as np
import pytest
import trimesh
from digiclay import bridge
from digiclay.core.scene.scene_source import load
from digiclay.core.session.run_scene import run
from digiclay.core.session.take import play
from digiclay.core.shapes.body import read_bodies
from digiclay.recorded import takes
from digiclay.roles import ellipsoid, fingertip_of, list_pressers
from digiclay.sessions import running, sculpting
from digiclay.settings import properties

from tests.blender.at_hand import looked
from tests.blender.session.live import exact, started

SCENE = """
name = "pressed"
layout = { rows = 13, columns = 13 }
control.method = "plastic"
[[body]]
file = "egg.stl"
unit = "mm"
scale = 0.5
stiffness = 300
cap = 0.001
damping = 0.2
tip_radius = 0.0005
samples = 5
[body.trajectory]
waypoints = [
  { time = 0, position = [-0.009, 0, 0.049] },
  { time = 0.4, position = [-0.009, 0.002, 0.044], orientation = [0.7, 0, 0, 0.7] },
  { time = 0.5, position = [-0.009, 0.002, 0.044], orientation = [0.7, 0, 0, 0.7] },
  { time = 0.8, position = [-0.009, 0.001, 0.06], orientation = [-0.2, 0.9, 0.1, 0.1] },
  { time = 0.9, position = [-0.009, 0, 0.07], orientation = [-0.2, 0.9, 0.1, 0.1] },
]
[[body]]
file = "egg.stl"
unit = "mm"
scale = 0.4
[body.trajectory]
interpolation = "linear"
waypoints = [
  { time = 0.1, position = [0.009, 0.003, 0.046] },
  { time = 0.6, position = [0.01, 0.003, 0.0425] },
  { time = 0.8, position = [0.009, 0, 0.06] },
]
"""
FINGER = "[trajectory]\nwaypoints = [{ time = 0, position = [0, 0.01, 0.05] }]\n"


@pytest.fixture
def file(tmp_path):
    """A scene of two eggs beside their mesh, in a file, and Blender at the pace of the clock."""
    bpy.context.scene.render.fps = 30
    egg = trimesh.creation.icosphere(3, radius=16.0)
    egg.apply_scale((1.0, 1.3, 0.9))
    egg.export(tmp_path / "egg.stl")
    path = tmp_path / "pressed.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def opened(path, **options):
    """Open a scene file; return its bed and pressers."""
    assert bpy.ops.digiclay.open_scene(filepath=str(path), **options) == {"FINISHED"}
    bed = bpy.context.object
    looked()
    return bed, list_pressers(bed)


def test_bodies_of_a_scene_become_pressers_with_their_settings_and_keyed_paths(file):
    timeline, wanted = bpy.context.scene, load(file)
    timeline.frame_end = 9
    timeline.frame_set(7)
    bed, made = opened(file, take=False, scale=2.0)
    assert [presser.name for presser in made] == ["Body 1 Egg", "Body 2 Egg"]
    assert (timeline.frame_current, timeline.frame_end) == (1, 1 + 27)
    found = properties.scene_of(bed).bodies
    for each, body, presser in zip(wanted.bodies, found, made, strict=True):
        assert body.body == body.body.__class__(**vars(each.body.without_mesh()))
        assert tuple(presser.scale) == pytest.approx((each.body.scale,) * 3)
    hidden = [fingertip_of(bed), ellipsoid(fingertip_of(bed))]
    assert all(part.hide_viewport and part.hide_render for part in hidden)
    for frame in np.arange(0.0, 31.0, 0.37):
        timeline.frame_set(int(frame), subframe=frame % 1.0)
        for each, presser in zip(wanted.bodies, made, strict=True):
            (pose,) = each.trajectory.trajectory().poses(np.array([(frame - 1.0) / 30.0]))
            place = bridge.read_place(bed, presser) * bridge.SCALE
            place[:, :3] /= each.body.scale
            # Between two keys Blender's turn is uneven, by 0.01 degrees.
            assert np.abs(place - bridge.make_place(pose[:3], pose[3:])[:3]).max() < 3e-4


def test_a_fingertip_of_a_scene_with_bodies_is_shown(file):
    file.write_text(SCENE + FINGER, encoding="utf-8")
    bed, _ = opened(file, take=False)
    assert not fingertip_of(bed).hide_viewport


def test_a_scene_is_formed_in_its_take_live_and_by_the_take_as_a_scene(file, clock, tmp_path):
    done = run(load(file)).history["height"][-1]
    bed, _ = opened(file)
    *_, (_, state) = play(takes.read(bed))
    # Undersides are computed at other times.
    assert np.abs(state.row(0) - done).max() < 0.1e-3
    started(bed)
    clock.tick()
    running.put(sculpting.set_recording(running.find(bed), True))
    for frame in range(2, 32):
        bpy.context.scene.frame_set(frame)
        assert clock.tick() == []
    # The clock's ticks are a period long or short.
    assert np.abs(exact(bed) - done).max() < 0.2e-3
    assert np.count_nonzero(done < 39e-3) > 20
    assert bpy.ops.digiclay.take_keep() == {"FINISHED"}
    out = tmp_path / "again.toml"
    assert bpy.ops.digiclay.take_export(filepath=str(out)) == {"FINISHED"}
    again, first = load(out), load(file)
    assert np.abs(run(again).history["height"][-1] - exact(bed)).max() < 0.2e-3
    meshes = [read_bodies(each.body for each in scene.bodies) for scene in (again, first)]
    for mesh, wanted in zip(*meshes, strict=True):
        np.testing.assert_allclose(mesh.vertices, wanted.vertices, rtol=0, atol=1e-7)
    for each, wanted in zip(again.bodies, first.bodies, strict=True):
        left = {"file": "", "mesh": "", "scale": 1.0, "unit": "auto"}
        assert vars(each.body) | left == vars(wanted.body) | left


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("egg.stl", "none.stl", "body #1.file must be a file that exists"),
        ("0, 0.049]", "0, 0.003]", "body #1.trajectory must begin above the floor"),
        ("plastic", "hybrid", "body must be left out: the method hybrid"),
        ("", "", "Time Stretching must have two equal numbers"),
    ],
)
def test_what_cannot_press_is_refused_before_anything_is_made(file, old, new, words):
    file.write_text(SCENE.replace(old, new), encoding="utf-8")
    if not old:
        bpy.context.scene.render.frame_map_new = 50
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError) as raised:
        opened(file)
    assert words in str(raised.value)
    assert len(str(raised.value).strip().splitlines()) == 1
    assert len(bpy.data.objects) == before
