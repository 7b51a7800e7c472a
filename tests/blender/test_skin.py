"""The live skin follows the pins whatever moves them, each bed's its own; automatic goes by the pitch."""

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import Mode
from digiclay.device import detail, palettes, view
from digiclay.device.detail import choose_far, measure_pitch
from digiclay.device.instant import Instant
from digiclay.device.node_tree import FAR
from digiclay.device.palettes import PLAIN
from digiclay.device.skin_lattice import KINDS, choose_parts, make_lattice
from digiclay.roles import ROLE, fingertip_of, is_bed
from digiclay.settings import properties
from mathutils import Matrix, Vector

from tests.blender.at_hand import done, instances, new_bed, read_picture, save_and_open
from tests.live_skin import interpolate

pytestmark = pytest.mark.usefixtures("extension")

#: Attributes and sums are float32: 24 bits of at most 0.1 m, a few operations each.
FLOAT32 = 4 * 0.1 * 2.0**-23


@pytest.fixture
def bed():
    """A bed of 8 x 9 hexagonal pins from the Add menu, every pin at a height of its own."""
    bed = new_bed(rows=8, columns=9, arrangement="hexagonal")
    shape(bed, 1)
    return bed


def shape(bed, seed):
    cells = bridge.read_cells(bed.data)
    count = len(cells["height"])
    height = 0.04 + 0.004 * np.random.default_rng(seed).standard_normal(count)
    bridge.write_cells(bed.data, cells["position"], height)


def mesh_with(bed, name):
    """Return what is drawn of a bed as a mesh, and which of its faces wear materials of a name."""
    mesh = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    roles = [material[ROLE] if material else "" for material in mesh.materials]
    worn = [roles[face.material_index].startswith(name) for face in mesh.polygons]
    return mesh, np.flatnonzero(worn)


def drawn(bed):
    """Return the points of the skin that is drawn, m, and how many pins are drawn."""
    mesh, faces = mesh_with(bed, "skin")
    used = sorted({point for face in faces for point in mesh.polygons[face].vertices})
    points = np.array([mesh.vertices[point].co for point in used]).reshape(-1, 3) / bridge.SCALE
    return points, len([*instances(bed)])


def drawn_tints(bed):
    """Return the role of the material of every face of the skin that is drawn, and its middle in plan, m."""
    mesh, faces = mesh_with(bed, "skin")
    shown = [mesh.polygons[face] for face in faces]
    middles = np.array([face.center[:2] for face in shown]) / bridge.SCALE
    return [mesh.materials[face.material_index][ROLE] for face in shown], middles


def baked_heights(bed):
    """Return the heights at which a bake's pins are drawn, m."""
    shown, bed.digiclay_display.form = bed.digiclay_display.form, "pins"
    tops = np.array([item.matrix_world.translation.z for item in instances(bed)])
    bed.digiclay_display.form = shown
    return (tops - bed.matrix_world.translation.z) / bridge.SCALE


def expected(bed, kind, height=None):
    """Return the points of a bed's skin but those of its lower edge, m, as numpy works them out."""
    scene = properties.scene_of(bed)
    instant = Instant.at_rest(scene.layout, scene.actuator)
    lattice = make_lattice(instant, choose_parts(len(instant.height)))
    known = bridge.read_cells(bed.data)["height"] if height is None else height
    points = np.column_stack([lattice.place, interpolate(lattice, known, kind)])
    return points[~lattice.sunk]


def assert_skin(bed, wanted):
    points, _ = drawn(bed)
    np.testing.assert_allclose(points[: len(wanted)], wanted, rtol=0, atol=FLOAT32)


@pytest.mark.parametrize("kind", KINDS)
def test_blender_draws_the_skin_that_numpy_works_out(bed, kind):
    bed.digiclay_display.form, bed.digiclay_display.skin = "skin", kind
    assert_skin(bed, expected(bed, kind))
    bed.digiclay.layout.rows = 5
    bpy.ops.digiclay.rebuild()
    shape(bed, 2)
    assert_skin(bed, expected(bed, kind))


@pytest.mark.parametrize(
    "shown, far, pins, skin",
    [
        ("pins", False, 72, False), ("skin", False, 0, True), ("both", False, 72, True),
        ("automatic", False, 72, False), ("automatic", True, 0, True),
    ],
)  # fmt: skip
def test_what_is_not_to_be_seen_is_not_drawn(bed, shown, far, pins, skin):
    assert bed.digiclay_display.form == "automatic"
    bed.digiclay_display.form = shown
    view.write_setting(bed, FAR, far)
    points, count = drawn(bed)
    assert count == pins
    assert bool(len(points)) == view.is_skin_shown(bed) == skin


def test_the_tint_is_by_the_nearest_pin_of_the_nearest_row_and_can_be_off(bed):
    cells, display = bridge.read_cells(bed.data), bed.digiclay_display
    modes = np.arange(72, dtype=np.int8) % len(Mode)
    bridge.write_cells(bed.data, cells["position"], cells["height"], mode=modes)
    display.form = "skin"
    worn, middles = drawn_tints(bed)
    ours = [
        ("skin" if Mode(mode) in PLAIN else f"skin_{Mode(mode).name.lower()}") for mode in modes
    ]
    assert set(worn) == set(ours)
    across, along = np.moveaxis(np.abs(middles[:, None] - cells["position"][:, :2]), -1, 0)
    for face, role in enumerate(worn):
        # A face in the middle between two rows, or two pins, may take either of them.
        row = along[face] < along[face].min() + 1e-6
        near = row & (across[face] < across[face][row].min() + 1e-6)
        assert role in {ours[pin] for pin in np.flatnonzero(near)}
    display.tint = False
    assert set(drawn_tints(bed)[0]) == {"skin"}


def test_a_palette_recolors_the_tints_as_thinly(bed):
    tint = next(each for each in bpy.data.materials if each.get(ROLE) == "skin_frozen")
    palettes.set_palette("tol_muted")
    color = np.array(bridge.srgb(tint.diffuse_color))
    away = np.array(palettes.PALETTES["tol_muted"][Mode.FROZEN]) - palettes.CLAY
    np.testing.assert_allclose(color - palettes.CLAY, palettes.SHARE * away, atol=1e-6)


def test_a_session_shows_the_skin_of_an_automatic_bed_and_leaves_what_was_chosen(bed):
    bed.scale = (50.0,) * 3  # large in the factory file's view
    bpy.context.view_layer.update()
    for chosen, shown in (("automatic", "skin"), ("pins", "pins"), ("both", "both")):
        bed.digiclay_display.form = chosen
        view.show_form(bed)
        assert bed.digiclay_display.form == shown
    bed.digiclay_display.form, bed.digiclay_display.color = "automatic", "force"
    view.show_form(bed)
    assert bed.digiclay_display.form == "automatic"
    bed.digiclay_display.color = "mode"
    view.show_form(bed)
    bpy.ops.digiclay.skin_toggle()
    assert bed.digiclay_display.form == "automatic"


def test_a_render_shows_the_choice_and_pins_for_automatic(bed, tmp_path):
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bed.location = (6.2, -6.0, 4.2)  # near the camera of the factory file
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = 96, 64
    view.write_setting(bed, FAR, True)
    pictures = {}
    for shown in ("pins", "automatic", "skin"):
        bed.digiclay_display.form = shown
        scene.render.filepath = str(tmp_path / f"{shown}.png")
        bpy.ops.render.render(write_still=True)
        pictures[shown] = read_picture(Path(scene.render.filepath))
    np.testing.assert_array_equal(pictures["automatic"], pictures["pins"])
    # The bed is seen: pins and skin differ in some of the pixels by more than rounding.
    assert (np.abs(pictures["skin"] - pictures["pins"]) > 0.02).sum() > 100


@pytest.mark.parametrize("scale", [1.0, 50.0])  # small and large in the factory file's view
@pytest.mark.parametrize("chosen", view.FORMS)
def test_the_key_changes_what_is_seen_and_comes_back_to_what_was_chosen(bed, chosen, scale):
    bed.scale = (scale,) * 3
    bpy.context.view_layer.update()
    bed.digiclay_display.form = chosen
    detail.follow()
    seen = [view.is_skin_shown(bed)]
    for _ in range(4):
        bpy.ops.digiclay.skin_toggle()
        seen.append(view.is_skin_shown(bed))
    assert seen == [seen[0], not seen[0]] * 2 + [seen[0]]
    assert bed.digiclay_display.form == chosen
    # Where the view has come to show the same by the form that was chosen, the key goes on to the
    # other.
    bpy.ops.digiclay.skin_toggle()
    bed.scale /= scale
    bpy.context.view_layer.update()
    bpy.ops.digiclay.skin_toggle()
    assert view.is_skin_shown(bed) is seen[0]


def test_the_key_shows_the_skin_and_the_pins_again_as_undo_steps(bed):
    bed.scale = (50.0,) * 3
    done("Bed")
    for shown in ("skin", "automatic"):
        bpy.ops.digiclay.skin_toggle()
        done("Toggle Skin")
        assert bpy.context.object.digiclay_display.form == shown
    bpy.ops.ed.undo()
    assert bpy.context.object.digiclay_display.form == "skin"
    assert_skin(bpy.context.object, expected(bpy.context.object, "smooth"))
    bpy.ops.ed.undo()
    assert bpy.context.object.digiclay_display.form == "automatic"


def test_a_copy_of_a_bed_has_a_choice_of_its_own(bed):
    bed.digiclay_display.form = "skin"
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    assert copy != bed
    copy.digiclay_display.form = "pins"
    shape(copy, 3)
    assert view.read_form(bed) == "skin"
    assert_skin(bed, expected(bed, "smooth"))
    assert drawn(copy)[1] == 72


def test_a_file_keeps_the_skin_and_an_append_brings_it(bed, tmp_path):
    bed.digiclay_display.form, bed.digiclay_display.skin = "skin", "membrane"
    path = tmp_path / "bed.blend"
    save_and_open(path)
    found = next(thing for thing in bpy.data.objects if is_bed(thing))
    assert found.digiclay_display.form == "skin"
    assert_skin(found, expected(found, "membrane"))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(path)) as (inside, wanted):
        wanted.objects = [name for name in inside.objects if name == "Digital Clay"]
    (appended,) = wanted.objects
    bpy.context.scene.collection.objects.link(appended)
    bpy.context.view_layer.update()
    assert_skin(appended, expected(appended, "membrane"))


def test_a_bake_plays_with_the_skin(bed):
    tip = fingertip_of(bed)
    tip.keyframe_insert("location", frame=1)
    tip.location.z -= 0.15
    tip.keyframe_insert("location", frame=6)
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=6) == {"FINISHED"}
    bed.digiclay_display.form = "skin"
    depths = []
    for frame in (1, 5):
        bpy.context.scene.frame_set(frame)
        assert_skin(bed, expected(bed, "smooth", baked_heights(bed)))
        depths.append(
            drawn(bed)[0][:, 2].max() - expected(bed, "smooth", baked_heights(bed))[:, 2].min()
        )
    assert depths[1] > depths[0] + 1e-4


def test_a_form_of_a_bed_without_a_skin_is_refused(bed):
    tree = bed.modifiers[0].node_group
    tree.interface.remove(tree.interface.items_tree["Form"])
    assert not view.can_show_skin(bed)
    assert not bpy.ops.digiclay.skin_toggle.poll()
    with pytest.raises(DigiclayError, match=r"has no skin\. Rebuild it in Laboratory > Device"):
        view.set_form(bed, "skin")
    assert bed.digiclay_display.form == "pins"


@pytest.mark.parametrize(
    "pitch, before, after",
    [
        (7.9, False, True), (8.1, False, False), (9.9, True, True), (10.1, True, False), (0.0, True, False),
        (math.nan, True, False), (math.inf, True, False),
    ],
)  # fmt: skip
def test_the_two_limits_keep_a_bed_from_flickering(pitch, before, after):
    assert choose_far(pitch, before) is after


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_the_pitch_is_as_many_pixels_as_a_camera_shows(kind):
    scene = bpy.context.scene
    camera = scene.camera
    camera.data.type = kind
    scene.render.resolution_x, scene.render.resolution_y = 800, 800
    camera.matrix_world = Matrix.Translation((0.3, -0.2, 7.0))
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    lens = camera.calc_matrix_camera(graph, x=800, y=800)
    bed = Matrix.Translation((0.1, 0.4, 1.0))
    to_clip = np.array(lens @ camera.matrix_world.inverted() @ bed)
    ends = [world_to_camera_view(scene, camera, bed @ Vector((0.0, y, 0.0))) for y in (0.0, 0.03)]
    shown = 800 * (ends[1].y - ends[0].y)
    # Projections in single precision, of lengths of some pixels among hundreds.
    assert measure_pitch(to_clip, np.array(lens), 0.03, 800) == pytest.approx(shown, rel=1e-3)
    behind = np.diag([1.0, 1.0, 1.0, -2.0])
    assert measure_pitch(behind, np.eye(4), 0.03, 800) == 0.0
