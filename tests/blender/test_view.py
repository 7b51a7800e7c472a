"""The bed Blender evaluates is the bed that was handed in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import DigiclayError
from digiclay.core.base.modes import COLORS, Mode
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.device import heat, view
from digiclay.device.instant import Instant
from digiclay.device.node_tree import ARROW_LENGTH, ARROWS, TOP_FORCE
from digiclay.roles import ROLE, fingertip_of

from tests.blender.at_hand import instances, open_bed

#: Attributes are float32: 24 bits of at most 0.1 m, drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


def drawn_pins(bed: Any) -> tuple[np.ndarray, list[str]]:
    """Return what Blender draws for a bed: pin tops (n, 3), m, and each one's material."""
    tops, materials = [], []
    for item in instances(bed):
        tops.append(np.array(item.matrix_world.translation) / bridge.SCALE)
        materials.append(item.object.material_slots[0].material[ROLE])
    return np.array(tops), materials


@pytest.fixture
def bed(formed: Instant) -> Any:
    """The formed bed, built in the open scene."""
    return open_bed("formed", lambda: view.build(formed, bpy.context.scene.collection))


def test_the_pins_stand_where_the_arrays_say_in_the_material_of_their_mode(bed: Any, formed: Instant) -> None:
    later = replace(formed, height=formed.height[::-1], mode=formed.mode[::-1], force=formed.force[::-1])
    for instant in (formed, later):
        view.show(bed, instant)
        tops, materials = drawn_pins(bed)
        wanted = np.column_stack([instant.position, instant.height])
        np.testing.assert_allclose(tops, wanted, rtol=0, atol=FLOAT32)
        assert not view.wants_force(bed)  # an instant's forces are there though nothing drawn tells them
        assert np.array_equal(bridge.read_cells(bed.data)["force"], instant.force.astype(np.float32))
        assert materials == [Mode(int(code)).name.lower() for code in instant.mode]


def test_the_modes_have_as_many_materials_each_in_its_color(bed: Any) -> None:
    for mode in Mode:
        (material,) = (m for m in bpy.data.materials if m.get(ROLE) == mode.name.lower())
        wanted = bridge.linear(COLORS[mode])
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        # Both are stored as float32 numbers up to 1.
        np.testing.assert_allclose(material.diffuse_color, wanted, rtol=0, atol=1e-6)
        np.testing.assert_allclose(shader.inputs["Base Color"].default_value, wanted, rtol=0, atol=1e-6)


def test_a_second_bed_shares_the_materials_and_nothing_else(bed: Any, formed: Instant) -> None:
    materials = len(bpy.data.materials)
    other = view.build(formed, bpy.context.scene.collection)
    assert len(bpy.data.materials) == materials
    assert other.data != bed.data
    assert other.modifiers[0].node_group != bed.modifiers[0].node_group


def test_a_tilted_fingertip_touches_down_at_its_lowest_point(bed: Any, formed: Instant) -> None:
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    fingertip = fingertip_of(bed)
    bridge.place_fingertips(bed, at[None], formed.fingers)
    bpy.context.view_layer.update()
    (ball,) = fingertip.children
    # The ball is taken hold of as its fingertip (test_unit): it does not move in it.
    assert (fingertip.type, ball.type, all(ball.lock_location)) == ("EMPTY", "MESH", True)
    skin = [ball.matrix_world @ vertex.co for vertex in ball.data.vertices]
    lowest = np.array(min(skin, key=lambda point: point.z)) / bridge.SCALE
    # The skin is a mesh of 64 facets round: its lowest vertex is within a facet (10 mm * pi / 64)
    # of the lowest point, and above it by no more than the facet's sagitta.
    assert np.linalg.norm(lowest[:2] - at[:2]) < 0.010 * np.pi / 32
    assert 0.0 <= lowest[2] - at[2] < 0.010 * (np.pi / 64) ** 2


def test_every_rod_reaches_down_to_the_deck_of_the_housing(bed: Any, formed: Instant) -> None:
    feet = [
        min((item.matrix_world @ vertex.co).z for vertex in item.object.data.vertices)
        for item in instances(bed)
    ]
    assert len(feet) == 48
    housing = bed.evaluated_get(bpy.context.evaluated_depsgraph_get())
    deck = housing.data.vertices[-1].co.z  # the housing is drawn from its underside to the deck inside
    # float32 on lengths below one unit.
    np.testing.assert_allclose(feet, deck, rtol=0, atol=1e-6)
    assert deck / bridge.SCALE < formed.height.min()


def test_the_pose_of_a_fingertip_is_read_back_however_things_are_scaled(bed: Any, formed: Instant) -> None:
    fingertip = fingertip_of(bed)
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    bed.location, bed.rotation_euler, bed.scale = (3.0, -2.0, 1.0), (0.2, -0.4, 0.9), (2.5, 2.5, 2.5)
    for pose, finger in ((formed.fingertip, formed.finger), (at, Fingertip(length=0.012))):
        bridge.place_fingertips(bed, pose[None], [finger])
        bpy.context.view_layer.update()
        # Blender's matrices are float32, and this one is inverted three units from the origin.
        np.testing.assert_allclose(bridge.pose(fingertip), pose, rtol=0, atol=2e-6)
    assert bridge.uniform(bed) == pytest.approx(2.5, rel=1e-6)
    bridge.place_fingertips(bed, formed.fingertips, formed.fingers)
    fingertip.scale = (3.0, 1.0, 0.5)  # by hand: what touches stays
    bpy.context.view_layer.update()
    np.testing.assert_allclose(bridge.pose(fingertip), formed.fingertip, rtol=0, atol=2e-6)


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        ((1.0, 1.0, 1.1), r"the same along x, y and z \(got 1 x 1 x 1\.1\)"),
        ((0.0, 0.0, 0.0), r"above 0 along x, y and z \(got 0 x 0 x 0\)"),
        ((-1.0, -1.0, -1.0), "must not mirror it"),
    ],
)
def test_a_bed_not_scaled_uniformly_is_refused(
    bed: Any, scale: tuple[float, float, float], said: str
) -> None:
    bed.scale = scale
    bpy.context.view_layer.update()
    with pytest.raises(DigiclayError, match=said):
        bridge.pose(fingertip_of(bed))
    cube = bpy.data.objects["Cube"]
    bed.parent, bed.scale, bed.rotation_euler = cube, (1.0, 1.0, 1.0), (0.0, 0.0, 0.7853981)
    cube.scale = (1.0, 2.0, 1.0)
    bpy.context.view_layer.update()
    with pytest.raises(DigiclayError, match="sheared"):
        bridge.uniform(bed)


def test_a_display_that_draws_nothing_is_refused(bed: Any) -> None:
    bed.modifiers.clear()
    assert not view.wants_force(bed)
    with pytest.raises(DigiclayError, match="Digital Clay must have the geometry nodes modifier"):
        view.color_by(bed, "force")


def level_of(force: np.ndarray, top: float = heat.TOP) -> np.ndarray:
    """Return the level of each force: 0 without force, 1 to 12 for the colors."""
    return np.clip(np.ceil(force / top * len(heat.COLORS)), 0, len(heat.COLORS)).astype(int)


def test_every_pin_wears_the_color_of_its_level_of_force(bed: Any, formed: Instant) -> None:
    view.color_by(bed, "force")
    assert drawn_pins(bed)[1] == [f"force_{level:02d}" for level in level_of(formed.force)]
    assert len(set(level_of(formed.force))) == 13
    view.write_setting(bed, TOP_FORCE, 2.0)
    assert drawn_pins(bed)[1] == [f"force_{level:02d}" for level in level_of(formed.force, 2.0)]
    view.color_by(bed, "mode")
    assert drawn_pins(bed)[1] == [Mode(int(code)).name.lower() for code in formed.mode]


def arrows(bed: Any) -> np.ndarray:
    """Return tip (3) and length of every arrow drawn, m."""
    found = [
        [*item.matrix_world.translation, item.matrix_world.to_scale().z]
        for item in instances(bed)
        if item.object.material_slots[0].material[ROLE] == "force_arrow"
    ]
    return np.array(found).reshape(-1, 4) / bridge.SCALE


def test_arrows_stand_on_the_pressed_pins_as_long_as_their_force(bed: Any, formed: Instant) -> None:
    (ball,) = fingertip_of(bed).children
    assert len(arrows(bed)) == 0
    copy = bed.copy()
    bpy.context.collection.objects.link(copy)
    view.show_arrows(bed, True)
    assert not view.read_setting(copy, ARROWS, True)
    assert ball.material_slots[0].material[ROLE] == "fingertip_clear"
    view.write_setting(bed, ARROW_LENGTH, 50.0)
    drawn, pressed = arrows(bed), formed.force > 0.0
    assert len(drawn) == pressed.sum() == 47
    wanted = np.column_stack([formed.position, formed.height, 0.050 * formed.force])[pressed]
    np.testing.assert_allclose(drawn, wanted, rtol=1e-6, atol=FLOAT32)
    assert len(drawn_pins(bed)[0]) == 48 + 47
    view.show_arrows(bed, False)
    assert len(drawn_pins(bed)[0]) == 48
    assert ball.material_slots[0].material[ROLE] == "fingertip"


def test_forces_of_a_session_are_written_only_while_something_drawn_tells_them(bed: Any) -> None:
    scene = resolve({"layout": {"rows": 6, "columns": 8}, "control": "absent"})
    system = assemble(scene)
    state = begin(system)
    state.rows[system.rows.force] = 0.5
    before, tip = bridge.read_cells(bed.data)["force"], fingertip_of(bed)
    tip.location.x += 1.0
    view.show_state(bed, system, state)
    tops, _ = drawn_pins(bed)  # pins move, and the fingertip is left to the user
    np.testing.assert_allclose(tops[:, 2], system.cell.actuator.rest_height, rtol=0, atol=FLOAT32)
    assert tip.location.x > 0.9
    np.testing.assert_array_equal(bridge.read_cells(bed.data)["force"], before)
    for switch_on in (lambda: view.show_arrows(bed, True), lambda: view.color_by(bed, "force")):
        view.show_arrows(bed, False)
        switch_on()
        state.rows[system.rows.force] += 0.1
        view.show_state(bed, system, state)
        forces = bridge.read_cells(bed.data)["force"]
        np.testing.assert_allclose(forces, state.row(system.rows.force), rtol=2.0**-23)
