"""Brush presets of the Press tool are Blender's own: they come along, and are applied, saved and removed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from digiclay.operators.press_presets import BrushMenu
from digiclay.press import brush
from digiclay.press.brush import FINGERS, find_kind
from digiclay.settings import finger_size

from tests.blender.at_hand import in_the_view, new_bed

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


def test_blender_finds_the_presets_that_come_along(settings: Any) -> None:
    assert str(SHIPPED) in bpy.utils.preset_paths(brush.SUBFOLDER)
    assert len(list(SHIPPED.glob("*.py"))) == 6


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.py")), ids=lambda file: file.stem)
def test_each_preset_sets_a_known_finger_and_every_setting(settings: Any, file: Path) -> None:
    bpy.context.object.digiclay.size = 40.0
    apply(file.stem)
    assert find_kind(finger_size.read_finger(bpy.context.object.digiclay)) in FINGERS.values()
    written = {line.split(" = ")[0] for line in file.read_text().splitlines() if " = " in line}
    assert set(brush.preset_values(settings)) <= written


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
