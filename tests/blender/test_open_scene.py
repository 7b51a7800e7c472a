"""Samples and scene files as beds: each opens from the Add menu, and from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.scene.scene_source import SAMPLES, find, list_samples, load
from digiclay.core.shapes.fitting import list_shapes
from digiclay.operators.add_bed import SceneFiles
from digiclay.recorded import takes
from digiclay.roles import fingertip_of, is_bed
from digiclay.settings import properties

from tests.assemble import replayed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.mark.parametrize("name", ["ridge_mound_valley", "dome_peaked", list_samples()[-1]])
def test_a_sample_session_opens_as_the_bed_it_describes(name: str) -> None:
    assert bpy.ops.digiclay.add_sample(sample=f"session:{name}", take=False) == {"FINISHED"}
    bed, wanted = bpy.context.object, load(find(name))
    made = properties.scene_of(bed)
    for section in ("layout", "control", "fingertip"):
        assert made.section(section) == wanted.section(section)
    start = wanted.section("trajectory").waypoints[0].position
    # 32 bits of a few tenths of a Blender unit.
    assert np.abs(bridge.pose(fingertip_of(bed))[:3] - start).max() < 1e-7
    # What a scene needs from elsewhere is in the .blend.
    assert (made.shape is None) == (wanted.shape is None)
    assert made.shape is None or made.shape.heights


@pytest.mark.parametrize("name", ["face", "knot", list_shapes()[-1]])
def test_a_sample_shape_opens_on_a_bed_that_displays_it(name: str) -> None:
    assert bpy.ops.digiclay.add_sample(sample=f"shape:{name}") == {"FINISHED"}
    height = bridge.read_cells(bpy.context.object.data)["height"]
    # The dead band at either end.
    assert np.ptp(height) == pytest.approx(15e-3, abs=21e-6)


@pytest.mark.parametrize("name", ["tap", "dome_peaked"])
def test_a_sample_s_session_is_a_take_that_replays_bit_for_bit(name: str) -> None:
    assert bpy.ops.digiclay.add_sample(sample=f"session:{name}") == {"FINISHED"}
    bed = bpy.context.object
    (entry,) = takes.list_takes(bed)
    assert entry.name == name
    assert entry.seconds == pytest.approx(load(find(name)).simulation.duration, abs=5e-3)
    assert replayed(takes.read(bed, entry.number))


@pytest.mark.parametrize("how", ["EXEC_DEFAULT", "INVOKE_DEFAULT"], ids=["in the dialog", "dropped"])
def test_a_scene_file_opens(tmp_path: Path, how: str) -> None:
    path = tmp_path / "mein Beet äöü.toml"
    path.write_text((SAMPLES / "tap.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert bpy.ops.digiclay.open_scene(how, filepath=str(path)) == {"FINISHED"}
    assert is_bed(bpy.context.object)
    assert len(bpy.context.object.data.vertices) == 121


def test_a_session_too_long_to_wait_for_is_left_to_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text("[simulation]\nduration = 3600", encoding="utf-8")
    assert bpy.ops.digiclay.open_scene(filepath=str(path)) == {"FINISHED"}
    assert takes.list_takes(bpy.context.object) == []


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot be read"),
        ("[valve\n", "line 1"),
        ("[layout]\nrows = 0", "layout.rows must be at least 1"),
        ('[shape]\nfile = "nowhere.stl"', "nowhere.stl: there is no such file"),
    ],
)
def test_a_file_that_is_no_scene_is_refused_whole(tmp_path: Path, content: str | None, said: str) -> None:
    path = tmp_path / "odd.toml"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    before = len(bpy.data.objects), len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.digiclay.open_scene(filepath=str(path))
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == before


def test_a_scene_file_may_be_dropped_into_a_3d_view_only() -> None:
    class Context:
        area: Any = None

    class Area:
        type = "VIEW_3D"

    context = Context()
    assert not SceneFiles.poll_drop(context)
    context.area = Area()
    assert SceneFiles.poll_drop(context)
    context.area.type = "IMAGE_EDITOR"
    assert not SceneFiles.poll_drop(context)
    assert SceneFiles.bl_import_operator == "digiclay.open_scene"
