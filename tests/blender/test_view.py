"""The bed Blender evaluates is the bed that was handed in."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge, view
from digiclay.core.fingertip import Fingertip
from digiclay.core.modes import COLOURS, Mode
from digiclay.instant import Instant

#: Attributes are float32: 24 bits of at most 0.1 m, drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


def drawn_pins(bed: Any) -> tuple[np.ndarray, list[str]]:
    """Return what Blender draws for a bed: pin tops (n, 3), m, and each one's material."""
    graph = bpy.context.evaluated_depsgraph_get()
    tops, materials = [], []
    for item in graph.object_instances:
        if item.is_instance and item.parent.original == bed:
            tops.append(np.array(item.matrix_world.translation) / bridge.SCALE)
            materials.append(item.object.material_slots[0].material[view.ROLE])
    return np.array(tops), materials


@pytest.fixture
def bed(formed: Instant) -> Any:
    """The formed bed, built in the open scene."""
    return view.build(formed, bpy.context.scene.collection)


def test_the_pins_drawn_stand_where_the_arrays_say(bed: Any, formed: Instant) -> None:
    tops, _ = drawn_pins(bed)
    assert tops.shape == (48, 3)
    np.testing.assert_allclose(tops[:, :2], formed.position, rtol=0, atol=FLOAT32)
    np.testing.assert_allclose(tops[:, 2], formed.height, rtol=0, atol=FLOAT32)


def test_every_pin_drawn_wears_the_material_of_its_mode(bed: Any, formed: Instant) -> None:
    _, materials = drawn_pins(bed)
    assert materials == [Mode(int(code)).name.lower() for code in formed.mode]


def test_the_modes_have_as_many_materials_each_in_its_colour(bed: Any) -> None:
    for mode in Mode:
        (material,) = (m for m in bpy.data.materials if m.get(view.ROLE) == mode.name.lower())
        wanted = bridge.linear(COLOURS[mode])
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        # Both are stored as float32 numbers up to 1.
        np.testing.assert_allclose(material.diffuse_color, wanted, rtol=0, atol=1e-6)
        np.testing.assert_allclose(shader.inputs["Base Color"].default_value, wanted, rtol=0, atol=1e-6)


def test_showing_another_instant_moves_and_recolours_the_pins(bed: Any, formed: Instant) -> None:
    drawn_pins(bed)
    later = Instant(
        position=formed.position,
        height=formed.height[::-1],
        mode=formed.mode[::-1],
        force=formed.force,
        fingertip=formed.fingertip,
    )
    view.show(bed, later)
    tops, materials = drawn_pins(bed)
    np.testing.assert_allclose(tops[:, 2], later.height, rtol=0, atol=FLOAT32)
    assert materials == [Mode(int(code)).name.lower() for code in later.mode]


def test_cells_are_read_back_as_they_were_written(bed: Any, formed: Instant) -> None:
    cells = bridge.read_cells(bed.data)
    np.testing.assert_allclose(cells["position"], formed.position, rtol=0, atol=FLOAT32)
    np.testing.assert_allclose(cells["height"], formed.height, rtol=0, atol=FLOAT32)
    np.testing.assert_array_equal(cells["mode"], formed.mode)
    np.testing.assert_allclose(cells["force"], formed.force, rtol=2.0**-23)


def test_a_second_bed_shares_the_materials_and_nothing_else(bed: Any, formed: Instant) -> None:
    materials = len(bpy.data.materials)
    other = view.build(formed, bpy.context.scene.collection)
    assert len(bpy.data.materials) == materials
    assert other.data != bed.data
    assert other.modifiers[0].node_group != bed.modifiers[0].node_group


def test_a_tilted_fingertip_touches_down_at_its_lowest_point(bed: Any, formed: Instant) -> None:
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    fingertip = view.fingertip_of(bed)
    bridge.place_fingertip(fingertip, at, formed.finger)
    bpy.context.view_layer.update()
    skin = [fingertip.matrix_world @ vertex.co for vertex in fingertip.data.vertices]
    lowest = np.array(min(skin, key=lambda point: point.z)) / bridge.SCALE
    # The skin is a mesh of 64 facets round: its lowest vertex is within a facet (10 mm * pi / 64)
    # of the lowest point, and above it by no more than the facet's sagitta.
    assert np.linalg.norm(lowest[:2] - at[:2]) < 0.010 * np.pi / 32
    assert 0.0 <= lowest[2] - at[2] < 0.010 * (np.pi / 64) ** 2


def test_the_pose_of_a_fingertip_is_read_back(bed: Any, formed: Instant) -> None:
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    fingertip = view.fingertip_of(bed)
    bridge.place_fingertip(fingertip, at, Fingertip(length=0.012))
    bed.location = (3.0, -2.0, 1.0)
    bed.rotation_euler = (0.0, 0.0, 0.7)
    bpy.context.view_layer.update()
    # Blender's matrices are float32, and this one is inverted three units from the origin.
    np.testing.assert_allclose(bridge.pose(fingertip), at, rtol=0, atol=2e-6)


def test_every_rod_reaches_down_to_the_deck_of_the_housing(bed: Any, formed: Instant) -> None:
    graph = bpy.context.evaluated_depsgraph_get()
    feet = [
        min((item.matrix_world @ vertex.co).z for vertex in item.object.data.vertices)
        for item in graph.object_instances
        if item.is_instance and item.parent.original == bed
    ]
    assert len(feet) == 48
    housing = next(child for child in bed.children if child[view.ROLE] == view.HOUSING)
    deck = housing.data.vertices[-1].co.z  # the housing is drawn from its underside to the deck inside
    # float32 on lengths below one unit.
    np.testing.assert_allclose(feet, deck, rtol=0, atol=1e-6)
    assert deck / bridge.SCALE < formed.height.min()
