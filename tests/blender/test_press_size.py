"""Size of the fingertip and presets of the brush, as the Press tool sets them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.scene.assembly import assemble
from digiclay.operators.press_adjust import AdjustStrength, BrushMenu
from digiclay.press import brush
from digiclay.press.brush import FINGERS, find_kind
from digiclay.roles import fingertip_of
from digiclay.settings import devices, properties

from tests.blender.at_hand import in_the_view, new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture
def bed(extension: None) -> Any:
    """A new bed, 25 x 25 pins."""
    made = new_bed()
    bpy.context.view_layer.update()
    return made


def lengths(bed: Any) -> tuple[float, ...]:
    """Return size of the fingertip, then radius, edge and flat radius of the blister, mm."""
    scene = properties.scene_of(bed)
    blister = scene.blister
    assert blister is not None
    meters = (
        2.0 * scene.fingers[0].fingertip.width,
        blister.radius,
        blister.edge_radius,
        blister.flat_radius,
    )
    return tuple(round(1e3 * length, 4) for length in meters)


@pytest.mark.parametrize(
    ("follows", "size", "wanted"),
    [
        (True, 8.0, (8.0, 7.5, 9.25, 3.0)), (False, 8.0, (8.0, 15.0, 18.5, 6.0)),
        (False, 60.0, (60.0, 15.0, 18.5, 6.0)),
    ],
)  # fmt: skip
def test_the_ellipsoid_follows_the_size_and_the_blister_unless_it_is_set_by_itself(
    bed: Any, follows: bool, size: float, wanted: tuple[float, ...]
) -> None:
    before = bridge.pose(fingertip_of(bed))
    bed.digiclay.blister_follows = follows
    bed.digiclay.size = size
    assert lengths(bed) == wanted
    bpy.context.view_layer.update()
    finger, half = bridge.finger_of(fingertip_of(bed)), size * 0.5e-3
    assert (finger.length, finger.width, finger.height) == pytest.approx((1.25 * half, half, half), rel=1e-6)
    # The lowest point stays: a larger finger does not press.
    np.testing.assert_allclose(bridge.pose(fingertip_of(bed)), before, rtol=0, atol=1e-7)


@pytest.mark.parametrize(("name", "usual"), [("length", 20.0), ("width", 16.0), ("height", 16.0)])
def test_the_panel_shows_whole_widths_and_stores_semi_axes(bed: Any, name: str, usual: float) -> None:
    group, lowest = bed.digiclay.fingertip, bridge.pose(fingertip_of(bed))
    assert getattr(group, f"whole_{name}") == usual
    setattr(group, f"whole_{name}", 12.6)
    bpy.context.view_layer.update()
    (finger,) = properties.scene_of(bed).fingers
    assert getattr(finger.fingertip, name) == 6.3e-3
    assert bed.digiclay.size == pytest.approx(12.6 if name == "width" else 16.0)
    np.testing.assert_allclose(bridge.pose(fingertip_of(bed)), lowest, rtol=0, atol=1e-7)
    assert group.bl_rna.properties[f"whole_{name}"].description.endswith(f"by default {usual:g} mm")


@pytest.mark.parametrize(
    ("typed", "share"),
    [("0.5", 0.5), (".25", 0.25), ("1", 1.0), ("50", 0.5), ("50 %", 0.5), ("0.5%", 5e-3), ("2*0.3", 0.6)],
)
def test_a_strength_is_typed_as_a_share_or_in_per_cent(typed: str, share: float) -> None:
    assert AdjustStrength.parse(None, typed) == pytest.approx(share, rel=1e-9)


def test_a_blister_that_the_bed_limits_is_the_same_again_with_the_size_before(bed: Any) -> None:
    bed.digiclay.size = 100.0
    # Half the bed's longer side; a wider blister is no valid scene.
    assert lengths(bed)[:2] == (100.0, 37.5)
    bed.digiclay.size = 80.0
    assert lengths(bed)[1] == 37.5
    bed.digiclay.size = 16.0
    assert lengths(bed) == pytest.approx((16.0, 15.0, 18.5, 6.0), rel=1e-5)


@pytest.mark.parametrize(("asked", "got"), [(-5.0, 1.0), (0.0, 1.0), (1e9, 200.0)])
def test_a_size_stays_within_what_a_finger_can_have(bed: Any, asked: float, got: float) -> None:
    devices.set_size(bed.digiclay, 1e-3 * asked)
    assert lengths(bed)[0] == pytest.approx(got, rel=1e-6)


def test_the_bracket_keys_scale_it_and_undo_brings_it_back(bed: Any) -> None:
    bpy.ops.ed.undo_push(message="Add")
    bpy.ops.digiclay.press_scale("EXEC_DEFAULT", True, scalar=1.5)
    assert lengths(bpy.context.object)[0] == pytest.approx(24.0)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(16.0)


def test_without_a_bed_or_its_fingertip_the_size_cannot_be_changed(bed: Any) -> None:
    assert bpy.ops.digiclay.press_scale.poll()
    bpy.data.objects.remove(fingertip_of(bed))
    assert not bpy.ops.digiclay.press_scale.poll()
    bpy.data.objects.remove(bed)
    assert not bpy.ops.digiclay.press_scale.poll()


@pytest.mark.parametrize("kind", list(FINGERS))
def test_each_preset_finger_can_be_simulated_and_is_undone_in_one_step(bed: Any, kind: str) -> None:
    bpy.ops.ed.undo_push(message="Add")
    bed.digiclay.size = 30.0
    bpy.ops.ed.undo_push(message="Size")
    bpy.ops.digiclay.press_finger("EXEC_DEFAULT", True, kind=kind)
    scene = properties.scene_of(bpy.context.object)
    assert find_kind(scene.fingers[0].fingertip) is FINGERS[kind]
    assert scene.blister.radius == pytest.approx(min(37.5e-3, 15 / 8 * FINGERS[kind].finger.width), rel=1e-5)
    assemble(scene)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(30.0)


SHIPPED = Path(brush.HOME, "presets", brush.SUBFOLDER)


@pytest.fixture
def settings(extension: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The settings of the tool in hand, over a bed; the user's own presets are in a folder of their own."""
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(tmp_path))
    new_bed()
    with in_the_view():
        bpy.ops.wm.tool_set_by_id(name=brush.TOOL)
        yield brush.tool_settings(bpy.context)


def apply(name: str) -> None:
    """Apply a preset as its entry in the menu does."""
    (folder,) = [Path(path) for path in bpy.utils.preset_paths(brush.SUBFOLDER)][-1:]
    file = next(path for path in (SHIPPED / f"{name}.py", folder / f"{name}.py") if path.is_file())
    bpy.ops.digiclay.press_brush(filepath=str(file), menu_idname=BrushMenu.bl_idname)


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.py")), ids=lambda file: file.stem)
def test_each_preset_sets_a_known_finger_and_every_setting(settings: Any, file: Path) -> None:
    shown = settings.bl_rna.properties
    wanted = {name: shown[name].default for name in brush.list_settings(settings)}
    lines = [line.split(" = ") for line in file.read_text().splitlines() if line.startswith("settings.")]
    wanted |= {name.removeprefix("settings."): ast.literal_eval(value) for name, value in lines}
    settings.brush, settings.depth, settings.height, settings.strength = "LEVEL", 9.0, 9.0, 0.5
    settings.symmetry, settings.path, settings.stabilizer, settings.pressure_curve = "XY", "LINE", 9.0, "SOFT"
    settings.use_pressure = settings.use_tilt = False
    assert str(SHIPPED) in bpy.utils.preset_paths(brush.SUBFOLDER)
    bpy.context.object.digiclay.size = 40.0
    apply(file.stem)
    assert find_kind(devices.read_finger(bpy.context.object.digiclay)) in FINGERS.values()
    assert {name: getattr(settings, name) for name in wanted} == wanted


def test_a_preset_that_cannot_be_run_changes_nothing(settings: Any, tmp_path: Path) -> None:
    settings.depth, settings.symmetry = 7.5, "XY"
    file = tmp_path / "broken.py"
    file.write_text("settings.depth = 3.0")
    with pytest.raises(RuntimeError, match="settings"):
        bpy.ops.digiclay.press_brush(filepath=str(file), menu_idname=BrushMenu.bl_idname)
    assert (settings.depth, settings.symmetry) == (7.5, "XY")


def test_a_saved_preset_brings_back_what_was_set_and_is_removed(settings: Any, tmp_path: Path) -> None:
    settings.depth, settings.symmetry, settings.path = 7.5, "XY", "RING"
    bpy.context.object.digiclay.size = 11.0
    bpy.ops.digiclay.press_brush_save(name="Of my own")
    (saved,) = [
        file for path in bpy.utils.preset_paths(brush.SUBFOLDER) for file in Path(path).glob("Of_my_own.py")
    ]
    assert saved.is_relative_to(tmp_path)
    settings.depth, settings.symmetry, settings.path = 2.0, "NONE", "FREE"
    bpy.context.object.digiclay.size = 30.0
    bpy.ops.digiclay.press_brush(filepath=str(saved), menu_idname=BrushMenu.bl_idname)
    assert (settings.depth, settings.symmetry, settings.path) == (7.5, "XY", "RING")
    assert bpy.context.object.digiclay.size == pytest.approx(11.0, abs=1e-3)
    bpy.ops.digiclay.press_brush_save(name="Of_my_own", remove_name=True)
    assert not saved.exists()


def test_without_the_tool_there_is_nothing_to_set(settings: Any) -> None:
    assert bpy.ops.digiclay.press_brush.poll()
    bpy.ops.wm.tool_set_by_id(name="builtin.select_box")
    assert not bpy.ops.digiclay.press_brush.poll()
