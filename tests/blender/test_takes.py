"""Takes kept in the .blend and baked: what they show frame by frame, and what undoing them leaves."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.take import Take
from digiclay.device import view
from digiclay.device.instant import Instant
from digiclay.recorded import bake, takes
from digiclay.roles import ROLE, fingertip_of
from numpy.typing import NDArray

from tests.blender.at_hand import open_bed

Floats = NDArray[np.float64]
COUNT = 100  # control periods of 5 ms: half a second


def scene() -> Scene:
    """Return a bed of 12 x 12 pins under Method I."""
    return resolve({"layout": {"rows": 12, "columns": 12}})


@functools.cache
def taken(count: int = COUNT) -> tuple[Take, Floats]:
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


def build() -> Any:
    """Return another bed in the open file."""
    made = scene()
    rest = Instant.at_rest(made.layout, made.actuator, made.section("fingertip"))
    return view.build(rest, bpy.context.collection)


@pytest.fixture
def bed() -> Any:
    """Return a bed in the open file."""
    made = open_bed("rest", build)
    bpy.context.scene.render.fps = 40  # a frame is five control periods
    return made


def shown(bed: Any, frame: float) -> Floats:
    """Return the heights drawn at a frame, m."""
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
    modifier = next(one for one in bed.modifiers if one.name == "Pins")
    modifier.show_viewport = False  # leaves the vertices the pins stand on
    bpy.context.view_layer.update()
    mesh = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    return places.reshape(-1, 3)[:, 2].astype(float) / bridge.SCALE


def baked(bed: Any, take: Take, first: int = 1) -> bake.BakedFrames:
    """Bake a take into a bed."""
    *_, moments = bake.simulate_frames(take, 40.0)
    assert isinstance(moments, bake.BakedFrames)
    bake.apply(bed, moments, first, [Fingertip()], keyframe_fingers=True)
    return moments


def test_a_take_kept_in_a_bed_comes_back_after_saving_and_loading(bed: Any, tmp_path: Path) -> None:
    take, _ = taken()
    name = bed.name
    entry = takes.add(bed, take, "A press")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    again = bpy.data.objects[name]
    assert takes.list_takes(again) == [entry]
    read = takes.read(again, entry.number)
    assert np.array_equal(read.poses, take.poses)
    assert (read.start, read.end) == (take.start, take.end)


def test_a_number_is_not_used_again_while_later_takes_stand(bed: Any) -> None:
    take, _ = taken(5)
    numbers = [takes.add(bed, take).number for _ in range(3)]
    takes.remove(bed, numbers[1])
    assert takes.add(bed, take).number == "4"
    assert [one.number for one in takes.list_takes(bed)] == ["1", "3", "4"]
    with pytest.raises(DigiclayError, match="has no take '7': its takes are 1"):
        takes.read(bed, "7")


def test_every_frame_shows_heights_modes_forces_and_fingertip_of_its_moment(bed: Any) -> None:
    take, heights = taken()
    moments = baked(bed, take, first=10)
    between = (heights[50] + heights[55]) / 2.0
    assert np.ptp(heights[50] - heights[55]) > 1e-5
    rows = {10: 0, 17: 35, 1: 0, 99: 100, 30: 100}
    wanted = {20.5: between} | {frame: heights[row] for frame, row in rows.items()}
    for frame, height in wanted.items():
        # Pins are drawn in float32 at ten units a meter: 3e-8 of 0.4.
        assert np.abs(shown(bed, frame) - height).max() < 1e-7, frame
    mesh = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    force, mode = np.empty(144, np.float32), np.empty(144, np.int32)
    mesh.attributes["force"].data.foreach_get("value", force)
    mesh.attributes["mode"].data.foreach_get("value", mode)
    assert np.array_equal(force, moments.force[20])
    assert np.array_equal(mode, moments.mode[20])
    assert force.max() > 0.0
    bpy.context.scene.frame_set(10 + 12)
    assert np.abs(bridge.pose(fingertip_of(bed))[:3] - take.poses[60, 0, :3]).max() < 1e-7


def test_a_bake_replaces_the_former_and_freed_leaves_nothing(bed: Any) -> None:
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


def same_action(bed: Any) -> Any:
    """Return a second bed that was baked into the action of the first."""
    other = build()
    other.animation_data_create().action = bed.animation_data.action
    baked(other, taken()[0])
    return other


@pytest.mark.parametrize("made", [same_action, lambda bed: bed.copy()], ids=["an action", "its curves"])
@pytest.mark.parametrize("freed", [0, 1])
def test_freeing_one_of_two_bakes_that_share_leaves_the_other(
    bed: Any, made: Callable[[Any], Any], freed: int
) -> None:
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


def test_a_bake_is_keyframed_in_the_beds_own_curves_where_it_shares_them(bed: Any) -> None:
    bed.keyframe_insert("location", frame=1)
    other = bed.copy()
    bpy.context.collection.objects.link(other)
    baked(bed, taken()[0])
    paths = [[curve.data_path for group in bake.curves(one) for curve in group] for one in (other, bed)]
    assert [len(one) for one in paths] == [3, 4]


def test_a_bake_plays_without_the_extension(bed: Any, tmp_path: Path) -> None:
    # No handler and no driver: what plays is a modifier and its curve.
    take, heights = taken()
    baked(bed, take)
    name = bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    assert not bpy.app.handlers.frame_change_pre
    assert not bpy.app.handlers.frame_change_post
    assert np.abs(shown(bpy.data.objects[name], 21) - heights[100]).max() < 1e-7


def test_an_animated_fingertip_is_read_once_a_control_period(bed: Any) -> None:
    tip = fingertip_of(bed)
    bridge.place_fingertips(bed, np.array([[0.0, 0.0, 45e-3, *LEVEL]]), [Fingertip()])
    tip.keyframe_insert("location", frame=1)
    tip.location.z -= 8e-3 * bridge.SCALE
    tip.keyframe_insert("location", frame=21)
    for _, curve in ((group, curve) for group in bake.curves(tip) for curve in group):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    bpy.context.scene.frame_set(3)
    *_, poses = bake.sample_path(bpy.context.scene, bed, 1, 21, 5e-3)
    # 20 frames at 40 a second are 100 periods; a subframe is read to 1e-4 of a frame or better.
    assert np.abs(poses[:, 0, 2] - np.linspace(45e-3, 37e-3, 101)).max() < 1e-7
    assert bpy.context.scene.frame_current == 3


@pytest.mark.parametrize(("first", "last"), [(5, 5), (9, 2), (1, 300_000)])
def test_a_range_of_frames_that_cannot_be_is_refused(bed: Any, first: int, last: int) -> None:
    with pytest.raises(DigiclayError, match="The frames to bake must have from 1 to"):
        next(bake.sample_path(bpy.context.scene, bed, first, last, 5e-3))


def test_each_frame_shows_the_nearest_period() -> None:
    take, _ = taken()
    assert bake.frame_periods(take, 24.0).tolist() == [0, 8, 17, 25, 33, 42, 50, 58, 67, 75, 83, 92, 100]
