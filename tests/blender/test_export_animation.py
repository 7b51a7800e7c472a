"""A bake, a recording or a take as animated file: Blender's importers find the heights of every frame."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.compat import KINDS
from digiclay.core.base.errors import OutputError
from digiclay.core.mesh_io.animation import Animation
from digiclay.core.session.take import play
from digiclay.exchange.animation_file import SUFFIXES, write_animation
from digiclay.live import tick
from digiclay.recorded import takes
from digiclay.roles import fingertip_of

from tests.assemble import assert_near
from tests.blender.at_hand import open_bed

#: float32 at 60 mm, through a few matrices.
NEAR = 2e-8
#: Frames per second: one frame per 8 control periods.
RATE = 25
#: Control periods of a tick of 50 ms, and ticks of a recording.
TICK, TICKS = 10, 8


def press(bed):
    """Let a session record a press from a millimeter above the pins; the session goes on."""
    tick.start(bpy.context, bed)
    bpy.ops.digiclay.take_record()
    tip = fingertip_of(bed)
    height = bridge.read_cells(bed.data)["height"].max() - bridge.pose(tip)[2]
    start = tip.location.z + height * bridge.SCALE
    for count in range(TICKS + 1):
        tip.location.z = start + (1e-3 - 8e-3 * count / TICKS) * bridge.SCALE
        bpy.context.view_layer.update()
        tick.tick(bpy.context, 100.0 + 0.05 * count)


def add():
    """Add a bed with the take of a press, in a file of 25 frames per second."""
    bpy.ops.mesh.digital_clay_add(rows=4, columns=5)
    bpy.context.scene.render.fps = RATE
    bed = bpy.context.object
    press(bed)
    bpy.ops.digiclay.take_keep(name="A press")
    tick.stop(bed.session_uid)


@pytest.fixture
def bed(extension):
    return open_bed("a press on 4 x 5 pins", add)


def find_heights(take):
    """Return the heights (t, n) of a take in its frames, m."""
    step = round(1.0 / (RATE * take.scene.simulation.control_period))
    assert step == 8
    return np.array([state.row(0).copy() for _, state in play(take)])[::step]


def bring_back(path, kind, count):
    """Import a file of frames into an empty scene; give the heights (n,) of each, m."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps = RATE
    if path.suffix == ".usda":
        bpy.ops.wm.usd_import(filepath=str(path))
    elif path.suffix == ".abc":
        bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    else:
        bpy.ops.import_scene.gltf(filepath=str(path))
    if path.suffix != ".glb":
        assert (scene.frame_start, scene.frame_end) == (0, count - 1)
    for frame in range(count):
        scene.frame_set(frame)
        drawn = bpy.context.evaluated_depsgraph_get()
        if kind == "surface":
            skin = next(each for each in drawn.objects if each.name.startswith("skin"))
            yield np.array([(skin.matrix_world @ point.co).z for point in skin.data.vertices])
        else:
            # Instances of an instancer, or objects, in a GLB and an Alembic file by their number.
            tops = [
                (each.object.name, each.matrix_world.translation.z)
                for each in drawn.object_instances
                if each.object.name.startswith("pin")
                and (each.is_instance or each.object.name != "pin")
                and each.object.type == "MESH"
                and each.object.name != "pins"
            ]
            yield np.array([height for _, height in sorted(tops, key=number)])


def number(top):
    """Return the number of a pin from the name of its object, 0 for all of an instancer."""
    digits = [part for part in top[0].replace("_", "-").split("-") if part.isdecimal()]
    return int(digits[0]) if digits else 0


@pytest.mark.parametrize("file_format", SUFFIXES)
@pytest.mark.parametrize("kind", ["pins", "surface"])
def test_a_take_comes_back_with_the_heights_of_its_run_in_every_frame(
    bed, tmp_path, file_format, kind
):
    heights = find_heights(takes.read(bed))
    kinds = (*KINDS, "actions")
    before = {name: len(getattr(bpy.data, name)) for name in kinds}
    bpy.ops.export_anim.digital_clay(
        filepath=str(tmp_path / "press"), file_format=file_format, kind=kind, unit="m"
    )
    assert before == {name: len(getattr(bpy.data, name)) for name in kinds}
    (path,) = tmp_path.iterdir()
    assert path.name == f"press{SUFFIXES[file_format]}"
    found = list(bring_back(path, kind, len(heights)))
    assert len(heights) == 11
    assert np.ptp(heights, axis=0).max() > 1e-3
    still = bpy.app.version < (4, 3) and path.suffix == ".usda" and kind == "pins"
    for pins, wanted in zip(found, heights, strict=True):
        # Blender 4.2 reads an instancer at its first frame alone.
        assert_near(pins, heights[0] if still else wanted, NEAR)


def test_a_bake_goes_before_a_recording_and_that_before_the_last_take(bed, tmp_path):
    def written(**options):
        path = tmp_path / "any.glb"
        bpy.ops.export_anim.digital_clay(filepath=str(path), file_format="glb", **options)
        return path.read_bytes()

    take = written()
    assert written(take="1") == take
    press(bed)
    recording = written()
    assert written(take="1") == take
    bpy.ops.digiclay.take_keep(name="Another")
    tick.stop(bed.session_uid)
    assert written(take="2") == written() == recording != take
    heights = find_heights(takes.read(bed, "1"))
    bpy.ops.digiclay.bake(source="TAKE", take="1")
    assert written(take="2") == recording
    written()
    found = list(bring_back(tmp_path / "any.glb", "pins", len(heights)))
    assert_near(np.array(found), heights, NEAR)


@pytest.mark.parametrize(
    "name, options, written",
    [
        ("clay.glb", {}, "clay.glb"),
        ("clay.GLB", {}, "clay.glb"),
        ("clay.usd", {}, "clay.usda"),
        ("clay.usdc", {}, "clay.usda"),
        ("clay 1.5", {}, "clay 1.5.usda"),
        ("clay.glb", {"file_format": "usd"}, "clay.usda"),
        ("clay.stl", {"file_format": "glb"}, "clay.stl.glb"),
    ],
)
def test_the_extension_is_that_of_the_format_and_names_it_where_none_is_given(
    bed, tmp_path, name, options, written
):
    bpy.ops.export_anim.digital_clay(filepath=str(tmp_path / name), **options)
    assert [path.name for path in tmp_path.iterdir()] == [written]


def test_what_cannot_be_exported_is_refused_in_a_line_and_nothing_is_left(bed, tmp_path):
    export = bpy.ops.export_anim.digital_clay
    refusals = {
        "its takes are 1": {"filepath": str(tmp_path / "a"), "take": "7"},
        "Cannot write": {"filepath": str(tmp_path / "absent" / "a")},
    }
    for said, options in refusals.items():
        with pytest.raises(RuntimeError, match=said) as raised:
            export(**options)
        assert str(raised.value).strip().count("\n") == 0
    bpy.context.scene.render.fps = 2  # the take ends before the second frame
    with pytest.raises(RuntimeError, match="at least 2 frames"):
        export(filepath=str(tmp_path / "a"))
    assert list(tmp_path.iterdir()) == []
    bpy.ops.digiclay.take_remove()
    with pytest.raises(RuntimeError, match="record a take or bake a session first"):
        export(filepath=str(tmp_path / "a"))


def test_an_alembic_file_that_the_disk_has_no_room_for_is_refused_since_blender_would_crash(
    tmp_path,
):
    # An array without memory of its own; a file of it has 170 PB.
    points = np.broadcast_to(0.0, (10**9, 10**6, 3))
    animation = Animation(25.0, points, np.zeros((1, 3), np.int32))
    with pytest.raises(OutputError, match=r"needs up to 1\.7e\+11 MB \(free: "):
        write_animation(tmp_path / "a.abc", animation, "abc", "mm")
    assert list(tmp_path.iterdir()) == []
