"""The view that a bed is added to: it shows the bed whole, and a shading nobody has changed is lit."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from digiclay.operators.ready_view import FACTORY, RELIEF, SPACE, find_eye, place_eye
from digiclay.overlay.sections import find_compact_box
from digiclay.preferences import CORNERS

pytestmark = pytest.mark.usefixtures("extension")


LENS = np.array([1.4, 2.1])


def project(points: np.ndarray, eye: np.ndarray, parallel: bool) -> np.ndarray:
    """Return where an eye sees points (k, 3), (k, 2), -1 to 1."""
    return LENS * (points[:, :2] - eye[:2]) / (eye[2] if parallel else eye[2] - points[:, 2:])


@pytest.mark.parametrize("parallel", [False, True])
def test_the_nearest_eye_sees_all_points_in_the_room_and_they_touch_two_sides(parallel: bool) -> None:
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (40, 3)) * [0.8, 0.7, 0.2]
    room = np.array([[-0.9, -1.0], [0.3, 0.6]])
    seen = project(points, place_eye(points, LENS, room, parallel), parallel)
    low, high = room + SPACE * (room[1] - room[0]) * [[1.0], [-1.0]]
    assert (low - 1e-9 <= seen).all()
    assert (seen <= high + 1e-9).all()
    assert (np.isclose(seen.min(axis=0), low) & np.isclose(seen.max(axis=0), high)).any()


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("corner", CORNERS)
def test_nothing_of_a_bed_is_seen_behind_the_overlay(corner: str, parallel: bool) -> None:
    size, room = np.array([1050.0, 700.0]), (50.0, 0.0, 780.0, 650.0)
    box = find_compact_box(room, 2.0, corner)
    assert (box[0] == 50.0, box[2] == 780.0) == (corner.endswith("left"), corner.endswith("right"))
    assert (box[1] == 0.0, box[3] == 650.0) == (corner.startswith("bottom"), corner.startswith("top"))
    free, taken = (2.0 * np.reshape(part, (2, 2)) / size - 1.0 for part in (room, box))
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (2000, 3)) * [0.8, 0.7, 0.2]
    corners = np.stack(np.meshgrid([-0.8, 0.8], [-0.7, 0.7], [-0.2, 0.2]), axis=-1).reshape(-1, 3)
    eye = find_eye(corners, LENS, free, taken, parallel)
    assert eye is not None
    seen = project(points, eye, parallel)
    assert ((free[0] < seen) & (seen < free[1])).all()
    assert not ((taken[0] < seen) & (seen < taken[1])).all(axis=1).any()
    # As near as without an overlay where it leaves room enough.
    small = find_compact_box(room, 0.3, corner)
    near = find_eye(corners, LENS, free, 2.0 * np.reshape(small, (2, 2)) / size - 1.0, parallel)
    assert near is not None
    assert near[2] < eye[2]


def test_a_view_without_room_is_left_as_it_is() -> None:
    nothing = np.array([[0.2, -0.5], [0.1, 0.5]])
    assert find_eye(np.eye(3), LENS, nothing, nothing, False) is None


def test_the_file_blender_starts_with_is_what_is_lit_and_can_be() -> None:
    views = [area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D"]
    shading = views[0].spaces.active.shading
    assert {name: getattr(shading, name) for name in FACTORY} == FACTORY
    for name, value in RELIEF.items():
        setattr(shading, name, value)
    assert {name: getattr(shading, name) for name in RELIEF} == RELIEF
    sculpting = next(area for area in bpy.data.screens["Sculpting"].areas if area.type == "VIEW_3D")
    assert sculpting.spaces.active.shading.light == RELIEF["light"]
