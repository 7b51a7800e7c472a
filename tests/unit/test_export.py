"""Mesh files: what was written is what other readers find."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path

import lib3mf
import meshio
import numpy as np
import pytest
import trimesh
from digiclay.core.mesh_io import mesh_writer
from digiclay.core.mesh_io.export_model import Model, make_bodies
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import Body, Formed, compute_volume

BED = Layout(rows=7, columns=5, arrangement="hexagonal")
#: mm: files hold float32 or 6 decimals; half a unit in the last place at 50 mm is 2e-6 mm.
WRITTEN = 5e-6
#: Formats that meshio reads.
PLAIN = ["stl", "stl_ascii", "obj", "ply"]


@pytest.fixture
def formed() -> Formed:
    """A bed on which every pin has a height, a force and nearly a mode of its own."""
    random = np.random.default_rng(3)
    height, force = random.uniform(0.03, 0.06, 35), random.uniform(0.0, 1.0, 35)
    return Formed.of(make_grid(BED).positions, height, 0.04, force, np.arange(35) % 8)


@pytest.fixture
def solid(formed: Formed) -> list[Body]:
    return make_bodies(formed, Model())


def path_for(folder: Path, kind: str) -> Path:
    return folder / f"surface{mesh_writer.find_suffix(kind)}"


def corners(body: Body) -> np.ndarray:
    """Corners of every triangle, m, shape (f, 3, 3): independent of how a reader numbers the vertices."""
    return body.vertices[body.faces]


@pytest.mark.parametrize("kind", PLAIN)
def test_meshio_reads_back_the_triangles_in_millimeters(solid, tmp_path, kind):
    read = meshio.read(mesh_writer.write(solid, path_for(tmp_path, kind), kind=kind, up="z"))
    found = read.points[read.cells_dict["triangle"]]
    np.testing.assert_allclose(found, corners(solid[0]) * 1e3, rtol=0.0, atol=WRITTEN)


@pytest.mark.parametrize("kind", PLAIN)
def test_trimesh_reads_back_a_watertight_solid_in_millimeters(solid, tmp_path, kind):
    read = trimesh.load_mesh(mesh_writer.write(solid, path_for(tmp_path, kind), kind=kind))
    assert read.is_watertight
    assert read.is_winding_consistent
    # 1e-6: each vertex is off by 1e-7 of its coordinates at most.
    assert read.volume == pytest.approx(compute_volume(solid[0]) * 1e9, rel=1e-6)


@pytest.mark.parametrize("kind", PLAIN)
def test_meters_are_written_when_asked_for(solid, tmp_path, kind):
    read = trimesh.load_mesh(mesh_writer.write(solid, path_for(tmp_path, kind), "m", kind, up="z"))
    np.testing.assert_allclose(read.bounds[1], solid[0].vertices.max(axis=0), rtol=0.0, atol=5e-9)  # float32


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_glb_is_in_meters_and_y_up_whatever_the_unit(solid, tmp_path, unit):
    content = mesh_writer.write(solid, tmp_path / "surface.glb", unit=unit).read_bytes()
    assert content[:4] == b"glTF"
    description = json.loads(content[20 : 20 + struct.unpack("<I", content[12:16])[0]])
    position = description["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    found = description["accessors"][position]
    low, high = solid[0].vertices.min(axis=0), solid[0].vertices.max(axis=0)
    # x stays, up is y, and the bed's y runs toward the viewer's back: minus z. float32 keeps 4e-9 m of 50 mm.
    np.testing.assert_allclose(found["min"], [low[0], low[2], -high[1]], rtol=0.0, atol=4e-9)
    np.testing.assert_allclose(found["max"], [high[0], high[2], -low[1]], rtol=0.0, atol=4e-9)


def test_a_glb_keeps_its_outside_outside(solid, tmp_path):
    read = trimesh.load_mesh(mesh_writer.write(solid, tmp_path / "surface.glb"))
    assert read.is_watertight
    assert read.volume == pytest.approx(
        compute_volume(solid[0]), rel=1e-6
    )  # float32; a mirrored one is negative


def test_a_glb_has_a_named_node_for_each_feature(formed, tmp_path):
    made = make_bodies(formed, Model(kind="features"), Finding(smallest=1))
    scene = trimesh.load_scene(mesh_writer.write(made, tmp_path / "features.glb"))
    assert len(made) > 2
    assert set(scene.graph.nodes_geometry) == {body.name for body in made}


def test_a_3mf_names_its_unit_and_has_an_object_for_each_feature(formed, tmp_path):
    made = make_bodies(formed, Model(kind="features"), Finding(smallest=1))
    for unit, factor in (("mm", 1e3), ("m", 1.0)):
        path = mesh_writer.write(made, tmp_path / "features.3mf", unit=unit)
        model = lib3mf.Wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(True)
        reader.ReadFromFile(str(path))
        assert reader.GetWarningCount() == 0
        assert model.GetUnit() == {"mm": lib3mf.ModelUnit.MilliMeter, "m": lib3mf.ModelUnit.Meter}[unit]
        objects = model.GetMeshObjects()
        for body in made:
            assert objects.MoveNext()
            found = objects.GetCurrentMeshObject()
            assert found.GetName() == body.name
            assert found.IsManifoldAndOriented()
            points = np.array([list(one.Coordinates) for one in found.GetVertices()])
            np.testing.assert_allclose(points, body.vertices * factor, rtol=0.0, atol=WRITTEN * factor / 1e3)
            faces = np.array([list(one.Indices) for one in found.GetTriangleIndices()])
            np.testing.assert_array_equal(faces, body.faces)


def test_a_3mf_says_of_an_open_skin_that_it_is_a_surface(formed, tmp_path):
    path = mesh_writer.write(make_bodies(formed, Model(kind="surface")), tmp_path / "skin.3mf")
    with zipfile.ZipFile(path) as archive:
        assert b'type="surface"' in archive.read("3D/3dmodel.model")


def test_an_obj_has_a_group_for_each_feature(formed, tmp_path):
    made = make_bodies(formed, Model(), Finding(smallest=1))
    path = mesh_writer.write(made, tmp_path / "surface.obj")
    groups = [line.split()[1] for line in path.read_text().splitlines() if line.startswith("g ")]
    assert groups == ["rest", *made[0].groups]
    scene = trimesh.load_scene(path, split_groups=True, group_material=False)
    sizes = sorted(len(mesh.faces) for mesh in scene.geometry.values())
    assert sizes == sorted(np.bincount(made[0].group).tolist())


def test_a_ply_tells_height_force_and_mode_of_each_vertex(formed, solid, tmp_path):
    read = meshio.read(mesh_writer.write(solid, tmp_path / "surface.ply")).point_data
    n = len(formed.height)
    np.testing.assert_allclose(read["height"][:n], formed.height * 1e3, rtol=1e-7)  # float32
    np.testing.assert_allclose(read["force"][:n], formed.force, rtol=1e-7)
    np.testing.assert_array_equal(read["mode"][:n], formed.mode)
    assert set(read["mode"][n:]) == {-1}


def test_a_binary_stl_has_50_bytes_a_triangle(solid, tmp_path):
    path = mesh_writer.write(solid, tmp_path / "surface.stl")
    assert path.stat().st_size == 84 + 50 * len(solid[0].faces)


def test_a_text_stl_and_a_binary_one_do_not_share_a_name(solid, tmp_path):
    for kind in ("stl", "stl_ascii"):
        mesh_writer.write(solid, path_for(tmp_path, kind), kind=kind)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["surface.ascii.stl", "surface.stl"]
    assert (tmp_path / "surface.ascii.stl").read_text().startswith("solid clay\nfacet normal ")


@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_the_same_mesh_gives_the_same_bytes(solid, tmp_path, kind):
    one, other = (mesh_writer.write(solid, tmp_path / f"{name}.x", kind=kind).read_bytes() for name in "ab")
    assert one == other


@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_pieces_of_a_body_are_written_like_the_whole(solid, tmp_path, kind, monkeypatch):
    whole = mesh_writer.write(solid, tmp_path / "whole", kind=kind).read_bytes()
    monkeypatch.setattr("digiclay.core.surface.formed.PIECE", 7)
    assert mesh_writer.write(solid, tmp_path / "pieces", kind=kind).read_bytes() == whole


def test_writing_leaves_the_bodies_as_they_were(solid, tmp_path):
    before = solid[0].vertices.copy()
    for kind in mesh_writer.FORMATS:
        mesh_writer.write(solid, path_for(tmp_path, kind), kind=kind)
    np.testing.assert_array_equal(solid[0].vertices, before)


def test_the_extension_may_be_in_capitals(solid, tmp_path):
    assert mesh_writer.write(solid, tmp_path / "SURFACE.STL").stat().st_size > 84


@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_a_path_may_have_blanks_and_umlauts(solid, tmp_path, kind):
    folder = tmp_path / "für später 粘土"
    folder.mkdir()
    assert (
        mesh_writer.write(solid, folder / f"gewölbte Fläche 1{mesh_writer.find_suffix(kind)}", kind=kind)
        .stat()
        .st_size
    )


def test_an_older_file_is_replaced_and_nothing_else_is_left(solid, tmp_path):
    (tmp_path / "surface.stl").write_text("older")
    mesh_writer.write(solid, tmp_path / "surface.stl")
    assert [path.name for path in tmp_path.iterdir()] == ["surface.stl"]
    assert trimesh.load_mesh(tmp_path / "surface.stl").is_watertight
