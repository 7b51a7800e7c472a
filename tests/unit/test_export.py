"""Meshes of each kind and their files: what was written is what other readers find."""

import json
import os
import struct
import subprocess
import zipfile

import lib3mf
import meshio
import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.files import run_folder
from digiclay.core.mesh_io import mesh_reader, mesh_writer
from digiclay.core.mesh_io.export_model import KINDS, Model, make_bodies
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import NO_PIN, PIECE, Formed, make_formed
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.__main__ import main
from benchmarks.bed_size import export
from tests.assemble import assert_near
from tests.timeouts import TIMEOUT

BED = Layout(rows=7, columns=5, arrangement="hexagonal")
#: mm: files hold float32 or 6 decimals; half a unit in the last place at 50 mm is 2e-6 mm.
WRITTEN = 5e-6
#: Formats that meshio reads.
PLAIN = ["stl", "stl_ascii", "obj", "ply"]


@pytest.fixture
def formed():
    """A bed on which every pin has a height, a force and nearly a mode of its own."""
    random = np.random.default_rng(3)
    height, force = random.uniform(0.03, 0.06, 35), random.uniform(0.0, 1.0, 35)
    return Formed.of(make_grid(BED).positions, height, 0.04, force, np.arange(35) % 8)


@pytest.fixture
def solid(formed):
    return make_bodies(formed, Model())


def path_for(folder, kind):
    return folder / f"surface{mesh_writer.find_suffix(kind)}"


def mesh(body):
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


@pytest.mark.parametrize("kind", PLAIN)
def test_meshio_reads_back_the_triangles_in_millimeters(solid, tmp_path, kind):
    path_for(tmp_path, kind).write_text("older")
    read = meshio.read(mesh_writer.write(solid, path_for(tmp_path, kind), kind=kind, up="z"))
    assert list(tmp_path.iterdir()) == [path_for(tmp_path, kind)]
    # Corners of every triangle: independent of how a reader numbers the vertices.
    found, known = read.points[read.cells_dict["triangle"]], solid[0].vertices[solid[0].faces] * 1e3
    assert_near(found, known, WRITTEN)


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_glb_is_in_meters_and_y_up_whatever_the_unit_with_a_named_node_for_each_feature(
    formed, tmp_path, unit
):
    made = make_bodies(formed, Model(kind="features"), Finding(smallest=1))
    path = mesh_writer.write(made, tmp_path / "features.glb", unit=unit)
    scene, content = trimesh.load_scene(path), path.read_bytes()
    assert len(made) > 2
    assert set(scene.graph.nodes_geometry) == {body.name for body in made}
    # 1e-6: each vertex is off by 1e-7 of its coordinates at most; a mirrored one is negative.
    assert scene.volume == pytest.approx(sum(mesh(body).volume for body in made), rel=1e-6)
    tree = json.loads(content[20 : 20 + struct.unpack("<I", content[12:16])[0]])
    places = [accessor for accessor in tree["accessors"] if accessor["type"] == "VEC3"]
    for body, found in zip(made, places, strict=True):
        x, y, z = body.vertices.T
        upright = np.column_stack([x, z, -y])  # float32 keeps 4e-9 m of 50 mm
        assert_near([found["min"], found["max"]], [upright.min(axis=0), upright.max(axis=0)], 4e-9)


def test_a_3mf_names_its_unit_has_an_object_for_each_feature_and_says_what_is_an_open_surface(
    formed, tmp_path
):
    path = mesh_writer.write(make_bodies(formed, Model(kind="surface")), tmp_path / "skin.3mf")
    with zipfile.ZipFile(path) as archive:
        assert b'type="surface"' in archive.read("3D/3dmodel.model")
    made = make_bodies(formed, Model(kind="features"), Finding(smallest=1))
    meters, millimeters = lib3mf.ModelUnit.Meter, lib3mf.ModelUnit.MilliMeter
    for unit, factor, named in (("mm", 1e3, millimeters), ("m", 1.0, meters)):
        path = mesh_writer.write(made, tmp_path / "features.3mf", unit=unit)
        model = lib3mf.Wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(True)
        reader.ReadFromFile(str(path))
        assert reader.GetWarningCount() == 0
        assert model.GetUnit() == named
        objects = model.GetMeshObjects()
        for body in made:
            assert objects.MoveNext()
            found = objects.GetCurrentMeshObject()
            assert found.GetName() == body.name
            assert found.IsManifoldAndOriented()
            points = np.array([list(one.Coordinates) for one in found.GetVertices()])
            assert_near(points, body.vertices * factor, WRITTEN * factor / 1e3)
            faces = np.array([list(one.Indices) for one in found.GetTriangleIndices()])
            assert_array_equal(faces, body.faces)


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
    assert_allclose(read["height"][:n], formed.height * 1e3, rtol=1e-7)  # float32
    assert_allclose(read["force"][:n], formed.force, rtol=1e-7)
    assert_array_equal(read["mode"][:n], formed.mode)
    assert set(read["mode"][n:]) == {-1}


@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_the_same_mesh_gives_the_same_bytes_whatever_its_path_or_its_pieces(
    solid, tmp_path, kind, monkeypatch
):
    before, folder = solid[0].vertices.copy(), tmp_path / "für später 粘土"
    folder.mkdir()
    whole = mesh_writer.write(
        solid, path_for(folder, kind).with_stem("gewölbte Fläche 1"), kind=kind
    )
    monkeypatch.setattr("digiclay.core.surface.formed.PIECE", 7)
    assert (
        mesh_writer.write(solid, tmp_path / "PIECES.STL", kind=kind).read_bytes()
        == whole.read_bytes()
    )
    assert_array_equal(solid[0].vertices, before)


KNOWN = rf"known are {', '.join(mesh_writer.FORMATS)}\.$"


@pytest.mark.parametrize(
    "count, name, unit, said",
    [
        (1, "surface.step", "mm", rf"^Unknown mesh format 'step': {KNOWN}"),
        (1, "surface.stl", "inch", r"^Export\.unit must be one of mm, m \(got 'inch'\)\.$"),
        (0, "surface.stl", "mm", r"^There is nothing to write to \S+surface\.stl\.$"),
        (
            1,
            "missing/surface.stl",
            "mm",
            r"^Cannot write \S+surface\.stl: No such file or directory\.$",
        ),
    ],
)
def test_what_cannot_be_written_is_refused(solid, tmp_path, count, name, unit, said):
    with pytest.raises((OutputError, ParameterError), match=said):
        mesh_writer.write(solid[:count], tmp_path / name, unit=unit)
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_replaced_leaves_no_temporary_one(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match=r"^Cannot write \S+taken: "):
        run_folder.write_whole(tmp_path / "taken", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_an_export_that_is_stopped_leaves_nothing(solid, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("digiclay.core.mesh_io.mesh_writer._triangles", stop)
    with pytest.raises(KeyboardInterrupt):
        mesh_writer.write(solid, tmp_path / "surface.stl")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make a small disk")
@pytest.mark.parametrize("kind", mesh_writer.FORMATS)
def test_a_full_disk_keeps_the_older_file_and_leaves_no_other(tmp_path, kind):
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=True, timeout=TIMEOUT
    )
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


def uneven(arrangement="aligned"):
    """A boss, a crease, level ground between them; every pin with a force and a mode of its own."""
    place = make_grid(Layout(rows=12, columns=14, arrangement=arrangement)).positions
    x, y = place.T * 1e3
    raised = 5.0 * np.exp(-((x + 9) ** 2 + y**2) / 20.0) - 4.0 * np.exp(
        -((x - 9) ** 2 + y**2) / 20.0
    )
    force, mode = np.arange(168) / 100.0, np.arange(168) % 8
    return Formed.of(place, 0.04 + raised * 1e-3, 0.04, force, mode)


#: Pins have no skin; between shifted rows each skin has rules of its own.
KINDS_AND_SKINS = [("pins", "bilinear")] + [
    (kind, skin) for kind in KINDS if kind != "pins" for skin in ("bilinear", "smooth", "membrane")
]


def touching(arrangement):
    """Two ridges with mounds on them, one up and one down, askew to the pins."""
    place = make_grid(Layout(rows=26, columns=25, arrangement=arrangement)).positions
    x, y = (place * 1e3 + [1.3, -0.7]).T
    along, aside = 0.8 * x + 0.6 * y, 0.8 * y - 0.6 * x
    off = np.abs(aside) - 12.0
    ridge = 12.0 - 0.25 * (np.clip(np.abs(along) - 16.0, 0.0, None) ** 2 + off**2)
    mound = 24.0 - 0.3 * ((along - 14.0) ** 2 + off**2)
    raised = np.sign(aside) * np.clip(np.maximum(ridge, mound), 0.0, None)
    return Formed.of(place, 0.04 + raised * 1e-3, 0.04, 0.0, 0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize("kind, skin", KINDS_AND_SKINS)
def test_every_kind_is_consistent_and_all_but_the_skin_are_watertight_after_welding_too(
    tmp_path, kind, skin, arrangement
):
    made = make_bodies(touching(arrangement), Model(kind=kind, skin=skin, resolution=2))
    assert len(made) == (4 if kind == "features" else 1)
    for body in made:
        assert mesh(body).is_watertight == body.closed == (kind != "surface")
        assert mesh(body).is_winding_consistent
        assert mesh(body).volume > 0.0 or kind == "surface"
    formats = mesh_writer.FORMATS if (skin, arrangement) == ("bilinear", "aligned") else ("stl",)
    for name in formats if kind != "surface" else ():
        path = mesh_writer.write(
            made, tmp_path / f"welded{mesh_writer.find_suffix(name)}", kind=name
        )
        read = mesh_reader.read(path)
        welded = trimesh.Trimesh(read.vertices.astype(np.float32), read.faces, process=False)
        welded.merge_vertices()
        _, counts = np.unique(welded.edges_sorted, axis=0, return_counts=True)
        assert set(counts) == {2}, name


@pytest.mark.parametrize("kind", KINDS)
def test_every_vertex_knows_height_force_and_mode_and_the_base_that_it_belongs_to_no_pin(kind):
    bed = uneven()
    for body in make_bodies(bed, Model(kind=kind)):
        height, force, mode = body.values.values()
        assert tuple(body.values) == ("height", "force", "mode")
        assert_array_equal(height, body.vertices[:, 2])
        assert set(np.unique(mode)) <= {NO_PIN, *range(8)}
        assert 0.0 <= force.min() <= force.max() <= bed.force.max()
        if kind != "features":  # pin tops first
            assert_array_equal([force[:168], mode[:168]], [bed.force, bed.mode])
        if kind in ("solid", "pins"):
            assert_array_equal(mode == NO_PIN, height == height.min())


def test_all_of_a_pins_top_has_its_values_and_a_skin_of_too_many_points_is_refused():
    place, steps = uneven().position, np.random.default_rng(4).permutation(168)
    (body,) = make_bodies(
        Formed.of(place, 0.04 + 1e-4 * steps, 0.04, steps / 100.0, 0), Model(kind="pins")
    )
    over = body.values["mode"] != NO_PIN
    assert over.sum() > 4 * 168
    # Each height is that of one pin, and its force is a hundredth of the steps it is up.
    up = np.rint((body.vertices[over, 2] - 0.04) / 1e-4)
    assert_near(body.values["force"][over], up / 100.0, 1e-12)
    place = make_grid(Layout(rows=400, columns=400)).positions
    bed = Formed.of(place, np.full(160_000, 0.04), 0.04, 0.0, 0)
    with pytest.raises(
        ParameterError, match=r"^Model\.resolution must be low enough for 50 million points"
    ):
        make_bodies(bed, Model(resolution=40))


@pytest.mark.parametrize("kind, parts", [("surface", 1), ("solid", 3), ("pins", 1)])
def test_each_feature_is_a_group_of_faces_over_its_pins(kind, parts):
    bed = uneven()
    (body,) = make_bodies(bed, Model(kind=kind, resolution=parts), Finding())
    assert body.groups == ("boss_1", "crease_1")
    assert len(body.group) == len(body.faces)
    middle = body.vertices[body.faces].mean(axis=1)
    for number, x in ((1, -9e-3), (2, 9e-3)):
        mine = middle[body.group == number]
        assert len(mine) > 20
        assert np.linalg.norm(mine[:, :2] - (x, 0.0), axis=1).max() < 12e-3


@pytest.mark.parametrize(
    "told, said",
    [
        ({"kind": "cloud"}, "kind must be one of solid, surface, pins, features"),
        ({"skin": "silk"}, "skin must be one of bilinear, smooth, membrane"),
        ({"resolution": -1}, "resolution must be at least 0"),
        ({"resolution": 65}, "resolution must be at most 64"),
        ({"base_thickness": 0.0}, "base_thickness must be above 0 m"),
        ({"cap": -1.0}, "cap must be above 0 m"),
    ],
)
def test_a_model_that_makes_no_sense_is_refused(told, said):
    with pytest.raises(ParameterError, match=f"^Model\\.{said}"):
        Model(**told)


def history():
    bed = uneven()
    rows = {
        "height": [np.full(168, 0.04), bed.height],
        "force": [bed.force] * 2,
        "mode": [bed.mode] * 2,
    }
    return {"position": bed.position} | {name: np.stack(both) for name, both in rows.items()}


def test_the_former_surface_is_a_row_or_one_height_that_the_history_has():
    assert_allclose(make_formed(history(), -1, 0).raised, uneven().raised)
    assert_allclose(make_formed(history(), -1, 0.035).raised, uneven().raised + 0.005, atol=1e-15)
    assert not make_formed(history(), 1, 1).raised.any()
    said = r"^The history has 2 rows, 0 to 1 \(got -?\d as (row|former)\)\.$"
    for row, former in ((2, 0), (-3, 0), (0, 2), (0, -3)):
        with pytest.raises(OutputError, match=said):
            make_formed(history(), row, former)


@pytest.mark.parametrize("name, bad", [("height", -np.inf), ("former", np.inf), ("force", np.nan)])
def test_values_that_are_not_finite_are_refused_by_cell(name, bad):
    known = {"height": np.full(168, 0.04), "former": 0.04, "force": 0.0, "mode": 0}
    known[name] = np.where(np.arange(168) == 7, bad, 0.04)
    with pytest.raises(
        ParameterError, match=rf"^Surface\.{name} must be finite \(got {bad} at cell 7\)"
    ):
        Formed.of(uneven().position, **known)


@pytest.mark.parametrize("file", ["stl", "ply"])
def test_a_solid_takes_no_more_memory_than_its_own_arrays_and_a_few_megabytes(file):
    # Measured: 180 bytes a pin on a million pins, of which vertices, faces and values are 168; the
    # file's 200 are never kept as a whole. On 160 000 pins the pieces that are written at once
    # still count: 10 MB.
    side = 400
    exported = export(side, "solid", file)
    assert PIECE <= 65536
    assert exported["triangles"] == 4 * (side - 1) ** 2 + 8 * (side - 1)
    assert exported["peak"] <= 250 * side * side / 1e6 + 10.0


def test_the_benchmark_prints_a_line_a_case_and_keeps_its_figures(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("benchmarks.bed_size.EXPORTED", (5, 9))
    assert main(["export", "--quick", "--quiet", "--out", str(tmp_path)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert sum(line[:1] in (["solid"], ["surface"], ["pins"], ["features"]) for line in lines) >= 10
    head = (tmp_path / "export.csv").read_text().splitlines()[0]
    assert head == "pins,kind,file,triangles,made,written,size,peak"
