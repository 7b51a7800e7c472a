"""A bed shown as automatic is a skin where a pitch is smaller than 3 pixels, and pins again above 4."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from digiclay.device.detail import choose_far, measure_pitch
from mathutils import Matrix, Vector


@pytest.mark.parametrize(
    ("pitch", "before", "after"),
    [
        (2.9, False, True), (3.1, False, False), (3.9, True, True), (4.1, True, False), (0.0, True, False),
        (math.nan, True, False), (math.inf, True, False),
    ],
)  # fmt: skip
def test_the_two_limits_keep_a_bed_from_flickering(pitch: float, before: bool, after: bool) -> None:
    assert choose_far(pitch, before) is after


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_the_pitch_is_as_many_pixels_as_a_camera_shows(kind: str) -> None:
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


def test_a_bed_behind_the_eye_has_no_size() -> None:
    behind = np.diag([1.0, 1.0, 1.0, -2.0])
    assert measure_pitch(behind, np.eye(4), 0.03, 800) == 0.0
