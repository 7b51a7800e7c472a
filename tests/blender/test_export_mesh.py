"""Export, Make Mesh with its shading, and the list of features, as a user of Blender has them."""

from fnmatch import fnmatchcase

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.engine.simulation import begin, step
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.session import snapshot
from digiclay.device import view
from digiclay.device.instant import Instant
from digiclay.exchange import formed_bed
from digiclay.roles import fingertip_of
from digiclay.settings import properties

from tests.assemble import assert_near
from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")

#: float32 at 0.5 Blender units, in m.
FLOAT32 = 0.5 / bridge.SCALE * 2.0**-23
LAYOUT = Layout(rows=12, columns=14)


def shaped(boss=-9.0, added=0.0):
    """A boss of 5 mm at x, mm, a crease of 4 mm, ground between them and what is added; forces, all modes."""
    place, number = make_grid(LAYOUT).positions, np.arange(168)
    x, y = place.T * 1e3
    raised = 5.0 * np.exp(-((x - boss) ** 2 + y**2) / 20.0) - 4.0 * np.exp(
        -((x - 9) ** 2 + y**2) / 20.0
    )
    finger = np.array([0.0, 0.0, 0.09, 1.0, 0.0, 0.0, 0.0])
    return Instant(place, 0.04 + (raised + added) * 1e-3, number % 8, number / 100.0, finger)


@pytest.fixture
def bed(extension):
    """A formed bed, selected as Blender's Add leaves it."""
    made = new_bed(rows=LAYOUT.rows, columns=LAYOUT.columns)
    view.show_arrows(made, True)  # only then are forces drawn
    view.show(made, shaped())
    return made


def corners(thing):
    found = np.empty(3 * len(thing.data.vertices), np.float32)
    thing.data.vertices.foreach_get("co", found)
    return found.reshape(-1, 3).astype(float)


def open_edges(thing):
    """Count the edges that have not exactly two faces."""
    keys = [key for polygon in thing.data.polygons for key in polygon.edge_keys]
    _, counts = np.unique(np.array(keys), axis=0, return_counts=True)
    return int(np.sum(counts != 2))


IMPORTERS = {
    "stl": ("wm", "stl_import"),
    "stl_ascii": ("wm", "stl_import"),
    "obj": ("wm", "obj_import"),
    "ply": ("wm", "ply_import"),
    "glb": ("import_scene", "gltf"),
}


@pytest.mark.parametrize(
    "file_format, kind",
    [
        *((file_format, kind) for file_format in IMPORTERS for kind in ("solid", "features")),
        ("stl", "surface"),
        ("glb", "surface"),
        ("obj", "pins"),
        ("ply", "pins"),
    ],
)
def test_blenders_own_importers_read_what_was_exported(bed, tmp_path, kind, file_format):
    path = tmp_path / f"bed{find_suffix(file_format)}"
    bpy.ops.export_mesh.digital_clay(filepath=str(path), kind=kind, file_format=file_format)
    bpy.ops.mesh.digital_clay_make(kind=kind, beside=False)
    made = bpy.context.selected_objects
    names = [one.name.split()[-1] for one in made]
    assert kind != "features" or sorted(names) == ["boss_1", "crease_1"]  # bodies of their own
    assert all((open_edges(one) == 0) == (kind != "surface") for one in made)
    known = [len(one.data.polygons) for one in made]
    before = set(bpy.data.objects)
    group, name = IMPORTERS[file_format]
    getattr(getattr(bpy.ops, group), name)(filepath=str(path))
    read = [one for one in set(bpy.data.objects) - before if one.type == "MESH"]
    assert sum(len(one.data.polygons) for one in read) == sum(known)


@pytest.mark.parametrize(
    "axes",
    [
        {},
        {"forward_axis": "Y", "up_axis": "Z"},
        {"forward_axis": "NEGATIVE_X", "up_axis": "NEGATIVE_Y"},
    ],
)
def test_an_obj_stands_upright_after_its_import_with_the_same_axes(bed, tmp_path, axes):
    path = str(tmp_path / "bed.obj")
    bpy.ops.export_mesh.digital_clay(filepath=path, kind="surface", **axes)
    bpy.ops.wm.obj_import(filepath=path, **axes)
    read = bpy.context.object
    known = corners(read) @ np.array(read.matrix_world)[:3, :3].T  # the importer turns the object
    wanted = np.column_stack([shaped().position, shaped().height]) * 1e3
    np.testing.assert_allclose(known, wanted, atol=1e-4)


@pytest.mark.parametrize(
    "name, file_format, written",
    [
        *(("bed.stl", kind, f"bed{find_suffix(kind)}") for kind in FORMATS),
        # The ending of another format is replaced by that of the one chosen.
        ("one.STL", "stl", "one.STL"),
        ("two.ascii.stl", "stl", "two.stl"),
        ("three.part", "stl", "three.part.stl"),
        ("four.3mf", "stl", "four.stl"),
        # Without a choice the ending tells the format.
        ("two.GLB", None, "two.GLB"),
        ("three.ascii.stl", None, "three.ascii.stl"),
        ("five.part", None, "five.part.stl"),
    ],
)
def test_a_file_has_the_ending_of_its_format_and_the_dialog_lists_it(
    bed, tmp_path, name, file_format, written
):
    shown = (
        bpy.ops.export_mesh.digital_clay.get_rna_type().properties["filter_glob"].default.split(";")
    )
    assert any(fnmatchcase(written.lower(), pattern) for pattern in shown)
    options = {"file_format": file_format} if file_format else {}
    bpy.ops.export_mesh.digital_clay(filepath=str(tmp_path / name), kind="surface", **options)
    assert [path.name for path in tmp_path.iterdir()] == [written]
    if name == "two.GLB":
        assert (tmp_path / written).read_bytes()[:4] == b"glTF"


def test_each_feature_can_have_a_file_of_its_own(bed, tmp_path):
    path = str(tmp_path / "grüne Form.stl")
    bpy.ops.export_mesh.digital_clay(filepath=path, kind="features", separate=True)
    names = sorted(one.name for one in tmp_path.iterdir())
    assert names == ["grüne Form_boss_1.stl", "grüne Form_crease_1.stl"]


def test_an_export_that_cannot_be_written_is_refused_in_one_line(bed, tmp_path):
    said = "no feature of at least 3 pins more than 50 mm"
    chosen = {"kind": "features", "threshold": 50.0}
    with pytest.raises(RuntimeError, match=said) as caught:
        bpy.ops.export_mesh.digital_clay(filepath=str(tmp_path / "bed.stl"), **chosen)
    assert "Traceback" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_lengths_are_millimeters_of_the_device_whatever_the_size_of_the_bed(bed, tmp_path):
    bed.scale = (3.0, 3.0, 3.0)
    bpy.context.view_layer.objects.active = fingertip_of(bed)  # as good as the bed
    bpy.ops.export_mesh.digital_clay(filepath=str(tmp_path / "bed.stl"), kind="surface")
    bpy.ops.wm.stl_import(filepath=str(tmp_path / "bed.stl"))
    assert np.ptp(corners(bpy.context.object)[:, 0]) == pytest.approx(13 * 3.0, rel=1e-6)


@pytest.mark.parametrize("kind", ["solid", "surface", "pins"])
def test_the_mesh_is_the_surface_with_its_features_as_vertex_groups(bed, kind):
    known = bridge.read_cells(bed.data)
    bpy.ops.mesh.digital_clay_make(kind=kind)
    made = bpy.context.object
    assert made != bed
    exact = 0.6e-7 if kind == "pins" else FLOAT32  # pins have steps of 0.1 µm
    assert_near(corners(made)[:168, 2] / bridge.SCALE, known["height"], exact)
    assert [group.name for group in made.vertex_groups] == ["boss_1", "crease_1"]
    for index, x in ((0, -9e-3), (1, 9e-3)):
        mine = [
            v.co.x / bridge.SCALE
            for v in made.data.vertices
            if any(g.group == index for g in v.groups)
        ]
        assert len(mine) > 8
        assert np.mean(mine) == pytest.approx(x, abs=1.5e-3)
    assert (open_edges(made) == 0) == (kind != "surface")
    if kind == "surface":
        force, mode = (made.data.attributes[name].data for name in ("force", "mode"))
        assert [round(force[i].value, 6) for i in (0, 7, 167)] == [0.0, 0.07, 1.67]
        assert [mode[i].value for i in (0, 7, 167)] == [0, 7, 7]


def test_a_session_tells_its_forces_whether_they_are_drawn_or_not(bed):
    view.show_arrows(bed, False)
    scene = properties.scene_of(bed)
    system = assemble(scene)
    finger = np.array([1.5e-3, 1.5e-3, 0.038, 1.0, 0.0, 0.0, 0.0])
    state = step(system, begin(system), np.tile(finger, (len(system.instants), 1, 1)))
    view.show_state(bed, system, state)
    force = state.row(system.rows.force).copy()
    assert force.max() > 1e-3
    bed["digiclay_state"] = snapshot.dump(system, state)
    np.testing.assert_array_equal(formed_bed.read_formed(bed).force, force)
    bed["digiclay_state"] = b"damaged"
    assert not np.array_equal(formed_bed.read_formed(bed).force, force)


def test_a_mesh_stands_where_its_surface_is_or_beside_the_one_before_in_a_place_that_is_free(bed):
    bed.location, bed.rotation_euler = (1.0, 2.0, 3.0), (0.0, 0.0, 0.5)
    bpy.context.view_layer.update()
    bpy.ops.mesh.digital_clay_make(kind="surface", beside=False)
    assert_near(bpy.context.object.matrix_world, bed.matrix_world, 1e-6)
    bpy.data.objects.remove(bpy.context.object)
    made = []
    for number in range(4):
        if number == 3:
            bpy.data.objects.remove(made.pop(1))
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = bed
        bpy.ops.mesh.digital_clay_make(kind="solid")
        made.append(bpy.context.object)
        made[-1].name = "Bowl"  # its place stays taken
    away = np.array(
        [(one.matrix_world.translation - bed.matrix_world.translation).length for one in made]
    )
    np.testing.assert_allclose(away / away[0], [1, 3, 2], rtol=1e-5)
    assert away[0] > 14 * 3e-3 * bridge.SCALE


def test_features_can_be_measured_from_a_surface_that_was_kept(bed):
    assert not bpy.ops.digiclay.forget_surface.poll()
    bpy.ops.digiclay.keep_surface()
    bpy.ops.digiclay.find_features()
    assert bed["digiclay_features"] == "0 bosses and 0 creases"
    bpy.ops.digiclay.forget_surface()
    bpy.ops.digiclay.find_features()
    total, boss, _, crease, *_ = bed["digiclay_features"].splitlines()
    assert (total, boss[:10], "mm high" in boss) == ("1 boss and 1 crease", "boss_1: 4.", True)
    assert "mm deep" in crease


def test_the_heights_are_measured_from_the_rest_height_and_a_bed_without_attributes_or_rows_is_refused(
    bed,
):
    bed.digiclay.actuator.rest_height = 35.0
    assert_near(formed_bed.read_formed(bed).former, 0.035, 1e-12)
    bed.data.attributes.remove(bed.data.attributes["force"])
    with pytest.raises(RuntimeError, match=r"no longer that of its pins: .* press Rebuild"):
        bpy.ops.mesh.digital_clay_make()
    bpy.ops.mesh.digital_clay_add(rows=1, columns=9)
    with pytest.raises(
        RuntimeError, match=r"must have at least 2 x 2 pins, in rows along x \(got 1 x 9\)"
    ):
        bpy.ops.mesh.digital_clay_make()


@pytest.fixture
def cliffs(extension):
    """A bed with a boss, a crease, a cliff of 20 mm through both rims, and a pin on a rim that stands out."""
    number = np.arange(168)
    made = new_bed(rows=LAYOUT.rows, columns=LAYOUT.columns)
    cliff = np.where(number % 14 < 3, 20.0, 0.0) + np.where(number == 160, 15.0, 0.0)
    view.show(made, shaped(-3.0, cliff))
    return made


@pytest.mark.parametrize("kind", ["solid", "surface", "features"])
@pytest.mark.parametrize("skin", ["bilinear", "smooth"])
def test_the_skin_is_smooth_and_walls_and_base_are_flat(cliffs, kind, skin):
    bpy.ops.mesh.digital_clay_make(kind=kind, skin=skin)
    faces = bpy.context.object.data.polygons
    assert {face.use_smooth for face in faces if face.normal.z > 1e-3} == {True}
    downwards = {face.use_smooth for face in faces if face.normal.z < 1e-3}
    assert downwards == (set() if kind == "surface" else {False})


def test_the_rim_of_a_solid_is_sharp_and_nothing_within_its_skin(cliffs):
    bpy.ops.mesh.digital_clay_make(kind="pins")
    assert not any(face.use_smooth for face in bpy.context.object.data.polygons)
    bpy.context.view_layer.objects.active = cliffs
    bpy.ops.mesh.digital_clay_make(kind="solid")
    mesh = bpy.context.object.data
    beside = {key: set() for key in mesh.edge_keys}
    for face in mesh.polygons:
        for key in face.edge_keys:
            beside[key].add(face.use_smooth)
    for edge in mesh.edges:
        shades = beside[edge.key]
        if shades != {False}:
            assert edge.use_edge_sharp == (shades == {True, False})
    assert sum(shades == {True, False} for shades in beside.values()) >= 2 * (12 + 14) - 4
