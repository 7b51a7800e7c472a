"""Shapes onto beds in Blender: from objects, files and samples, and what is said when it cannot be."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.session import snapshot
from digiclay.core.shapes.fitting import unpack as heights_of
from digiclay.core.shapes.heightmap import read_pixels
from digiclay.exchange import image_reader
from digiclay.live.beds import read_snapshot
from digiclay.roles import fingertip_of, is_bed
from digiclay.settings import properties

from tests import pictures
from tests.assemble import assert_near
from tests.blender.at_hand import beds, new_bed, select

pytestmark = pytest.mark.usefixtures("extension")

#: Dead band of the height control, and the 32 bits a bed's vertices have.
SHOWN = 10e-6 + 1e-8


def bed():
    return new_bed(rows=13, columns=13)


def heights(thing):
    return bridge.read_cells(thing.data)["height"]


def object_beside(name, vertices, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(made)
    made.select_set(True)
    return made


def cube(size, height, x=0.0, y=0.0, z=0.0):
    """Add a box that stands at a place, selected before the bed."""
    place = (x, y, z + height / 2)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place, scale=(size, size, height))
    select(bpy.context.object, beds()[0])


def test_an_object_is_displayed_by_the_physics_and_kept_in_the_bed():
    made = bed()
    cube(1.0, 1.0)
    # A square box is as wide as the bed: all 169 pins go up by the rise.
    bpy.ops.digiclay.shape_from_object(rise=12.0, scale=0.5)
    scene = properties.scene_of(made)
    wanted = heights_of(scene.shape.heights, make_grid(scene.layout))
    raised = wanted > scene.actuator.rest_height + 6e-3
    assert raised.sum() in (36, 49)
    assert wanted.max() == pytest.approx(52e-3, abs=4e-9)
    assert_near(heights(made), wanted, SHOWN)
    bpy.context.view_layer.update()
    assert bridge.pose(fingertip_of(made))[2] > wanted.max()  # the finger is lifted out of it
    # A session goes on from there: its state is in the bed, and the method has taken over.
    system = assemble(scene)
    state = snapshot.load(system, read_snapshot(made))
    assert system.controller.is_displayed(state.memory)
    assert_near(state.row(0), wanted, SHOWN)


def test_an_object_where_it_is_is_displayed_where_it_is():
    made = bed()
    made.location, made.scale = (3.0, -2.0, 1.0), (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    # 60 mm above the bed's floor at twice the size: 1 + 2 * 0.6 in the world.
    cube(0.26, 0.2, 3.0 + 0.12, -2.0, 1.0 + 2 * 0.6 - 0.2)
    bpy.ops.digiclay.shape_from_object(fit="placed")
    up = heights(made).reshape(13, 13) > 50e-3
    row, column = np.nonzero(up)
    assert heights(made).max() == pytest.approx(60e-3, abs=SHOWN + 1e-7)
    # 13 mm wide about x = 6 mm: pins at 0, 3, 6, 9, 12 mm and at -6 ... 6 mm.
    assert (row.min(), row.max(), column.min(), column.max()) == (4, 8, 6, 10)


def test_modifiers_of_the_object_count_and_a_text_object_has_a_surface_too():
    made = bed()
    thing = object_beside("Face", [(-1, -1, 0), (1, -1, 0), (1, 1, 1), (-1, 1, 1)], [(0, 1, 2, 3)])
    thing.modifiers.new("Back", "MIRROR").use_axis = (False, True, False)
    bpy.ops.digiclay.shape_from_object()
    table = heights(made).reshape(13, 13)
    assert_near(table, table[::-1], 2 * SHOWN)
    made = bed()
    bpy.ops.object.text_add()
    text = bpy.context.object
    text.data.extrude = 0.1
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    bpy.ops.digiclay.shape_from_object()
    assert np.ptp(heights(made)) > 10e-3


def test_a_shape_is_taken_back_by_undo():
    bed()
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.digiclay.shape_sample(sample="dome")
    bpy.ops.ed.undo_push(message="After")
    bpy.ops.ed.undo()
    made = beds()[0]
    assert np.ptp(heights(made)) == 0.0
    assert not made.digiclay.use_shape
    assert read_snapshot(made) is None


def test_a_file_is_displayed_without_any_other_library(tmp_path):
    made = bed()
    np.save(tmp_path / "größe 1.npy", np.eye(13))
    bpy.ops.digiclay.shape_from_file(filepath=str(tmp_path / "größe 1.npy"), fit="stretch")
    assert np.array_equal(heights(made).reshape(13, 13) > 50e-3, np.eye(13) > 0)


def test_what_is_formed_becomes_the_shape_and_goes_again_and_its_mesh_is_the_same_clay_on_another_bed():
    made = bed()
    bpy.ops.digiclay.shape_sample(sample="saddle")
    shown = heights(made)
    bpy.ops.digiclay.shape_keep()
    scene = properties.scene_of(made)
    assert_near(heights_of(scene.shape.heights, make_grid(scene.layout)), shown, 4e-9)
    bpy.ops.digiclay.shape_remove()
    assert properties.scene_of(made).shape is None
    cube(1.0, 1.0)
    bpy.ops.digiclay.shape_from_object(scale=0.6)
    shown = heights(made)
    bpy.ops.mesh.digital_clay_make(kind="solid", beside=False)
    mesh = bpy.context.object
    assert not is_bed(mesh)
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.mesh.digital_clay_add(rows=13, columns=13)
    other = bpy.context.object
    other.location = made.location
    mesh.select_set(True)
    bpy.ops.digiclay.shape_from_object(fit="placed")
    # Twice the dead band, and 32 bits.
    assert_near(heights(other), shown, 2 * SHOWN)


def refused(words, operator=None, **options):
    """Call an operator, and find the bed as it was."""
    with pytest.raises(RuntimeError, match=words):
        (operator or bpy.ops.digiclay.shape_from_object)(**options)
    made = beds()[0]
    assert np.ptp(heights(made)) == 0.0
    assert not made.digiclay.use_shape


def test_without_an_object_over_the_bed_the_button_says_what_to_do():
    bed()
    assert not bpy.ops.digiclay.shape_from_object.poll()
    refused("Select the object first, then the bed")
    cube(0.2, 0.2, 9.0, 9.0)
    refused("must leave the shape over the bed", fit="placed")


def test_an_object_without_faces_is_refused():
    bed()
    object_beside("Odd", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [])
    refused("must hold a surface made of faces")


@pytest.mark.parametrize("name", ["nowhere.stl", "empty.png", "empty.npy", "empty.stl"])
def test_a_file_that_is_none_is_refused(tmp_path, name):
    bed()
    if name != "nowhere.stl":
        (tmp_path / name).touch()
    refused(name, bpy.ops.digiclay.shape_from_file, filepath=str(tmp_path / name))


def write_exr(path, values):
    rows, columns = values.shape
    made = bpy.data.images.new("x", columns, rows, float_buffer=True)
    made.colorspace_settings.is_data = True
    channels = np.dstack([values] * 3 + [np.ones_like(values)])
    made.pixels.foreach_set(channels.astype(np.float32).ravel())
    made.file_format, made.filepath_raw = "OPEN_EXR", str(path)
    made.save()
    bpy.data.images.remove(made)


def test_an_exr_is_read_as_it_is_and_displayed(tmp_path):
    values = np.random.default_rng(5).uniform(0.0, 1.0, (7, 5))
    path = tmp_path / "Übung 1.exr"
    write_exr(path, values)
    before = len(bpy.data.images)
    read = read_pixels(path)
    assert read.shape == (7, 5)
    assert_near(read, values, 1e-6)
    assert len(bpy.data.images) == before
    made = bed()
    bpy.ops.digiclay.shape_from_file(filepath=str(path))
    assert np.ptp(heights(made)) > 10e-3


@pytest.mark.parametrize("name", [*pictures.READ, *pictures.BLENDER])
def test_blender_reads_every_kind_of_picture_in_all_its_bits(name):
    step = pictures.STEPS[{**pictures.READ, **pictures.BLENDER}[name]]
    assert pictures.measure_error(name, read_pixels(pictures.FOLDER / name)) <= step


@pytest.mark.parametrize("name", pictures.OUTSIDE)
def test_a_kind_of_picture_that_blender_does_not_read_is_refused(name):
    with pytest.raises(ParameterError, match="must be a picture Blender can read"):
        read_pixels(pictures.FOLDER / name)


@pytest.mark.parametrize("orientation", pictures.STORED)
@pytest.mark.parametrize("ending", ["jpg", "png", "tif"])
def test_a_picture_stands_in_blender_as_its_exif_data_say(tmp_path, ending, orientation):
    path = tmp_path / f"a.{ending}"
    pictures.write_turned(path, orientation)
    seen = read_pixels(path)[::-1][4::8, 4::8] / 20 * 255
    assert_near(seen, pictures.UPRIGHT, 0.2)  # what a JPEG leaves


@pytest.mark.parametrize("kind, absent", pictures.NO_DATA)
def test_blender_leaves_out_what_a_geotiff_has_no_data_of(tmp_path, kind, absent, monkeypatch):
    path = tmp_path / "dem.tif"
    known = pictures.write_geotiff(path, kind, absent)[::-1, 6:]
    read = read_pixels(path)
    assert np.array_equal(np.ma.getmaskarray(read), np.tile(np.arange(12) < 6, (10, 1)))
    seen = read[:, 6:]
    # Blender keeps 24 bits of each number, as a share of the largest.
    assert_near(seen * (known.max() / seen.max()), known, 1e-3)
    monkeypatch.setattr(image_reader, "MOST", 60)
    with pytest.raises(ParameterError, match="unscaled, as it has pixels without data"):
        read_pixels(path)


def test_a_large_picture_is_scaled_down_by_blender_and_what_is_none_refused(tmp_path, monkeypatch):
    write_exr(tmp_path / "large.exr", np.tile(np.linspace(0, 1, 300), (200, 1)))
    monkeypatch.setattr(image_reader, "MOST", 6000)
    read = read_pixels(tmp_path / "large.exr")
    assert read.size <= 6000
    assert read.shape[1] / read.shape[0] == pytest.approx(1.5, rel=0.03)
    assert np.ptp(read) > 0.95
    (tmp_path / "x.png").write_bytes(b"rubbish")
    before = len(bpy.data.images)
    with pytest.raises(ParameterError, match="must be a picture Blender can read"):
        read_pixels(tmp_path / "x.png")
    assert len(bpy.data.images) == before
