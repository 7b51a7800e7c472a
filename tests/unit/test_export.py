"""Mesh files: what was written is what other readers find."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from digiclay.core import export
from digiclay.core.errors import OutputError, ParameterError
from digiclay.core.layout import Layout, grid

BED = Layout(rows=7, columns=5, arrangement="hexagonal")
#: mm: files hold float32 or 8 decimals; half a unit in the last place at 50 mm is 2e-6 mm.
WRITTEN = 5e-6


@pytest.fixture
def mesh() -> trimesh.Trimesh:
    height = np.random.default_rng(3).uniform(0.03, 0.06, 35)
    return export.mesh(grid(BED).positions, height, BED.rows, BED.columns)


def corners(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Corners of every triangle, shape (f, 3, 3): independent of how a reader numbers the vertices."""
    return np.asarray(vertices)[np.asarray(faces)]


def test_the_mesh_is_watertight_consistently_wound_and_in_metres(mesh):
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    np.testing.assert_allclose(mesh.extents[:2], np.ptp(grid(BED).positions, axis=0), rtol=1e-12)


@pytest.mark.parametrize("name", ["stl", "obj", "ply"])
def test_meshio_reads_back_the_triangles_in_millimetres(mesh, tmp_path, name):
    path = export.write(mesh, tmp_path / f"surface.{name}")
    read = meshio.read(path)
    np.testing.assert_allclose(
        corners(read.points, read.cells_dict["triangle"]), mesh.triangles * 1e3, rtol=0.0, atol=WRITTEN
    )


@pytest.mark.parametrize("name", ["stl", "obj", "ply"])
def test_trimesh_reads_back_a_watertight_solid_in_millimetres(mesh, tmp_path, name):
    read = trimesh.load_mesh(export.write(mesh, tmp_path / f"surface.{name}"))
    assert read.is_watertight
    assert read.is_winding_consistent
    np.testing.assert_allclose(read.triangles, mesh.triangles * 1e3, rtol=0.0, atol=WRITTEN)
    # 1e-6: each vertex is off by 1e-7 of its coordinates at most.
    assert read.volume == pytest.approx(mesh.volume * 1e9, rel=1e-6)


@pytest.mark.parametrize("name", ["stl", "obj", "ply"])
def test_metres_are_written_when_asked_for(mesh, tmp_path, name):
    read = trimesh.load_mesh(export.write(mesh, tmp_path / f"surface.{name}", unit="m"))
    np.testing.assert_allclose(read.extents, mesh.extents, rtol=0.0, atol=2e-8)  # OBJ: 8 decimals


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_glb_is_in_metres_and_y_up_whatever_the_unit(mesh, tmp_path, unit):
    content = export.write(mesh, tmp_path / "surface.glb", unit=unit).read_bytes()
    assert content[:4] == b"glTF"
    description = json.loads(content[20 : 20 + struct.unpack("<I", content[12:16])[0]])
    position = description["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    found = description["accessors"][position]
    (low, high) = mesh.bounds
    # x stays, up is y, and the bed's y runs toward the viewer's back: minus z. float32 keeps 4e-9 m of 50 mm.
    np.testing.assert_allclose(found["min"], [low[0], low[2], -high[1]], rtol=0.0, atol=4e-9)
    np.testing.assert_allclose(found["max"], [high[0], high[2], -low[1]], rtol=0.0, atol=4e-9)


def test_a_glb_keeps_its_outside_outside(mesh, tmp_path):
    read = trimesh.load_mesh(export.write(mesh, tmp_path / "surface.glb"))
    assert read.is_watertight
    assert read.volume == pytest.approx(mesh.volume, rel=1e-6)  # float32; a mirrored one would be negative


def test_a_stl_is_binary(mesh, tmp_path):
    path = export.write(mesh, tmp_path / "surface.stl")
    assert path.stat().st_size == 84 + 50 * len(mesh.faces)


def test_writing_leaves_the_mesh_as_it_was(mesh, tmp_path):
    before = mesh.vertices.copy()
    export.write(mesh, tmp_path / "surface.stl")
    export.write(mesh, tmp_path / "surface.glb")
    np.testing.assert_array_equal(mesh.vertices, before)


def test_the_extension_may_be_in_capitals(mesh, tmp_path):
    assert export.write(mesh, tmp_path / "SURFACE.STL").stat().st_size > 84


def test_an_older_file_is_replaced_and_nothing_else_is_left(mesh, tmp_path):
    (tmp_path / "surface.stl").write_text("older")
    export.write(mesh, tmp_path / "surface.stl")
    assert [path.name for path in tmp_path.iterdir()] == ["surface.stl"]
    assert trimesh.load_mesh(tmp_path / "surface.stl").is_watertight


@pytest.mark.parametrize("name", ["surface.step", "surface", "stl"])
def test_an_unknown_format_is_refused_with_the_known_ones(mesh, tmp_path, name):
    with pytest.raises(OutputError, match=r"^Unknown mesh format '(step|)': known are stl, obj, ply, glb\.$"):
        export.write(mesh, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_an_unknown_unit_is_refused(mesh, tmp_path):
    with pytest.raises(ParameterError, match=r"^Export\.unit must be one of mm, m \(got 'inch'\)\.$"):
        export.write(mesh, tmp_path / "surface.stl", unit="inch")


@pytest.fixture
def without_root():
    """Root may write anywhere: be somebody else for a while."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.fixture
def read_only() -> Iterator[Path]:
    """A folder anybody may look into and nobody may change; pytest's own ones are closed to others."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o555)
        yield Path(name)


@pytest.mark.usefixtures("without_root")
def test_a_folder_that_cannot_be_written_is_one_line(mesh, read_only):
    with pytest.raises(OutputError, match=r"^Cannot write \S+surface\.stl: Permission denied\.$"):
        export.write(mesh, read_only / "surface.stl")


def test_a_folder_that_is_not_there_is_one_line(mesh, tmp_path):
    with pytest.raises(OutputError, match=r"^Cannot write \S+surface\.stl: No such file or directory\.$"):
        export.write(mesh, tmp_path / "missing" / "surface.stl")


def test_a_file_that_cannot_be_replaced_leaves_no_temporary_one(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match=r"^Cannot write \S+taken: "):
        export.write_whole(tmp_path / "taken", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def python(script: str) -> str:
    """Run a script in a fresh interpreter and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
        env=environment,
    )
    return done.stdout


def test_without_trimesh_it_says_what_to_install():
    script = (
        "import sys; sys.modules['trimesh'] = None\n"
        "from digiclay.core import errors, export\n"
        "try:\n    export.mesh([[0, 0], [1, 0], [0, 1], [1, 1]], [1, 1, 1, 1], 2, 2)\n"
        "except errors.OutputError as error:\n    print(error)\n"
    )
    assert python(script) == "Exporting a mesh needs trimesh: run 'pip install trimesh'.\n"


def test_trimesh_is_not_imported_before_it_is_needed():
    assert python("import sys, digiclay.core.export; print('trimesh' in sys.modules)") == "False\n"
