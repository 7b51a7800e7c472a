"""The bed Blender evaluates is the one handed in; what is shown of it, and the view it is added to."""

from dataclasses import replace

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
from digiclay.core.session.accuracy import Errors
from digiclay.device import heat, palettes, view
from digiclay.device.node_tree import ARROW_LENGTH, ARROWS, TOP_FORCE
from digiclay.live import beds
from digiclay.operators.pin_view import pick_pins
from digiclay.overlay import views
from digiclay.overlay.ready_view import FACTORY, RELIEF, SPACE, find_eye, place_eye
from digiclay.overlay.sections import find_covered
from digiclay.panels import display
from digiclay.panels.session import error_line
from digiclay.preferences import CORNERS
from digiclay.roles import ROLE, fingertip_of
from digiclay.sessions import running, sculpting
from digiclay.settings import properties

from tests.assemble import assert_near
from tests.blender.at_hand import evaluate, instances, new_bed, open_bed, read_overlay

#: Attributes are float32: 24 bits of at most 0.1 m, drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


def drawn_pins(bed):
    """Return what Blender draws for a bed: pin tops (n, 3), m, and each one's material."""
    tops, materials = [], []
    for item in instances(bed):
        tops.append(np.array(item.matrix_world.translation) / bridge.SCALE)
        materials.append(item.object.material_slots[0].material[ROLE])
    return np.array(tops), materials


@pytest.fixture
def bed(formed):
    return open_bed("formed", lambda: view.build(formed, bpy.context.scene.collection))


def test_the_pins_stand_where_the_arrays_say_in_the_material_of_their_mode(bed, formed):
    later = replace(
        formed, height=formed.height[::-1], mode=formed.mode[::-1], force=formed.force[::-1]
    )
    for instant in (formed, later):
        view.show(bed, instant)
        tops, materials = drawn_pins(bed)
        wanted = np.column_stack([instant.position, instant.height])
        assert_near(tops, wanted, FLOAT32)
        # An instant's forces are there though nothing drawn tells them.
        assert not view.wants_force(bed)
        assert np.array_equal(
            bridge.read_cells(bed.data)["force"], instant.force.astype(np.float32)
        )
        assert materials == [Mode(int(code)).name.lower() for code in instant.mode]


def test_the_modes_have_as_many_materials_each_in_its_color_which_a_second_bed_shares(bed, formed):
    for mode in Mode:
        (material,) = (m for m in bpy.data.materials if m.get(ROLE) == mode.name.lower())
        wanted = bridge.linear(COLORS[mode])
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        # Both are stored as float32 numbers up to 1.
        assert_near(material.diffuse_color, wanted, 1e-6)
        assert_near(shader.inputs["Base Color"].default_value, wanted, 1e-6)
    materials = len(bpy.data.materials)
    other = view.build(formed, bpy.context.scene.collection)
    assert len(bpy.data.materials) == materials
    assert other.data != bed.data
    assert other.modifiers[0].node_group != bed.modifiers[0].node_group


def test_a_tilted_fingertip_touches_down_at_its_lowest_point(bed, formed):
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    fingertip = fingertip_of(bed)
    bridge.place_fingertips(bed, at[None], formed.finger)
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


def test_every_rod_reaches_down_to_the_deck_of_the_housing(bed, formed):
    feet = [
        min((item.matrix_world @ vertex.co).z for vertex in item.object.data.vertices)
        for item in instances(bed)
    ]
    assert len(feet) == 48
    # The housing is drawn from its underside to the deck inside.
    deck = evaluate(bed).vertices[-1].co.z
    # float32 on lengths below one unit.
    assert_near(feet, deck, 1e-6)
    assert deck / bridge.SCALE < formed.height.min()


def test_the_pose_of_a_fingertip_is_read_back_however_things_are_scaled(bed, formed):
    fingertip = fingertip_of(bed)
    turn = np.array([0.8, 0.3, -0.4, 0.33])
    at = np.array([0.004, -0.002, 0.055, *(turn / np.linalg.norm(turn))])
    bed.location, bed.rotation_euler, bed.scale = (
        (3.0, -2.0, 1.0),
        (0.2, -0.4, 0.9),
        (2.5, 2.5, 2.5),
    )
    (rest,) = formed.fingertip
    for pose, finger in ((rest, Fingertip()), (at, Fingertip(length=0.012))):
        bridge.place_fingertips(bed, pose[None], [finger])
        bpy.context.view_layer.update()
        # Blender's matrices are float32, and this one is inverted three units from the origin.
        assert_near(bridge.pose(fingertip), pose, 2e-6)
    assert bridge.uniform(bed) == pytest.approx(2.5, rel=1e-6)
    bridge.place_fingertips(bed, formed.fingertip, formed.finger)
    fingertip.scale = (3.0, 1.0, 0.5)  # by hand: what touches stays
    bpy.context.view_layer.update()
    assert_near(bridge.pose(fingertip), rest, 2e-6)


@pytest.mark.parametrize(
    "scale, said",
    [
        ((1.0, 1.0, 1.1), r"the same along x, y and z \(got 1 x 1 x 1\.1\)"),
        ((0.0, 0.0, 0.0), r"above 0 along x, y and z \(got 0 x 0 x 0\)"),
        ((-1.0, -1.0, -1.0), "must not mirror it"),
    ],
)
def test_a_bed_not_scaled_uniformly_is_refused(bed, scale, said):
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


def level_of(force, top=heat.TOP):
    """Return the level of each force: 0 without force, 1 to 12 for the colors."""
    return np.clip(np.ceil(force / top * len(heat.COLORS)), 0, len(heat.COLORS)).astype(int)


def test_every_pin_wears_the_color_of_its_level_of_force(bed, formed):
    view.color_by(bed, "force")
    assert drawn_pins(bed)[1] == [f"force_{level:02d}" for level in level_of(formed.force)]
    assert len(set(level_of(formed.force))) == 13
    view.write_setting(bed, TOP_FORCE, 2.0)
    assert drawn_pins(bed)[1] == [f"force_{level:02d}" for level in level_of(formed.force, 2.0)]
    view.color_by(bed, "neutral")
    assert (set(drawn_pins(bed)[1]), view.shows_force(bed)) == ({"rest"}, False)
    view.color_by(bed, "mode")
    assert drawn_pins(bed)[1] == [Mode(int(code)).name.lower() for code in formed.mode]
    bed.modifiers.clear()
    assert not view.wants_force(bed)
    with pytest.raises(DigiclayError, match="Digital Clay must have the geometry nodes modifier"):
        view.color_by(bed, "force")


def arrows(bed):
    """Return tip (3) and length of every arrow drawn, m."""
    found = [
        [*item.matrix_world.translation, item.matrix_world.to_scale().z]
        for item in instances(bed)
        if item.object.material_slots[0].material[ROLE] == "force_arrow"
    ]
    return np.array(found).reshape(-1, 4) / bridge.SCALE


def test_arrows_stand_on_the_pressed_pins_as_long_as_their_force(bed, formed):
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


def test_forces_of_a_session_are_written_only_while_something_drawn_tells_them(bed):
    scene = resolve({"layout": {"rows": 6, "columns": 8}, "control": "absent"})
    system = assemble(scene)
    state = begin(system)
    state.rows[system.rows.force] = 0.5
    before, tip = bridge.read_cells(bed.data)["force"], fingertip_of(bed)
    tip.location.x += 1.0
    view.show_state(bed, system, state)
    tops, _ = drawn_pins(bed)  # pins move, and the fingertip is left to the user
    assert_near(tops[:, 2], system.cell.actuator.rest_height, FLOAT32)
    assert tip.location.x > 0.9
    np.testing.assert_array_equal(bridge.read_cells(bed.data)["force"], before)
    for switch_on in (lambda: view.show_arrows(bed, True), lambda: view.color_by(bed, "force")):
        view.show_arrows(bed, False)
        switch_on()
        state.rows[system.rows.force] += 0.1
        view.show_state(bed, system, state)
        forces = bridge.read_cells(bed.data)["force"]
        np.testing.assert_allclose(forces, state.row(system.rows.force), rtol=2.0**-23)


@pytest.fixture
def clay(extension):
    """A bed of 20 x 20 pins as the Add menu makes it."""
    made = new_bed(rows=20, columns=20)
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def session(clay):
    """A running session whose finger has pressed the middle of the bed for a third of a second."""
    scene = properties.scene_of(clay)
    above = bridge.pose(fingertip_of(clay))
    begun, _ = sculpting.begin_session(clay.session_uid, clay.name, scene, above)
    pressed = above.copy()
    pressed[2] = 0.037
    begun = sculpting.advance(begun, above, 0.0, 100)
    for tick in range(1, 11):
        begun = sculpting.advance(begun, pressed, tick / 30, 100, pins=view.picked_pins(clay))
    # The trace keeps every other period: it ends with this state.
    while begun.state.period % begun.trace.every:
        begun = sculpting.advance(sculpting.request_step(begun), pressed, 1.0, 100)
    begun = replace(begun, paused=False)
    running.put(begun)
    yield begun
    running.drop(begun.uid)
    views.follow()


def forces(clay):
    return bridge.read_cells(clay.data)["force"]


def test_the_properties_are_the_settings_of_the_geometry_nodes(clay):
    shown = clay.digiclay_display
    shown.color, shown.arrows, shown.top_force, shown.arrow_length = "force", True, 0.5, 250.0
    assert (view.shows_force(clay), view.read_setting(clay, ARROWS, False)) == (True, True)
    assert view.read_setting(clay, TOP_FORCE, 0.0) == 0.5
    assert view.read_setting(clay, ARROW_LENGTH, 0.0) == 250.0
    view.color_by(clay, "mode")
    assert shown.color == "mode"
    shown.color = "neutral"
    assert (view.read_coloring(clay), shown.color) == ("neutral", "neutral")
    shown.color = "mode"
    assert (view.read_coloring(clay), shown.color) == ("mode", "mode")
    # A bed without its nodes has nothing to set and says nothing.
    clay.modifiers.clear()
    shown.color, shown.arrows, shown.top_force, shown.arrow_length = "force", True, 0.5, 250.0
    assert (shown.color, shown.arrows) == ("mode", False)


@pytest.mark.parametrize("ended", [False, True])
def test_heat_map_or_arrows_turned_on_show_the_forces_of_now_or_those_the_session_ended_with(
    clay, session, ended
):
    view.show_state(clay, session.system, session.state)
    assert not forces(clay).any()
    if ended:
        beds.write(clay, session)
        running.drop(session.uid)
        clay.digiclay_display.arrows = True
    else:
        clay.digiclay_display.color = "force"
    felt = session.state.row(session.system.rows.force)
    assert felt.max() > 0.01
    np.testing.assert_allclose(forces(clay), felt, rtol=2.0**-23)


def test_the_overlay_and_its_timer_are_there_only_while_wanted_and_go_with_the_extension(
    clay, session
):
    def is_there():
        assert bpy.app.timers.is_registered(views._again) is views.shown()
        return views.shown()

    assert not is_there()
    views.follow()
    assert is_there()
    for wanted in (False, True):
        clay.digiclay_display.overlay = wanted
        assert is_there() is wanted
    display.unregister()
    try:
        assert not views.shown()
    finally:
        display.register()
    views.follow()
    assert is_there()
    running.drop(session.uid)
    views.follow()
    assert not is_there()


def test_the_overlay_tells_what_the_session_is(clay, session):
    told = views.read_session(clay, session, palettes.PALETTES["okabe_ito"])
    assert (told.name, told.method, told.set_point) == (clay.name, "virtual_master", 0.4)
    assert told.modes.sum() == 400
    assert np.count_nonzero(told.modes) > 1
    total = session.state.row(session.system.rows.force).sum()
    assert told.force[-1] == pytest.approx(total, rel=1e-12)
    stopped = views.read_session(
        clay, replace(session, paused=True), palettes.PALETTES["okabe_ito"]
    )
    assert stopped.paused
    assert told.colors[Mode.HOLD] == palettes.PALETTES["okabe_ito"][Mode.HOLD]


@pytest.mark.parametrize("errors", [None, Errors(2.1e-6, 4.6e-4, 9e-4), Errors(9e-12, 0.0, 0.0)])
def test_panel_and_overlay_name_the_same_error(clay, session, errors):
    known = replace(session, errors=errors)
    told = views.read_session(clay, known, palettes.PALETTES["okabe_ito"])
    assert error_line(known) in read_overlay(told)


def test_picked_pins_are_kept_with_the_bed_in_the_order_they_were_picked(clay):
    pick_pins(clay, (7, 399, 0))
    assert view.picked_pins(clay) == (7, 399, 0)
    assert view.picked_pins(clay.copy()) == (7, 399, 0)
    assert bpy.ops.digiclay.clear_pins() == {"FINISHED"}
    assert view.picked_pins(clay) == ()
    assert not bpy.ops.digiclay.clear_pins.poll()


@pytest.mark.parametrize(
    "pins, said",
    [
        ((1, 1), "6 different pins"),
        (range(7), "6 different pins"),
        ((400,), "0 to 399"),
        ((-1,), "0 to 399"),
    ],
)
def test_pins_that_cannot_be_picked_are_refused(clay, pins, said):
    assert view.picked_pins(clay) == ()
    with pytest.raises(DigiclayError, match=said):
        pick_pins(clay, pins)
    assert view.picked_pins(clay) == ()


LENS = np.array([1.4, 2.1])


def project(points, eye, parallel):
    """Return where an eye sees points (k, 3), (k, 2), -1 to 1."""
    return LENS * (points[:, :2] - eye[:2]) / (eye[2] if parallel else eye[2] - points[:, 2:])


@pytest.mark.parametrize("parallel", [False, True])
def test_the_nearest_eye_sees_all_points_in_the_room_and_they_touch_two_sides(parallel):
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (40, 3)) * [0.8, 0.7, 0.2]
    room = np.array([[-0.9, -1.0], [0.3, 0.6]])
    seen = project(points, place_eye(points, LENS, room, parallel), parallel)
    low, high = room + SPACE * (room[1] - room[0]) * [[1.0], [-1.0]]
    assert (low - 1e-9 <= seen).all()
    assert (seen <= high + 1e-9).all()
    assert (np.isclose(seen.min(axis=0), low) & np.isclose(seen.max(axis=0), high)).any()


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("corner", CORNERS)
def test_nothing_of_a_bed_is_seen_behind_the_overlay(corner, parallel):
    size, room = np.array([1050.0, 700.0]), (50.0, 0.0, 780.0, 650.0)
    box = find_covered(room, 2.0, corner)
    assert (box[0] == 50.0, box[2] == 780.0) == (corner.endswith("left"), corner.endswith("right"))
    assert (box[1] == 0.0, box[3] == 650.0) == (
        corner.startswith("bottom"),
        corner.startswith("top"),
    )
    free, taken = (2.0 * np.reshape(part, (2, 2)) / size - 1.0 for part in (room, box))
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (2000, 3)) * [0.8, 0.7, 0.2]
    corners = np.stack(np.meshgrid([-0.8, 0.8], [-0.7, 0.7], [-0.2, 0.2]), axis=-1).reshape(-1, 3)
    eye = find_eye(corners, LENS, free, taken, parallel)
    seen = project(points, eye, parallel)
    assert ((free[0] < seen) & (seen < free[1])).all()
    assert not ((taken[0] < seen) & (seen < taken[1])).all(axis=1).any()
    # As near as without an overlay where it leaves room enough.
    small = find_covered(room, 0.3, corner)
    near = find_eye(corners, LENS, free, 2.0 * np.reshape(small, (2, 2)) / size - 1.0, parallel)
    assert near[2] < eye[2]
    # A view without room is left as it is.
    nothing = np.array([[0.2, -0.5], [0.1, 0.5]])
    assert find_eye(np.eye(3), LENS, nothing, nothing, parallel) is None


def test_the_file_blender_starts_with_is_what_is_lit_and_can_be():
    views = [area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D"]
    shading = views[0].spaces.active.shading
    assert {name: getattr(shading, name) for name in FACTORY} == FACTORY
    for name, value in RELIEF.items():
        setattr(shading, name, value)
    assert {name: getattr(shading, name) for name in RELIEF} == RELIEF
    sculpting = next(area for area in bpy.data.screens["Sculpting"].areas if area.type == "VIEW_3D")
    assert sculpting.spaces.active.shading.light == RELIEF["light"]
