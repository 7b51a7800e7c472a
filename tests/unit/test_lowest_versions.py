"""The lowest versions of libraries that pyproject.toml allows: meshes are read as with ours."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import trimesh
from digiclay.core.mesh_io.mesh_reader import read

from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
LOWEST = ROOT / "requirements" / "lowest.txt"
#: Reads the files it is given, and says what is in them.
SCRIPT = """
import json, sys
from pathlib import Path
import trimesh
from digiclay.core.mesh_io.mesh_reader import read
found = {name: [read(Path(name)).vertices.tolist(), read(Path(name)).faces.tolist()] for name in sys.argv[1:]}
print(json.dumps({"version": trimesh.__version__, "where": trimesh.__file__, "found": found}))
"""


def wheels() -> list[Path]:
    """Return the wheels of the lowest versions, which are fetched once."""
    spec = importlib.util.spec_from_file_location("extension", ROOT / "tools" / "extension.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return list(module.wheels(LOWEST))


def test_the_lowest_versions_are_those_of_the_package() -> None:
    pins = dict(re.findall(r"^([\w-]+)==(\d+)[\d.]*$", LOWEST.read_text(encoding="utf-8"), re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bounds = dict(re.findall(r"([\w-]+)>=(\d+)", " ".join(project["dependencies"])))
    assert pins == {"trimesh": bounds["trimesh"]}


def test_meshes_are_read_with_the_lowest_trimesh_as_with_ours(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=10.0)
    for name in ("ball.stl", "ball.ply", "ball.off"):
        ball.export(tmp_path / name)
    (tmp_path / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(ball), encoding="ascii")
    (tmp_path / "text.ply").write_bytes(ball.export(file_type="ply", encoding="ascii"))
    files = sorted(tmp_path.glob("*.*"))
    for wheel in wheels():
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(tmp_path / "lowest")
    own = f"import sys; sys.path[:0] = [{str(tmp_path / 'lowest')!r}, {str(ROOT / 'addon')!r}]"
    ran = subprocess.run(
        [sys.executable, "-c", own + SCRIPT, *map(str, files)],
        capture_output=True, text=True, timeout=TIMEOUT, check=True,
    )  # fmt: skip
    told = json.loads(ran.stdout)
    assert told["version"] == "5.0.0"
    assert Path(told["where"]).is_relative_to(tmp_path)
    for file in files:
        here, there = read(file), told["found"][str(file)]
        np.testing.assert_array_equal(here.vertices, there[0], err_msg=file.name)
        np.testing.assert_array_equal(here.faces, there[1], err_msg=file.name)
