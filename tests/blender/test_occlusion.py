"""An object in front of the pins takes the click, where a view shows it and shows it in front."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.bridge import SCALE
from digiclay.device import view
from digiclay.press import aim
from digiclay.roles import ROLE, fingertip_of
from digiclay.sessions import running
from mathutils import Vector

from tests.blender.at_hand import beds, in_the_view, new_bed

#: How much larger the bed is than it is added: it then fills a good part of the factory file's view.
LARGER = 8.0
#: Places of the bed, m, one under the object and one beside it.
COVERED, BARE = np.array([[0.0, 0.0, 0.04]]), np.array([[0.03, 0.03, 0.04]])


@pytest.fixture
def factory_view(extension: None) -> Iterator[Any]:
    """The context of the factory file's view, in perspective and Solid mode."""
    with in_the_view():
        yield bpy.context


@pytest.fixture
def context(extension: None) -> Iterator[Any]:
    """The context of that view, with nothing but a bed."""
    new_bed().scale = (LARGER,) * 3
    with in_the_view():
        for name in ("Cube", "Light", "Camera"):
            bpy.data.objects.remove(bpy.data.objects[name])
        bpy.context.view_layer.update()
        yield bpy.context


def points_at(context: Any, place: np.ndarray) -> bool:
    """Return whether the pixel of a place of the bed points at the bed."""
    context.view_layer.update()
    (xy,) = bridge.project(context, beds()[0], place)
    return aim.find_target(context, (float(xy[0]), float(xy[1]))) is not None


def cover(context: Any, distance: float = 4.0) -> Any:
    """Add a cube on the ray of the covered place, at a distance from it towards the eye, Blender units."""
    place = beds()[0].matrix_world @ Vector(COVERED[0] * SCALE)
    way = (_eye(context) - place).normalized()
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=place + distance * way)
    return bpy.context.object


def _eye(context: Any) -> Vector:
    """Return where the view's eye is."""
    return context.region_data.view_matrix.inverted().translation


def test_an_object_in_front_hides_the_pins_behind_it_and_no_others(context: Any) -> None:
    assert points_at(context, COVERED)
    cover(context, distance=-4.0)  # behind the pins
    assert points_at(context, COVERED)
    cube = cover(context)
    assert not points_at(context, COVERED)
    assert points_at(context, BARE)
    for kind in ("WIRE", "BOUNDS"):
        cube.display_type = kind
        assert points_at(context, COVERED)
    # What a user has parented to the bed is no part of it.
    cube.display_type = "SOLID"
    cube.parent, cube.matrix_parent_inverse = beds()[0], beds()[0].matrix_world.inverted()
    assert not points_at(context, COVERED)


def test_the_bed_does_not_hide_itself_with_its_fingertip(context: Any) -> None:
    tip = fingertip_of(beds()[0])
    tip.location = Vector(COVERED[0] * SCALE) + Vector((0.0, 0.0, 0.02))
    assert points_at(context, COVERED)
    for part in tip.children:
        del part[ROLE]  # what a user has hung on it is no part
    assert not points_at(context, COVERED)


def test_what_the_view_does_not_show_hides_nothing(context: Any) -> None:
    cube = cover(context)
    cube.hide_set(True)
    assert points_at(context, COVERED)
    cube.hide_set(False)
    cube.hide_viewport = True
    assert points_at(context, COVERED)
    cube.hide_viewport = False
    context.space_data.show_object_viewport_curve = False
    assert not points_at(context, COVERED)
    context.space_data.show_object_viewport_mesh = False
    assert not points_at(context, BARE), "the bed is a mesh too"


def test_outside_a_local_view_with_the_bed_an_object_hides_nothing(context: Any) -> None:
    cover(context)
    bpy.ops.object.select_all(action="DESELECT")
    for part in (beds()[0], *beds()[0].children_recursive):
        part.select_set(True)
    bpy.ops.view3d.localview(frame_selected=False)
    assert points_at(context, COVERED)
    bpy.ops.view3d.localview(frame_selected=False)
    assert not points_at(context, COVERED)


@pytest.mark.parametrize(
    ("kind", "xray", "through"),
    [
        ("SOLID", "show_xray", True),
        ("WIREFRAME", "show_xray_wireframe", True),
        ("MATERIAL", "show_xray", False),
    ],
)
def test_xray_shows_the_pins_through_an_object(context: Any, kind: str, xray: str, through: bool) -> None:
    cover(context)
    shading = context.space_data.shading
    shading.type = kind
    setattr(shading, xray, False)
    assert not points_at(context, COVERED)
    setattr(shading, xray, True)
    assert points_at(context, COVERED) is through


def test_behind_the_eye_and_nearer_than_the_view_is_drawn_an_object_hides_nothing(context: Any) -> None:
    far = (_eye(context) - beds()[0].matrix_world @ Vector(COVERED[0] * SCALE)).length
    cube = cover(context, distance=far + 2.0)
    assert points_at(context, COVERED)
    bpy.data.objects.remove(cube)
    cover(context, distance=far).scale = (0.01, 0.01, 0.01)  # 2.5 mm about the eye; drawn from 10 mm on
    assert points_at(context, COVERED)


def test_in_front_of_all_others_a_bed_is_seen_and_so_is_an_object(context: Any) -> None:
    cube = cover(context)
    beds()[0].show_in_front = True
    assert points_at(context, COVERED)
    cube.show_in_front = True
    assert not points_at(context, COVERED)
    bpy.data.objects.remove(cube)
    beds()[0].show_in_front = False
    cover(context, distance=-4.0).show_in_front = True
    assert not points_at(context, COVERED)


def test_a_clipping_region_takes_away_what_is_outside_it(context: Any) -> None:
    looking = context.region_data
    cover(context)
    (xy,) = bridge.project(context, beds()[0], BARE)
    x, y = int(xy[0]), int(xy[1])
    bpy.ops.view3d.clip_border(xmin=x - 20, xmax=x + 20, ymin=y - 20, ymax=y + 20, wait_for_input=False)
    assert looking.use_clip_planes
    assert points_at(context, BARE)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    assert not points_at(context, COVERED), "pins that are clipped away are not seen"
    looking.use_clip_planes = False
    assert points_at(context, COVERED)
    # Cut off between the object and the bed, the object is gone and the pins are there.
    cover(context)
    place = beds()[0].matrix_world @ Vector(COVERED[0] * SCALE)
    normal = (place - _eye(context)).normalized()
    beyond = place - 1.0 * normal
    looking.clip_planes = [(*normal, -normal.dot(beyond)), *[(0.0, 0.0, 0.0, 0.0)] * 5]
    looking.use_clip_planes = True
    assert points_at(context, COVERED)


def test_the_instances_of_a_collection_hide_and_its_hidden_original_does_not(context: Any) -> None:
    cube = cover(context)
    apart = bpy.data.collections.new("Apart")
    apart.objects.link(cube)
    for held in list(cube.users_collection):
        if held != apart:
            held.objects.unlink(cube)
    assert points_at(context, COVERED)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", apart
    context.scene.collection.objects.link(empty)
    assert not points_at(context, COVERED)
    empty.hide_set(True)
    assert points_at(context, COVERED)


def test_objects_without_a_surface_or_a_size_hide_nothing(context: Any) -> None:
    where = cover(context).location.copy()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.object.empty_add(location=where)
    bpy.ops.curve.primitive_bezier_circle_add(radius=0.5, location=where)
    curve = bpy.context.object
    bpy.ops.object.light_add(location=where)
    bpy.ops.mesh.primitive_cube_add(location=where, scale=(0.0, 0.0, 0.0))
    bpy.context.object.scale = (0.0, 1.0, 1.0)
    bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    context.scene.collection.objects.link(bpy.data.objects["Nothing"])
    assert points_at(context, COVERED)
    curve.data.dimensions, curve.data.fill_mode = "2D", "BOTH"
    assert not points_at(context, COVERED)


ON_TOP, BESIDE, CURSOR = "on top of it", "beside it", ""
#: The factory file's cube, changed, or what is added in place of it; where and how high a bed stands then.
PLACES: dict[str, tuple[dict[str, Any], str, float]] = {
    "the cube swallows it": ({}, ON_TOP, 1.0),
    "the cube is mirrored and scaled": ({"scale": (-1.0, 1.5, 1.2)}, ON_TOP, 1.2),
    "the cube is turned on its edge": ({"rotation_euler": (np.pi / 4, 0.0, 0.3)}, ON_TOP, 2.0**0.5),
    "the eye is inside the cube": ({"scale": (30.0, 30.0, 30.0)}, CURSOR, 0.0),
    "the cube is away from the cursor": ({"location": (3.0, 0.0, 0.0)}, CURSOR, 0.0),
    "the cube is hidden": ({"hide_viewport": True}, CURSOR, 0.0),
    "the cube is as small as a pin": ({"scale": (0.05, 0.05, 2.0)}, CURSOR, 0.0),
    "the cube is the ground": ({"scale": (9.0, 9.0, 0.02)}, CURSOR, 0.0),
    "the cube is a column": ({"scale": (0.4, 0.4, 9.0)}, BESIDE, 0.0),
    "a monkey": ({"add": bpy.ops.mesh.primitive_monkey_add, "size": 3.0}, ON_TOP, 1.477),
    "a text that lies flat": ({"add": bpy.ops.object.text_add, "radius": 3.0}, CURSOR, 0.0),
    "another bed": ({"add": bpy.ops.mesh.digital_clay_add, "location": (0.1, 0.1, 0.0)}, BESIDE, 0.0),
}


@pytest.mark.parametrize("case", PLACES)
def test_a_new_bed_stands_at_the_cursor_unless_what_is_there_hides_it(factory_view: Any, case: str) -> None:
    values, where, height = PLACES[case]
    cube, add = bpy.data.objects["Cube"], values.get("add")
    if add is not None:
        bpy.data.objects.remove(cube)
        add(**{name: value for name, value in values.items() if name != "add"})
    for name, value in values.items() if add is None else ():
        setattr(cube, name, value)
    bpy.context.view_layer.update()
    bpy.ops.mesh.digital_clay_add()
    new = bpy.context.object
    words = running.last_message(new)
    assert words.endswith(where) if where else not words, words
    assert new.location.z + view.underside(new) == pytest.approx(height, abs=1e-3)
    assert (new.location.xy.length > 0.4) is (where == BESIDE)
    # No outline about every pin; panels and keys go by the active object.
    assert bpy.context.selected_objects == []


def test_a_bed_with_a_location_is_put_there_and_a_sample_where_it_is_seen(factory_view: Any) -> None:
    bpy.ops.mesh.digital_clay_add(location=(0.0, 0.2, 0.1))
    new = bpy.context.object
    assert [*new.location.xy, new.location.z + view.underside(new)] == pytest.approx([0.0, 0.2, 0.1])
    bpy.data.objects.remove(new)
    bpy.ops.digiclay.add_sample(sample="session:tap", take=False)
    assert bpy.context.object.location.z > 1.0
