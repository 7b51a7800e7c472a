"""The view that a bed is added to: it shows the bed whole, and a shading nobody has changed is lit."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from digiclay.operators.ready_view import FACTORY, RELIEF, SPACE, place_eye
from digiclay.overlay.sections import list_rooms
from digiclay.preferences import CORNERS

pytestmark = pytest.mark.usefixtures("extension")


@pytest.mark.parametrize("parallel", [False, True])
def test_the_nearest_eye_sees_all_points_in_the_room_and_touches_two_of_its_sides(parallel: bool) -> None:
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (40, 3)) * [0.8, 0.7, 0.2] + [3.0, -2.0, 1.0]
    lens, room = np.array([1.4, 2.1]), np.array([[-0.9, -1.0], [0.3, 0.6]])
    x, y, z = place_eye(points, lens, room, parallel)
    seen = lens * (points[:, :2] - [x, y]) / (z if parallel else z - points[:, 2:])
    low, high = room + SPACE * (room[1] - room[0]) * [[1.0], [-1.0]]
    assert (low - 1e-9 <= seen).all()
    assert (seen <= high + 1e-9).all()
    both = np.isclose(seen.min(axis=0), low) & np.isclose(seen.max(axis=0), high)
    assert both.any()
    assert np.allclose(seen.min(axis=0) - low, high - seen.max(axis=0)) or not parallel


@pytest.mark.parametrize("corner", CORNERS)
def test_a_bed_has_room_beside_or_below_the_overlay(corner: str) -> None:
    room = (50.0, 0.0, 1050.0, 700.0)
    beside, below = list_rooms(room, 2.0, corner)
    assert (beside[2] - beside[0], beside[3] - beside[1]) == (1000.0 - 2 * (190.0 + 24.0), 700.0)
    assert below[2] - below[0] == 1000.0
    assert (beside[0] > 50.0) is corner.endswith("left")
    assert (below[3] < 700.0) is corner.startswith("top")


def test_the_file_blender_starts_with_is_what_is_lit_and_can_be() -> None:
    views = [area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D"]
    shading = views[0].spaces.active.shading
    assert {name: getattr(shading, name) for name in FACTORY} == FACTORY
    for name, value in RELIEF.items():
        setattr(shading, name, value)
    assert {name: getattr(shading, name) for name in RELIEF} == RELIEF
    sculpting = next(area for area in bpy.data.screens["Sculpting"].areas if area.type == "VIEW_3D")
    assert sculpting.spaces.active.shading.light == RELIEF["light"]
