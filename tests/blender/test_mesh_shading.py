"""Make Mesh shades the formed skin smooth, and walls, base and pins flat, in every version of Blender."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from digiclay.core.model.layout import Layout, make_grid
from digiclay.device import view
from digiclay.device.instant import Instant

from tests.blender.at_hand import new_bed

LAYOUT = Layout(rows=12, columns=14)


@pytest.fixture
def bed(extension: None) -> bpy.types.Object:
    """A bed with a boss, a crease, a cliff of 20 mm through both rims, and a pin on a rim that stands out."""
    x, y = make_grid(LAYOUT).positions.T * 1e3
    number = np.arange(x.size)
    raised = 5.0 * np.exp(-((x + 3) ** 2 + y**2) / 20.0) - 4.0 * np.exp(-((x - 9) ** 2 + y**2) / 20.0)
    raised += np.where(number % 14 < 3, 20.0, 0.0) + np.where(number == 160, 15.0, 0.0)
    made = new_bed(rows=LAYOUT.rows, columns=LAYOUT.columns)
    finger = np.array([0.0, 0.0, 0.09, 1.0, 0.0, 0.0, 0.0])
    modes, forces = number % 8, np.zeros(x.size)
    view.show(made, Instant(make_grid(LAYOUT).positions, 0.04 + raised * 1e-3, modes, forces, finger))
    return made


@pytest.mark.parametrize("kind", ["solid", "surface", "features"])
@pytest.mark.parametrize("skin", ["bilinear", "smooth"])
def test_the_skin_is_smooth_and_walls_and_base_are_flat(bed: bpy.types.Object, kind: str, skin: str) -> None:
    bpy.ops.mesh.digital_clay_make(kind=kind, skin=skin)
    faces = bpy.context.object.data.polygons
    assert {face.use_smooth for face in faces if face.normal.z > 1e-3} == {True}
    downwards = {face.use_smooth for face in faces if face.normal.z < 1e-3}
    assert downwards == (set() if kind == "surface" else {False})


def test_the_rim_of_a_solid_is_sharp_and_nothing_within_its_skin(bed: bpy.types.Object) -> None:
    bpy.ops.mesh.digital_clay_make(kind="pins")
    assert not any(face.use_smooth for face in bpy.context.object.data.polygons)
    bpy.context.view_layer.objects.active = bed
    bpy.ops.mesh.digital_clay_make(kind="solid")
    mesh = bpy.context.object.data
    beside: dict[tuple[int, int], set[bool]] = {key: set() for key in mesh.edge_keys}
    for face in mesh.polygons:
        for key in face.edge_keys:
            beside[key].add(face.use_smooth)
    for edge in mesh.edges:
        shades = beside[edge.key]
        if shades != {False}:
            assert edge.use_edge_sharp == (shades == {True, False})
    assert sum(shades == {True, False} for shades in beside.values()) >= 2 * (12 + 14) - 4
