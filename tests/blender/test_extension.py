"""Enabling and disabling the extension, its import, its preferences, and its zip in a Blender of its own."""

import itertools
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge, command_line, preferences
from digiclay.bridge import linear
from digiclay.core.base.errors import OutputError
from digiclay.core.base.modes import WAITING, Mode
from digiclay.device import palettes
from digiclay.device.instant import Instant
from digiclay.roles import ROLE
from digiclay.settings import properties

from tests.assemble import assert_near
from tests.timeouts import TIMEOUT

#: Positions are float32 and drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


def ours(functions):
    return sum(getattr(function, "__module__", "").startswith("digiclay") for function in functions)


def footprint():
    """Return what of the extension is to be found in Blender: types, properties, entries, handlers."""
    types = {name: getattr(bpy.types, name) for name in dir(bpy.types)}
    found = {name for name in types if "digi" in name.lower()}
    drawn = {
        name: getattr(getattr(kind, "draw", None), "_draw_funcs", ())
        for name, kind in types.items()
    }
    found |= {
        f"{ours(functions)} in {name}" for name, functions in drawn.items() if ours(functions)
    }
    owners = {
        "Object": bpy.types.Object,
        "Scene": bpy.types.Scene,
        "WindowManager": bpy.types.WindowManager,
    }
    found |= {
        f"{name}.{key}" for name, kind in owners.items() for key in dir(kind) if "digi" in key
    }
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    handlers = {name: each for name, each in lists.items() if isinstance(each, list)}
    return found | {f"{ours(each)} in {name}" for name, each in handlers.items() if ours(each)}


def test_the_extension_registers_unregisters_and_registers_again_without_a_trace():
    assert footprint() == set()
    digiclay.register()
    first, command = footprint(), command_line.COMMAND.handle
    assert {
        "MESH_OT_digital_clay_add",
        "IMPORT_SCENE_OT_digital_clay_run",
        "Object.digiclay",
    } <= first
    digiclay.unregister()
    assert (footprint(), command_line.COMMAND.handle) == (set(), None)
    with pytest.raises(ValueError, match="already been removed"):
        bpy.utils.unregister_cli_command(command)
    digiclay.register()
    assert footprint() == first
    digiclay.unregister()
    assert footprint() == set()


@pytest.mark.usefixtures("extension")
def test_an_imported_run_has_its_settings_and_shows_the_row_asked_for(tmp_path, formed):
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
        fingertip=np.concatenate([formed.fingertip] * 2),
    )
    path = str(tmp_path / "history.npz")
    for row, wanted in ((0, heights[0]), (-1, heights[1])):
        assert bpy.ops.import_scene.digital_clay_run(filepath=path, row=row) == {"FINISHED"}
        cells = bridge.read_cells(bpy.context.object.data)
        assert_near(cells["height"], wanted, FLOAT32)
    assert properties.scene_of(bpy.context.object).valve.stroke == 41e-6


@pytest.mark.parametrize("row", [2, -3])
def test_a_row_the_history_does_not_have_is_refused(row, formed):
    names = ("height", "mode", "force", "fingertip")
    history = {name: np.stack([getattr(formed, name)] * 2) for name in names}
    with pytest.raises(OutputError, match=r"2 rows, 0 to 1 \(got -?\d\)"):
        Instant.of(history | {"position": formed.position}, row)


@pytest.mark.usefixtures("extension")
@pytest.mark.parametrize("content", [None, b"", b"not a run"])
def test_a_file_that_is_no_run_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "history.npz"
    (tmp_path / "scene.toml").write_text("")
    if content is not None:
        path.write_bytes(content)
    before = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=r"history\.npz") as caught:
        bpy.ops.import_scene.digital_clay_run(filepath=str(path))
    assert "Traceback" not in str(caught.value)
    assert len(bpy.data.objects) == before


#: What is left of linear light to people without one kind of cone (Machado, Oliveira and Fernandes
#: 2009).
VISION = {
    "all cones": np.eye(3),
    "no red cones": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "no green cones": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "no blue cones": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}
#: From linear light to CIE XYZ, white at 1.
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
) / np.array([[0.95047], [1.0], [1.08883]])


def lab(light):
    x, y, z = (np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in XYZ @ light)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def mode_color(mode):
    """Return the linear color the pins of a mode have in the viewport."""
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == mode.name.lower())
    return tuple(material.diffuse_color)


#: Colors that are seen together, and how far apart in Lab each two are at least: a difference of
#: 2.3 is just noticeable side by side, 10 is told apart at a glance.
SETS = {
    **{
        name: ((*palette.values(), WAITING), len(Mode) + 1, 10.0)
        for name, palette in palettes.PALETTES.items()
    },
    "fingertips": (palettes.FINGERS, 10, 15.5),
}


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("name", SETS)
def test_any_two_modes_or_fingertips_look_different_with_any_color_vision(name, vision):
    colors, count, least = SETS[name]
    seen = [lab(np.clip(VISION[vision] @ linear(color)[:3], 0.0, 1.0)) for color in colors]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)]
    assert (len(seen), min(apart) > least) == (count, True)


@pytest.mark.usefixtures("extension")
def test_a_palette_recolors_the_beds_of_the_file_and_a_second_bed_leaves_colors_the_user_has_changed():
    before = len(bpy.data.materials)
    palettes.set_palette("brightness")  # without a bed
    assert (palettes.has_palette(), len(bpy.data.materials)) == (False, before)
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    palettes.set_palette("tol_muted")
    for mode, color in palettes.PALETTES["tol_muted"].items():
        # float32 numbers up to 1.
        assert_near(mode_color(mode), linear(color), 1e-6)
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == "rest")
    material.diffuse_color = (1.0, 0.0, 0.0, 1.0)
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    assert mode_color(Mode.REST) == (1.0, 0.0, 0.0, 1.0)


@pytest.mark.usefixtures("extension")
def test_where_the_package_is_not_enabled_the_preferences_are_the_defaults_of_the_properties():
    assert preferences.get(bpy.context) == preferences.defaults()
    shown = preferences.Preferences.bl_rna.properties
    for name, value in vars(preferences.defaults()).items():
        assert shown[name].default == value


def test_what_fails_to_register_leaves_nothing_registered(monkeypatch):
    from digiclay import panels

    def refuse():
        raise RuntimeError("refused")

    monkeypatch.setattr(panels, "register", refuse)
    with pytest.raises(RuntimeError, match="refused"):
        digiclay.register()
    assert not hasattr(bpy.types.Object, "digiclay")
    assert "MESH_OT_digital_clay_add" not in dir(bpy.types)


HERE = Path(__file__).parent
TOOL = HERE.parents[1] / "tools" / "extension.py"
#: Packages that stand beside the extension.
BESIDE = ("benchmarks", "digiclay_fit", "digiclay_paper", "digiclay_serve", "digiclay_study")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, str(TOOL), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    (found,) = out.glob("*.zip")
    return found


@pytest.fixture(scope="module")
def seen(archive, tmp_path_factory):
    """What a Blender of its own, with settings of its own, saw of the installed extension."""
    folder = tmp_path_factory.mktemp("used")
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(folder / "settings")}
    # Started elsewhere and without the checkout's path: it has the zip and nothing else of
    # digiclay.
    environment.pop("PYTHONPATH", None)
    command = [sys.executable, "-P", str(HERE / "use_the_zip.py"), str(archive), str(folder)]
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, encoding="utf-8", timeout=TIMEOUT
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    assert "Traceback" not in done.stderr
    result = json.loads((folder / "seen.json").read_text())
    return result | {"files": sorted(file.name for file in folder.iterdir())}


def test_no_benchmark_and_no_module_of_the_paper_or_the_studies_is_in_the_zip(archive):
    files = [path for folder in BESIDE for path in (TOOL.parents[1] / folder).glob("*.py")]
    contents = {path.read_bytes() for path in files}
    assert len(contents) > 30
    with zipfile.ZipFile(archive) as zipped:
        assert [name for name in zipped.namelist() if zipped.read(name) in contents] == []


def test_the_tool_refuses_a_tag_blender_does_not_know(tmp_path):
    """The tags are looked at: they go unchecked unless the tool is told where they stand."""
    copy = tmp_path / "checkout"
    for name in ("addon", "tools", "requirements", "LICENSE", "LICENSES"):
        source = TOOL.parents[1] / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / name)
    subprocess.run(["git", "init", "-q", str(copy)], check=True)
    wheels = TOOL.parents[1] / "build" / "wheels"
    if wheels.is_dir():
        shutil.copytree(wheels, copy / "build" / "wheels")
    manifest = copy / "addon" / "digiclay" / "blender_manifest.toml"
    manifest.write_text(manifest.read_text().replace('"Modeling"', '"Pottery"'))
    command = [sys.executable, str(copy / "tools" / "extension.py")]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=TIMEOUT)
    assert done.returncode != 0
    assert "Pottery" in done.stderr
    assert not (copy / "dist").exists()


@pytest.mark.parametrize(
    "wanted, words",
    [
        ({"installed": ["FINISHED"], "enabled": True}, "the zip installs and enables"),
        ({"bundled": 1, "imported at once": []}, "trimesh comes along and is not imported at once"),
        ({"added": ["FINISHED"], "scene": 36}, "the operator adds a bed with its settings"),
        ({"redraw rate": 24}, "the preferences are those Blender shows"),
        (
            {"own presets": [str(Path("presets", "Mine.toml"))]},
            "presets stand in the extension's own folder",
        ),
        ({"describe": 0, "run": 0, "export": 0, "render": 0}, "the command carries out"),
        ({"own method": "mine", "own run": 0}, "a method of one's own is offered and runs"),
        ({"own methods": [[], ["mine"]]}, "it goes and comes back with the extension"),
        (
            {"left behind": [], "added again": ["FINISHED"]},
            "disabled it leaves nothing; it is enabled again",
        ),
    ],
)
def test_in_a_blender_of_its_own(seen, wanted, words):
    assert {name: seen[name] for name in wanted} == wanted, words
    assert {"a tap", "surface.stl", "still.png"} <= set(seen["files"])


@pytest.mark.parametrize(
    "command, said",
    [
        ("paper", "run 'pip install digiclay[plots]' first."),
        ("study", "run 'pip install digiclay[study]' first."),
        ("tune", "run 'pip install digiclay[study]' first."),
        ("benchmark", "'python -m benchmarks --help'"),
    ],
)
def test_the_command_says_in_a_line_what_it_lacks(command, said, seen):
    code, told = seen[command]
    assert (code, told.count("\n"), said in told) == (2, 1, True)
