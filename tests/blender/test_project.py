"""Places under the mouse on a formed bed: on the seen surface, or on the plane of the pins at rest."""

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.surface.pointing import intersect_surface
from digiclay.press import aim

from tests.assemble import assert_near
from tests.blender.at_hand import in_the_view, new_bed

REST, RIDGE = 40e-3, 15e-3


@pytest.fixture
def context(extension):
    """A bed with a ridge of 15 mm along y, in a 3D view."""
    bed = new_bed(rows=25, columns=25)
    bed.scale = (4.0,) * 3
    cells, height = aim.read_surface(bed)
    ridge = RIDGE * np.exp(-((cells.x / 8e-3) ** 2))
    bridge.write_cells(bed.data, cells.positions, height + ridge)
    bpy.context.view_layer.update()
    with in_the_view():
        yield bpy.context


def draw_line(context, project):
    """Return where a line across the ridge goes, (k, 2), m, that is straight in the view."""
    bed = context.object
    ends = np.array([[-30e-3, -15e-3, REST], [30e-3, 15e-3, REST]])
    first, last = bridge.project(context, bed, ends)
    pixels = first + np.linspace(0.0, 1.0, 31)[:, None] * (last - first)
    return np.array([aim.find_target(context, tuple(xy), project).point[:2] for xy in pixels])


def measure_bend(path):
    """Return how far a path is from the straight line between its ends, m."""
    (x, y), way = (path[-1] - path[0]) / np.linalg.norm(path[-1] - path[0]), path - path[0]
    return float(np.abs(x * way[:, 1] - y * way[:, 0]).max())


def test_in_perspective_a_straight_line_is_straight_on_the_rest_plane_and_bends_on_a_ridge(context):
    # Blender's matrices are float32, at a distance of 2 m of the device.
    assert measure_bend(draw_line(context, aim.PLANE)) < 5e-6
    assert measure_bend(draw_line(context, aim.SURFACE)) > 3e-3


def test_a_ray_along_the_pins_as_in_an_orthographic_top_view_meets_both_at_the_same_place(context):
    cells, height = aim.read_surface(context.object)
    flat, down = np.full_like(height, REST), np.array([0.0, 0.0, -1.0])
    for x in np.linspace(-30e-3, 30e-3, 31):
        eye = np.array([x, x / 2, 1.0])
        met = [intersect_surface(cells, surface, eye, down)[:2] for surface in (height, flat)]
        assert_near(*met, 1e-12)
