"""The mouse points at the pin drawn under it, and the Press tool comes and goes with the extension."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import make_grid
from digiclay.press import aim, brush, tool
from digiclay.press.tool import drape
from digiclay.roles import fingertip_of
from digiclay.settings import properties
from digiclay.strokes.stroke import Brush

from tests.blender.at_hand import in_the_view, new_bed

#: How much larger the bed is than it is added: it then fills a good part of the factory file's view.
LARGER = 8.0


def tools() -> list[str]:
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
def bed(extension: None) -> Any:
    """A staggered bed whose pins all have heights of their own, turned, moved and scaled uniformly."""
    made = new_bed(rows=12, columns=15, arrangement="staggered")
    made.scale = (LARGER,) * 3
    made.rotation_euler = (0.1, -0.2, 0.5)
    cells, height = aim.read_surface(made)
    bridge.write_cells(made.data, cells.positions, height + 0.0003 * np.sin(np.arange(cells.count)))
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def context(bed: Any) -> Iterator[Any]:
    """The context as in the main region of the 3D view."""
    with in_the_view():
        yield bpy.context


def test_blender_reads_the_icon_of_the_tool() -> None:
    # As Blender's toolbar does: the name with the ending of its format.
    handle = bpy.app.icons.new_triangles_from_file(f"{tool.PressTool.bl_icon}.dat")
    assert handle > 0
    bpy.app.icons.release(handle)


def test_the_tool_comes_and_goes_with_the_extension() -> None:
    assert tools() == []
    for _ in range(2):
        digiclay.register()
        assert tools() == [tool.PressTool.bl_idname]
        digiclay.unregister()
        assert tools() == []


def test_a_pixel_on_the_top_of_a_pin_points_at_that_pin(bed: Any, context: Any) -> None:
    cells, height = aim.read_surface(bed)
    tops = np.column_stack([cells.positions, height])
    pixels = bridge.project(context, bed, tops)
    met = [aim.find_target(context, tuple(xy)) for xy in pixels]
    assert all(found is not None and found.bed == bed for found in met)
    hit = np.array([found.pin for found in met])
    near = np.array([found.point for found in met])
    # A pin may hide another; whatever is met lies in front of the top that was asked for, on the same ray.
    eye = np.array(context.region_data.view_matrix.inverted().translation)
    eye = np.array(bed.matrix_world.inverted()) @ [*eye, 1.0]
    eye = eye[:3] / bridge.SCALE
    visible = hit == np.arange(cells.count)
    assert visible.sum() > 0.9 * cells.count
    # Blender's matrices are float32, at a distance of 2 m of the device.
    np.testing.assert_allclose(near[visible], tops[visible], rtol=0, atol=2e-6)
    closer = np.linalg.norm(near - eye, axis=1) <= np.linalg.norm(tops - eye, axis=1) + 2e-6
    assert closer.all()


def test_a_place_in_the_view_agrees_with_blenders_own_projection(bed: Any, context: Any) -> None:
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    from mathutils import Vector

    place = np.array([[0.01, -0.02, 0.045]])
    world = bed.matrix_world @ Vector(place[0] * bridge.SCALE)
    theirs = location_3d_to_region_2d(context.region, context.region_data, world)
    # A thousandth of a pixel: theirs is reckoned in float32.
    np.testing.assert_allclose(bridge.project(context, bed, place)[0], theirs, rtol=0, atol=1e-2)
    # What lies behind the eye is nowhere on the screen.
    eye = np.array(bed.matrix_world.inverted() @ context.region_data.view_matrix.inverted().translation)
    assert np.isnan(bridge.project(context, bed, 1.5 * eye[None] / bridge.SCALE)).all()


def test_a_hidden_or_unevenly_scaled_bed_is_looked_through_and_says_why(bed: Any, context: Any) -> None:
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


def test_without_a_session_the_surface_is_what_is_drawn(bed: Any) -> None:
    cells, height = aim.read_surface(bed)
    wanted = make_grid(properties.scene_of(bed).layout)
    np.testing.assert_array_equal(cells.positions, wanted.positions)
    np.testing.assert_array_equal(height, bridge.read_cells(bed.data)["height"])


def test_the_patch_lies_on_the_pins_about_the_mouse_as_wide_as_the_finger_pressed_in(bed: Any) -> None:
    cells, height = aim.read_surface(bed)
    rim = tool.touch_outline(bed, cells, height, np.array([0.002, 0.001, 0.04]), 4e-3)
    finger = bridge.finger_of(fingertip_of(bed))
    # Pressed in by half its height of 8 mm, an ellipsoid is cut at sqrt(3)/2 of its width.
    across = np.ptp(rim[:, :2], axis=0) / 2
    np.testing.assert_allclose(across, np.sqrt(0.75) * np.array([finger.length, finger.width]), rtol=1e-6)
    np.testing.assert_array_equal(rim, drape(cells, height, rim[:, :2]))


def test_the_text_beside_the_cursor_names_brush_and_height_or_depth_with_its_unit() -> None:
    finger = Fingertip()
    assert brush.describe_brush(finger, Brush.RAISE, 15e-3) == "Size 16 mm   Raise, height 15 mm"
    assert brush.describe_brush(finger, Brush.LOWER, 4e-3, 0.5) == "Size 16 mm   Lower, depth 4 mm × 50 %"
    assert brush.describe_brush(finger, Brush.LEVEL, 4e-3) == "Size 16 mm   Level 100 %"
    assert brush.describe_brush(finger, Brush.SMOOTH, 4e-3, 0.8) == "Size 16 mm   Smooth 80 %"
    assert brush.describe_brush(finger, Brush.UNLOCK, 4e-3) == "Size 16 mm   Unlock"
    assert brush.describe_brush(finger, Brush.STAMP, 4e-3) == "Size 16 mm   Stamp, height 4 mm"
    assert [one for one in Brush if brush.amount_name(one) == "height"] == [Brush.RAISE, Brush.STAMP]
