"""Enabling and disabling the extension, and its operators as a user runs them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge, command_line
from digiclay.core.base.errors import OutputError
from digiclay.device.instant import Instant
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
    first = footprint()
    assert {"MESH_OT_digital_clay_add", "IMPORT_SCENE_OT_digital_clay_run", "Object.digiclay"} <= first
    digiclay.unregister()
    assert footprint() == set()
    digiclay.register()
    assert footprint() == first
    digiclay.unregister()
    assert footprint() == set()


def test_the_command_of_blender_s_command_line_is_taken_back() -> None:
    digiclay.register()
    handle = command_line.COMMAND.handle
    digiclay.unregister()
    assert command_line.COMMAND.handle is None
    with pytest.raises(ValueError, match="already been removed"):
        bpy.utils.unregister_cli_command(handle)


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
