"""Enabling and disabling the extension, its import as a user runs it, and its preferences."""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge, command_line, preferences
from digiclay.bridge import linear
from digiclay.core.base.errors import OutputError
from digiclay.core.base.modes import Mode
from digiclay.device import palettes
from digiclay.device.instant import Instant
from digiclay.device.parts import ROLE
from digiclay.settings import properties

#: Positions are float32 and drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23
MANIFEST = Path(digiclay.__file__).with_name("blender_manifest.toml")


def ours(functions: Iterable[Any]) -> int:
    """Count the functions that are of this package."""
    return sum(getattr(function, "__module__", "").startswith("digiclay") for function in functions)


def footprint() -> set[str]:
    """Return what of the extension is to be found in Blender: types, properties, entries, handlers."""
    types = {name: getattr(bpy.types, name) for name in dir(bpy.types)}
    found = {name for name in types if "digi" in name.lower()}
    drawn = {name: getattr(getattr(kind, "draw", None), "_draw_funcs", ()) for name, kind in types.items()}
    found |= {f"{ours(functions)} in {name}" for name, functions in drawn.items() if ours(functions)}
    owners = {"Object": bpy.types.Object, "Scene": bpy.types.Scene, "WindowManager": bpy.types.WindowManager}
    found |= {f"{name}.{key}" for name, kind in owners.items() for key in dir(kind) if "digi" in key}
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    handlers = {name: each for name, each in lists.items() if isinstance(each, list)}
    return found | {f"{ours(each)} in {name}" for name, each in handlers.items() if ours(each)}


def test_the_extension_registers_unregisters_and_registers_again_without_a_trace() -> None:
    assert footprint() == set()
    digiclay.register()
    first, command = footprint(), command_line.COMMAND.handle
    assert {"MESH_OT_digital_clay_add", "IMPORT_SCENE_OT_digital_clay_run", "Object.digiclay"} <= first
    digiclay.unregister()
    assert (footprint(), command_line.COMMAND.handle) == (set(), None)
    with pytest.raises(ValueError, match="already been removed"):
        bpy.utils.unregister_cli_command(command)
    digiclay.register()
    assert footprint() == first
    digiclay.unregister()
    assert footprint() == set()


def test_importing_the_package_imports_nothing_heavy_and_registers_nothing() -> None:
    heavy = "{'bpy', 'numpy', 'trimesh'}"
    script = f"import digiclay, sys; print(sorted({heavy} & {{name.split('.')[0] for name in sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=MANIFEST.parents[1], capture_output=True, text=True
    )
    assert done.stdout == "[]\n", done.stderr


@pytest.mark.usefixtures("extension")
def test_an_imported_run_has_its_settings_and_shows_the_row_asked_for(
    tmp_path: Path, formed: Instant
) -> None:
    heights = np.stack([formed.height, formed.height[::-1]])
    scene = 'control = "absent"\n[layout]\nrows = 6\ncolumns = 8\narrangement = "staggered"\n'
    scene += "[valve]\nstroke = 41e-6\n"
    (tmp_path / "scene.toml").write_text(scene)
    np.savez(
        tmp_path / "history.npz",
        time=np.array([0.0, 0.005]),
        position=formed.position,
        height=heights,
        mode=np.stack([formed.mode] * 2),
        force=np.stack([formed.force] * 2),
        fingertip=np.stack([formed.fingertip] * 2),
    )
    path = str(tmp_path / "history.npz")
    for row, wanted in ((0, heights[0]), (-1, heights[1])):
        assert bpy.ops.import_scene.digital_clay_run(filepath=path, row=row) == {"FINISHED"}
        cells = bridge.read_cells(bpy.context.object.data)
        np.testing.assert_allclose(cells["height"], wanted, rtol=0, atol=FLOAT32)
    assert properties.scene_of(bpy.context.object).valve.stroke == 41e-6


@pytest.mark.parametrize("row", [2, -3])
def test_a_row_the_history_does_not_have_is_refused(row: int, formed: Instant) -> None:
    names = ("height", "mode", "force", "fingertip")
    history = {name: np.stack([getattr(formed, name)] * 2) for name in names}
    with pytest.raises(OutputError, match=r"2 rows, 0 to 1 \(got -?\d\)"):
        Instant.of(history | {"position": formed.position}, row)


@pytest.mark.usefixtures("extension")
@pytest.mark.parametrize("content", [None, b"", b"not a run"])
def test_a_file_that_is_no_run_is_refused_in_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "history.npz"
    (tmp_path / "scene.toml").write_text("")
    if content is not None:
        path.write_bytes(content)
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=r"history\.npz") as caught:
        bpy.ops.import_scene.digital_clay_run(filepath=str(path))
    assert "Traceback" not in str(caught.value)
    assert len(bpy.data.objects) == before


#: What is left of linear light to people without one kind of cone (Machado, Oliveira and Fernandes 2009).
VISION = {
    "all cones": np.eye(3),
    "no red cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no blue cones": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
#: From linear light to CIE XYZ, white at 1.
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
) / np.array([[0.95047], [1.0], [1.08883]])


def lab(light: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* of linear light."""
    x, y, z = (np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in XYZ @ light)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def mode_color(mode: Mode) -> tuple[float, ...]:
    """Return the linear color the pins of a mode have in the viewport."""
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == mode.name.lower())
    return tuple(material.diffuse_color)


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("name", palettes.PALETTES)
def test_any_two_modes_look_different_with_any_color_vision(name: str, vision: str) -> None:
    seen = [
        lab(np.clip(VISION[vision] @ linear(color)[:3], 0.0, 1.0))
        for color in palettes.PALETTES[name].values()
    ]
    # A difference of 2.3 is just noticeable side by side; 10 is told apart at a glance.
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) > 10.0


@pytest.mark.usefixtures("extension")
def test_a_palette_recolors_the_beds_of_the_file() -> None:
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    palettes.set_palette("tol_muted")
    for mode, color in palettes.PALETTES["tol_muted"].items():
        # float32 numbers up to 1.
        np.testing.assert_allclose(mode_color(mode), linear(color), rtol=0, atol=1e-6)


@pytest.mark.usefixtures("extension")
def test_a_second_bed_leaves_colors_the_user_has_changed() -> None:
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == "rest")
    material.diffuse_color = (1.0, 0.0, 0.0, 1.0)
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    assert mode_color(Mode.REST) == (1.0, 0.0, 0.0, 1.0)


def test_a_palette_in_a_file_without_a_bed_does_nothing() -> None:
    before = len(bpy.data.materials)
    palettes.set_palette("brightness")
    assert (palettes.has_palette(), len(bpy.data.materials)) == (False, before)


@pytest.mark.usefixtures("extension")
def test_where_the_package_is_not_enabled_the_preferences_are_the_defaults_of_the_properties() -> None:
    assert preferences.get(bpy.context) == preferences.defaults()
    shown = preferences.Preferences.bl_rna.properties
    for name, value in vars(preferences.defaults()).items():
        assert shown[name].default == value


def test_what_fails_to_register_leaves_nothing_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    from digiclay import panels

    def refuse() -> None:
        raise RuntimeError("refused")

    monkeypatch.setattr(panels, "register", refuse)
    with pytest.raises(RuntimeError, match="refused"):
        digiclay.register()
    assert not hasattr(bpy.types.Object, "digiclay")
    assert "MESH_OT_digital_clay_add" not in dir(bpy.types)
