"""The zip: built and validated by this Blender's own tool, installed as a user does, and used."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import digiclay
import pytest

from tests.timeouts import TIMEOUT

HERE = Path(__file__).parent
TOOL = HERE.parents[1] / "tools" / "extension.py"
#: Packages that stand beside the extension.
BESIDE = ("benchmarks", "digiclay_paper", "digiclay_serve", "digiclay_study")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip, built by the tool of this Blender."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, str(TOOL), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode == 0, done.stderr
    (found,) = out.glob("*.zip")
    return found


@pytest.fixture(scope="module")
def seen(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a Blender of its own, with settings of its own, saw of the installed extension."""
    folder = tmp_path_factory.mktemp("used")
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(folder / "settings")}
    # Started elsewhere and without the checkout's path: it has the zip and nothing else of digiclay.
    environment.pop("PYTHONPATH", None)
    command = [sys.executable, "-P", str(HERE / "use_the_zip.py"), str(archive), str(folder)]
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    assert "Traceback" not in done.stderr
    result: dict[str, Any] = json.loads((folder / "seen.json").read_text())
    return result | {"files": sorted(file.name for file in folder.iterdir())}


def test_the_zip_has_the_package_and_trimesh_and_nothing_that_was_left_lying_about(archive: Path) -> None:
    with zipfile.ZipFile(archive) as zipped:
        names = zipped.namelist()
        manifest = tomllib.loads(zipped.read("blender_manifest.toml").decode())
    assert [f"./{name}" for name in names if name.endswith(".whl")] == manifest["wheels"]
    assert any("trimesh" in wheel for wheel in manifest["wheels"])
    shipped = {"LICENSE", "LICENSES/CC0-1.0.txt", "manual/guide.html", "sample_shapes/sessions/tap.toml"}
    assert {"__init__.py", "core/scene/schema.py", *shipped} <= set(names)
    assert [name for name in names if "__pycache__" in name or name.startswith(".")] == []
    assert archive.stat().st_size < 2e6
    assert archive.name == f"digiclay-{digiclay.__version__}.zip"


def test_no_benchmark_and_no_module_of_the_paper_or_the_studies_is_in_the_zip(archive: Path) -> None:
    files = [path for folder in BESIDE for path in (TOOL.parents[1] / folder).glob("*.py")]
    contents = {path.read_bytes() for path in files}
    assert len(contents) > 30
    with zipfile.ZipFile(archive) as zipped:
        assert [name for name in zipped.namelist() if zipped.read(name) in contents] == []


def test_the_tool_refuses_a_tag_blender_does_not_know(tmp_path: Path) -> None:
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
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    assert done.returncode != 0
    assert "Pottery" in done.stderr
    assert not (copy / "dist").exists()


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"installed": ["FINISHED"], "enabled": True}, "the zip installs and enables"),
        ({"bundled": 1, "imported at once": []}, "trimesh comes along and is not imported at once"),
        ({"added": ["FINISHED"], "scene": 36}, "the operator adds a bed with its settings"),
        ({"redraw rate": 24}, "the preferences are those Blender shows"),
        ({"own presets": [str(Path("presets", "Mine.toml"))]}, "presets stand in the extension's own folder"),
        ({"describe": 0, "run": 0, "export": 0, "render": 0}, "the command carries out"),
        ({"own method": "mine", "own run": 0}, "a method of one's own is offered and runs"),
        ({"own methods": [[], ["mine"]]}, "it goes and comes back with the extension"),
        ({"left behind": [], "added again": ["FINISHED"]}, "disabled it leaves nothing; it is enabled again"),
    ],
)
def test_in_a_blender_of_its_own(seen: dict[str, Any], wanted: dict[str, Any], words: str) -> None:
    assert {name: seen[name] for name in wanted} == wanted, words
    assert {"a tap", "surface.stl", "still.png"} <= set(seen["files"])


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("paper", "run 'pip install digiclay[plots]' first."),
        ("study", "run 'pip install digiclay[study]' first."),
        ("tune", "run 'pip install digiclay[study]' first."),
        ("benchmark", "'python -m benchmarks --help'"),
    ],
)
def test_the_command_says_in_a_line_what_it_lacks(command: str, said: str, seen: dict[str, Any]) -> None:
    code, told = seen[command]
    assert (code, told.count("\n"), said in told) == (2, 1, True)
