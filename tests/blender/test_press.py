"""The Press tool: where the mouse points, size and presets of the brush, and strokes that a script plays."""

from dataclasses import astuple

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.live import beds
from digiclay.operators.press_adjust import AdjustStrength
from digiclay.press import aim, brush, tool
from digiclay.press.brush import FINGERS, find_kind
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.settings import devices, properties
from digiclay.strokes.stroke import Brush

from tests.assemble import assert_near, table
from tests.blender.at_hand import in_the_view, new_bed

#: How much larger the bed is than it is added: it then fills a good part of the factory file's
#: view.
LARGER = 8.0


def tools():
    """Return our tools in the toolbar of the 3D view in Object Mode, down through its groups."""
    from bl_ui.space_toolsystem_toolbar import VIEW3D_PT_tools_active

    found, left = [], list(VIEW3D_PT_tools_active._tools["OBJECT"])
    while left:
        tool = left.pop()
        if isinstance(tool, list | tuple) and not hasattr(tool, "idname"):
            left += tool
        elif tool is not None and tool.idname.startswith("digiclay"):
            found.append(tool.idname)
    return found


@pytest.fixture
def bed(extension):
    """A staggered bed whose pins all have heights of their own, turned, moved and scaled uniformly."""
    made = new_bed(rows=12, columns=15, arrangement="staggered")
    made.scale = (LARGER,) * 3
    made.rotation_euler = (0.1, -0.2, 0.5)
    cells, height = aim.read_surface(made)
    bridge.write_cells(made.data, cells.positions, height + 0.0003 * np.sin(np.arange(cells.count)))
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def context(bed):
    with in_the_view():
        yield bpy.context


def test_blender_reads_the_icon_of_the_tool():
    # As Blender's toolbar does: the name with the ending of its format.
    handle = bpy.app.icons.new_triangles_from_file(f"{tool.PressTool.bl_icon}.dat")
    assert handle > 0
    bpy.app.icons.release(handle)


def test_the_tool_comes_and_goes_with_the_extension():
    assert tools() == []
    for _ in range(2):
        digiclay.register()
        assert tools() == [tool.PressTool.bl_idname]
        digiclay.unregister()
        assert tools() == []


def find_eye(bed, context):
    """Return the place of the eye in a bed's space, m."""
    eye = context.region_data.view_matrix.inverted().translation
    return np.array(bed.matrix_world.inverted() @ eye) / bridge.SCALE


def test_a_pixel_on_the_top_of_a_pin_points_at_that_pin(bed, context):
    cells, height = aim.read_surface(bed)
    tops = np.column_stack([cells.positions, height])
    pixels = bridge.project(context, bed, tops)
    met = [aim.find_target(context, tuple(xy)) for xy in pixels]
    assert all(found is not None and found.bed == bed for found in met)
    near = np.array([found.point for found in met])
    # A pin may hide another; whatever is met lies in front of the top that was asked for, on the
    # same ray.
    eye = find_eye(bed, context)
    visible = np.array([found.pin for found in met]) == np.arange(cells.count)
    assert visible.sum() > 0.9 * cells.count
    # Blender's matrices are float32, at a distance of 2 m of the device.
    assert_near(near[visible], tops[visible], 2e-6)
    closer = np.linalg.norm(near - eye, axis=1) <= np.linalg.norm(tops - eye, axis=1) + 2e-6
    assert closer.all()


def test_a_place_in_the_view_agrees_with_blenders_own_projection(bed, context):
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    from mathutils import Vector

    place = np.array([[0.01, -0.02, 0.045]])
    world = bed.matrix_world @ Vector(place[0] * bridge.SCALE)
    theirs = location_3d_to_region_2d(context.region, context.region_data, world)
    # A thousandth of a pixel: theirs is reckoned in float32.
    assert_near(bridge.project(context, bed, place)[0], theirs, 1e-2)
    # What lies behind the eye is nowhere on the screen.
    assert np.isnan(bridge.project(context, bed, 1.5 * find_eye(bed, context)[None])).all()


def test_a_hidden_or_unevenly_scaled_bed_is_looked_through_and_says_why(bed, context):
    cells, height = aim.read_surface(bed)
    middle = np.array([[0.0, 0.0, float(height.max())]])
    xy = tuple(bridge.project(context, bed, middle)[0])
    assert aim.find_target(context, (0.0, 0.0)) is None
    assert aim.find_target(context, xy) is not None
    assert bpy.ops.digiclay.press.poll()
    bed.hide_set(True)
    assert not bpy.ops.digiclay.press.poll()
    assert aim.find_target(context, xy) is None
    bed.hide_set(False)
    bed.scale.z *= 1.2
    bpy.context.view_layer.update()
    assert aim.find_target(context, xy) is None
    with pytest.raises(DigiclayError, match="the same along x, y and z"):
        aim.hit_point(context, bed, cells, height, xy)


def test_without_a_session_the_surface_is_what_is_drawn(bed):
    cells, height = aim.read_surface(bed)
    wanted = make_grid(properties.scene_of(bed).layout)
    np.testing.assert_array_equal(cells.positions, wanted.positions)
    np.testing.assert_array_equal(height, bridge.read_cells(bed.data)["height"])


def test_the_patch_lies_on_the_pins_about_the_mouse_as_wide_as_the_finger_pressed_in(bed):
    cells, _ = aim.read_surface(bed)
    finger, turn = bridge.finger_of(fingertip_of(bed)), bridge.pose(fingertip_of(bed))[3:]
    middle = np.array([0.002, 0.001])
    rim = tool.find_outline(middle, finger, turn, 4e-3, Brush.LOWER, cells.layout)
    # Pressed in by half its height of 8 mm, an ellipsoid is cut at sqrt(3)/2 of its width.
    across = np.ptp(rim, axis=0) / 2
    np.testing.assert_allclose(
        across, np.sqrt(0.75) * np.array([finger.length, finger.width]), rtol=1e-6
    )
    assert_near(rim.mean(axis=0), middle, 1e-9)


@table(
    "shown, words",
    {
        "raised": ((Brush.RAISE, 15e-3), "Raise, height 15 mm"),
        "in part": ((Brush.LOWER, 4e-3, 0.5), "Lower, depth 4 mm × 50 %"),
        "leveled": ((Brush.LEVEL, 4e-3), "Level 100 %"),
        "smoothed": ((Brush.SMOOTH, 4e-3, 0.8), "Smooth 80 %"),
        "unlocked": ((Brush.UNLOCK, 4e-3), "Unlock"),
        "stamped": ((Brush.STAMP, 4e-3), "Stamp, height 4 mm"),
    },
)
def test_the_text_beside_the_cursor_names_brush_and_height_or_depth_with_its_unit(shown, words):
    assert brush.describe_brush(Fingertip(), *shown) == f"Size 16 mm   {words}"


def test_brushes_that_raise_have_a_height():
    high = {kind for kind in Brush if brush.amount_name(kind) == "height"}
    assert high == {Brush.RAISE, Brush.STAMP, Brush.CREST}


@pytest.fixture
def paper(extension):
    made = new_bed()
    bpy.context.view_layer.update()
    return made


def lengths(paper):
    """Return size of the fingertip, then radius, edge and flat radius of the blister, mm."""
    scene = properties.scene_of(paper)
    width = 2.0 * scene.fingers[0].fingertip.width
    return tuple(round(1e3 * length, 4) for length in (width, *astuple(scene.blister)[:3]))


@pytest.mark.parametrize(
    "follows, size, wanted",
    [
        (True, 8.0, (8.0, 7.5, 9.25, 3.0)), (False, 8.0, (8.0, 15.0, 18.5, 6.0)),
        (False, 60.0, (60.0, 15.0, 18.5, 6.0)),
    ],
)  # fmt: skip
def test_the_ellipsoid_follows_the_size_and_the_blister_unless_it_is_set_by_itself(
    paper, follows, size, wanted
):
    before = bridge.pose(fingertip_of(paper))
    paper.digiclay.blister_follows = follows
    paper.digiclay.size = size
    assert lengths(paper) == wanted
    bpy.context.view_layer.update()
    finger, half = bridge.finger_of(fingertip_of(paper)), size * 0.5e-3
    assert (finger.length, finger.width, finger.height) == pytest.approx(
        (1.25 * half, half, half), rel=1e-6
    )
    # The lowest point stays: a larger finger does not press.
    assert_near(bridge.pose(fingertip_of(paper)), before, 1e-7)


@pytest.mark.parametrize("name, usual", [("length", 20.0), ("width", 16.0), ("height", 16.0)])
def test_the_panel_shows_whole_widths_and_stores_semi_axes(paper, name, usual):
    group, lowest = paper.digiclay.fingertip, bridge.pose(fingertip_of(paper))
    assert getattr(group, f"whole_{name}") == usual
    setattr(group, f"whole_{name}", 12.6)
    bpy.context.view_layer.update()
    (finger,) = properties.scene_of(paper).fingers
    assert getattr(finger.fingertip, name) == 6.3e-3
    assert paper.digiclay.size == pytest.approx(12.6 if name == "width" else 16.0)
    assert_near(bridge.pose(fingertip_of(paper)), lowest, 1e-7)
    assert group.bl_rna.properties[f"whole_{name}"].description.endswith(f"by default {usual:g} mm")


@pytest.mark.parametrize(
    "typed, share",
    [
        ("0.5", 0.5),
        (".25", 0.25),
        ("1", 1.0),
        ("50", 0.5),
        ("50 %", 0.5),
        ("0.5%", 5e-3),
        ("2*0.3", 0.6),
    ],
)
def test_a_strength_is_typed_as_a_share_or_in_per_cent(typed, share):
    assert AdjustStrength.parse(None, typed) == pytest.approx(share, rel=1e-9)


def test_a_blister_that_the_bed_limits_is_the_same_again_with_the_size_before(paper):
    paper.digiclay.size = 100.0
    # Half the bed's longer side; a wider blister is no valid scene.
    assert lengths(paper)[:2] == (100.0, 37.5)
    paper.digiclay.size = 80.0
    assert lengths(paper)[1] == 37.5
    paper.digiclay.size = 16.0
    assert lengths(paper) == pytest.approx((16.0, 15.0, 18.5, 6.0), rel=1e-5)


@pytest.mark.parametrize("asked, got", [(-5.0, 1.0), (0.0, 1.0), (1e9, 200.0)])
def test_a_size_stays_within_what_a_finger_can_have(paper, asked, got):
    devices.set_size(paper, 1e-3 * asked)
    assert lengths(paper)[0] == pytest.approx(got, rel=1e-6)


def test_the_bracket_keys_scale_it_and_undo_brings_it_back_and_without_a_fingertip_they_do_nothing(
    paper,
):
    bpy.ops.ed.undo_push(message="Add")
    bpy.ops.digiclay.press_scale("EXEC_DEFAULT", True, scalar=1.5)
    assert lengths(bpy.context.object)[0] == pytest.approx(24.0)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(16.0)
    bpy.data.objects.remove(fingertip_of(bpy.context.object))
    assert not bpy.ops.digiclay.press_scale.poll()


@pytest.mark.parametrize("kind", list(FINGERS))
def test_each_preset_finger_can_be_simulated_and_is_undone_in_one_step(paper, kind):
    bpy.ops.ed.undo_push(message="Add")
    paper.digiclay.size = 30.0
    bpy.ops.ed.undo_push(message="Size")
    bpy.ops.digiclay.press_finger("EXEC_DEFAULT", True, kind=kind)
    scene = properties.scene_of(bpy.context.object)
    assert find_kind(scene.fingers[0].fingertip) is FINGERS[kind]
    assert scene.blister.radius == pytest.approx(
        min(37.5e-3, 15 / 8 * FINGERS[kind].finger.width), rel=1e-5
    )
    assemble(scene)
    bpy.ops.ed.undo()
    assert lengths(bpy.context.object)[0] == pytest.approx(30.0)


PRESS = "[[stroke]]\ndepth = 0.003\nwidth = 0.012\nmoves = [[0, -0.006, 0], [0.2, 0.006, 0]]\n"


@pytest.fixture
def small(extension):
    return new_bed(rows=9, columns=11)


def depths(small):
    """Return how far the pins drawn are below rest, mm."""
    return 40.0 - 1e3 * bridge.read_cells(small.data)["height"].reshape(9, 11)


def test_strokes_are_formed_and_kept_by_the_bed(small, tmp_path):
    file = tmp_path / "press.toml"
    file.write_text(PRESS, encoding="utf-8")
    assert bpy.ops.digiclay.play_strokes(filepath=str(file)) == {"FINISHED"}
    assert depths(small)[4, 5] > 1.5
    assert running.find(small) is None
    assert beds.read_snapshot(small) is not None
    # Its fingertip is above the bed again, of its own size.
    assert bridge.finger_of(fingertip_of(small)).width == pytest.approx(8e-3)
    assert bridge.pose(fingertip_of(small))[2] > 40e-3


@pytest.mark.parametrize("kind, deepest", [("crease", (2.8, 3.1)), ("flatten", (-0.1, 0.1))])
def test_creases_are_cut_and_flattened_without_a_touch(small, tmp_path, kind, deepest):
    file, crease = tmp_path / "press.toml", f'{PRESS}brush = "crease"\n'
    more = f'{PRESS}brush = "{kind}"\nfalloff = "constant"\n' if kind == "flatten" else ""
    file.write_text(f"{crease}{more}", encoding="utf-8")
    assert bpy.ops.digiclay.play_strokes(filepath=str(file)) == {"FINISHED"}
    low, high = deepest
    row = depths(small)[4, 4:7]
    assert low < row.max() - (row.min() if kind == "flatten" else 0.0) < high


@pytest.mark.parametrize(
    "text, said",
    [
        ("[[stroke", "line 1"),
        (f'{PRESS}falloff = "bent"\n', "falloff must be one of"),
        (f'{PRESS}falloff = "root"\n', r"Stroke 1 \(lower\) needs a method with a blister"),
        (f"{PRESS}wide = 3", "known key"),
        (f'{PRESS}{PRESS}brush = "raise"\n', r"Stroke 2 \(raise\) needs a method with a blister"),
    ],
)
def test_strokes_that_cannot_be_read_or_formed_leave_the_bed_as_it_was(small, tmp_path, text, said):
    small.digiclay.method = "elastic"
    file = tmp_path / "wrong.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RuntimeError, match=said) as caught:
        bpy.ops.digiclay.play_strokes(filepath=str(file))
    assert "Traceback" not in str(caught.value)
    assert np.abs(depths(small)).max() < 1e-3
    assert running.find(small) is None
