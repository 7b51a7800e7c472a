"""Exports that cannot be: one line, the older file as it was, and nothing half-written."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.files import run_folder
from digiclay.core.mesh_io import mesh_writer
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.formed import Body, Formed

from tests.timeouts import TIMEOUT


@pytest.fixture
def solid() -> list[Body]:
    bed = make_grid(Layout(rows=7, columns=5, arrangement="hexagonal"))
    return make_bodies(Formed.of(bed.positions, 0.04 + 0.3 * bed.x**2, 0.04, 0.0, 0), Model())


@pytest.mark.parametrize("name", ["surface.step", "surface", "stl"])
def test_an_unknown_format_is_refused_with_the_known_ones(solid, tmp_path, name):
    said = r"^Unknown mesh format '(step|)': known are stl, stl_ascii, obj, ply, glb, 3mf\.$"
    with pytest.raises(OutputError, match=said):
        mesh_writer.write(solid, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_an_unknown_unit_is_refused(solid, tmp_path):
    with pytest.raises(ParameterError, match=r"^Export\.unit must be one of mm, m \(got 'inch'\)\.$"):
        mesh_writer.write(solid, tmp_path / "surface.stl", unit="inch")


def test_nothing_is_not_written(tmp_path):
    with pytest.raises(OutputError, match=r"^There is nothing to write to \S+surface\.stl\.$"):
        mesh_writer.write([], tmp_path / "surface.stl")
    assert not list(tmp_path.iterdir())


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
def test_a_folder_that_cannot_be_written_is_one_line(solid, read_only):
    with pytest.raises(OutputError, match=r"^Cannot write \S+surface\.stl: Permission denied\.$"):
        mesh_writer.write(solid, read_only / "surface.stl")


def test_a_folder_that_is_not_there_is_one_line(solid, tmp_path):
    with pytest.raises(OutputError, match=r"^Cannot write \S+surface\.stl: No such file or directory\.$"):
        mesh_writer.write(solid, tmp_path / "missing" / "surface.stl")


def test_a_file_that_cannot_be_replaced_leaves_no_temporary_one(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match=r"^Cannot write \S+taken: "):
        run_folder.write_whole(tmp_path / "taken", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make a small disk")
@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_a_full_disk_keeps_the_older_file_and_leaves_no_other(tmp_path, kind):
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=True, timeout=TIMEOUT)
    try:
        path = disk / f"surface{mesh_writer.find_suffix(kind)}"
        path.write_bytes(b"older")
        bed = make_grid(Layout(rows=60, columns=60))
        random = np.random.default_rng(1).uniform(0.03, 0.06, 3600)  # does not deflate into 64 kB
        made = make_bodies(Formed.of(bed.positions, random, 0.04, 0.0, 0), Model())
        with pytest.raises(OutputError, match=r"^Cannot write .*: No space left on device\.$"):
            mesh_writer.write(made, path, kind=kind)
        assert [one.name for one in disk.iterdir()] == [path.name]
        assert path.read_bytes() == b"older"
    finally:
        subprocess.run(["umount", disk], check=True, timeout=TIMEOUT)


def test_an_export_that_is_stopped_leaves_nothing(solid, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("digiclay.core.mesh_io.mesh_writer._normals", stop)
    with pytest.raises(KeyboardInterrupt):
        mesh_writer.write(solid, tmp_path / "surface.stl")
    assert not list(tmp_path.iterdir())


def test_exporting_needs_numpy_alone():
    script = (
        "import sys; sys.modules['trimesh'] = None\n"
        "from digiclay.core.mesh_io import export_model\nfrom digiclay.core.surface import formed\n"
        "bed = formed.Formed.of([[0, 0], [1, 0], [0, 1], [1, 1]], [1, 1, 1, 2], 1, 0, 0)\n"
        "print(len(export_model.make_bodies(bed, export_model.Model())[0].faces))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=True,
        env=environment,
    )
    assert done.stdout == "12\n"
