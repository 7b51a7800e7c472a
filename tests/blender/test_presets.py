"""Presets of a user's own: scene files that hold data and no code, saved whole or not at all."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import PRESETS, resolve
from digiclay.settings import own_presets, properties

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")


@pytest.fixture(autouse=True)
def no_presets() -> Iterator[None]:
    """Take the presets of a test away again."""
    yield
    for name in own_presets.names():
        own_presets.remove(name)


@pytest.fixture
def bed() -> Any:
    """A bed, active."""
    return new_bed()


def test_a_saved_preset_is_a_scene_file_of_all_parameters(bed: Any) -> None:
    bed.digiclay.valve.stroke = 0.041
    assert bpy.ops.digiclay.preset_save(name="Stiff clay") == {"FINISHED"}
    scene = load(own_presets.path("Stiff clay"))
    assert scene == dataclasses.replace(properties.scene_of(bed), name="Stiff clay")
    bed.digiclay.valve.stroke = 0.05
    bpy.ops.digiclay.preset_save(name="Stiff clay")  # replaces the former
    assert load(own_presets.path("Stiff clay")).valve.stroke == 50e-6
    assert [file.name for file in own_presets.folder().iterdir()] == ["Stiff clay.toml"]
    for name in ("Ärger über Öl", "a b", "v1.2"):
        bpy.ops.digiclay.preset_save(name=name)
        assert bpy.ops.digiclay.preset_apply(preset=name) == {"FINISHED"}
    assert set(own_presets.names()) == {"Stiff clay", "Ärger über Öl", "a b", "v1.2"}


def test_applying_a_preset_sets_everything_but_the_layout(bed: Any) -> None:
    table = {"layout": {"rows": 30}, "preset": "viscous", "control": {"method": "elastic", "stiffness": 33.0}}
    own_presets.save("Rubber", resolve(table))
    assert bpy.ops.digiclay.preset_apply(preset="Rubber") == {"FINISHED"}
    scene, wanted = properties.scene_of(bed), resolve({**table, "layout": {}}, bed.name)
    assert scene == wanted
    assert bed.digiclay.own_preset == "Rubber"


@pytest.mark.parametrize("name", PRESETS)
def test_applying_one_of_the_core_s_presets_changes_what_a_scene_file_would(name: str, bed: Any) -> None:
    assert bpy.ops.digiclay.preset_apply(preset=name) == {"FINISHED"}
    assert properties.scene_of(bed) == resolve({"preset": name, "control": {"ground": "cell"}}, bed.name)


@pytest.mark.parametrize(
    "name", ["", "  ", "paper", "Viscous", "../up", "a/b", ".hidden", "x" * 61, "a\nb", "what?", "end."]
)
def test_a_name_that_no_preset_can_have_is_refused(name: str, bed: Any) -> None:
    with pytest.raises(OutputError, match=r"^The preset's name must"):
        own_presets.save(name, properties.scene_of(bed))
    assert own_presets.names() == []


def test_removing_a_preset_leaves_the_bed_its_parameters(bed: Any) -> None:
    assert not bpy.ops.digiclay.preset_remove.poll(), "those that come along stay"
    bed.digiclay.valve.stroke = 0.041
    bpy.ops.digiclay.preset_save(name="Mine")
    assert bpy.ops.digiclay.preset_remove() == {"FINISHED"}
    assert own_presets.names() == []
    assert (bed.digiclay.own_preset, properties.scene_of(bed).valve.stroke) == ("", 41e-6)


@pytest.mark.parametrize(
    "content", [None, "", "valve = 3\n", "[valve]\nstroke = nan\n", "import os\n", "\x00"]
)
def test_a_preset_that_was_spoilt_or_is_gone_is_told_of_in_one_line(content: str | None, bed: Any) -> None:
    before = properties.scene_of(bed)
    own_presets.folder().mkdir(parents=True, exist_ok=True)
    if content is not None:
        own_presets.path("Spoilt").write_text(content)
    if content == "":  # an empty scene file is a whole scene
        assert bpy.ops.digiclay.preset_apply(preset="Spoilt") == {"FINISHED"}
        return
    with pytest.raises(RuntimeError, match=r"Spoilt\.toml") as caught:
        bpy.ops.digiclay.preset_apply(preset="Spoilt")
    assert "Traceback" not in str(caught.value)
    assert properties.scene_of(bed) == before


def test_a_folder_that_cannot_be_made_is_told_of(bed: Any) -> None:
    folder: Path = own_presets.folder()
    if folder.exists():
        folder.rmdir()
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("a file stands in the way")
    try:
        with pytest.raises(OutputError, match=r"^Cannot write .*Mine\.toml"):
            own_presets.save("Mine", properties.scene_of(bed))
    finally:
        os.unlink(folder)
