"""An object in front of the pins takes the click, where a view shows it and shows it in front."""

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

#: How much larger the bed is than it is added: it then fills a good part of the factory file's
#: view.
LARGER = 8.0
#: Places of the bed, m, one under the object and one beside it.
COVERED, BARE = np.array([[0.0, 0.0, 0.04]]), np.array([[0.03, 0.03, 0.04]])


@pytest.fixture
def factory_view(extension):
    with in_the_view():
        yield bpy.context


@pytest.fixture
def context(extension):
    """The context of that view, with nothing but a bed."""
    new_bed().scale = (LARGER,) * 3
    with in_the_view():
        for name in ("Cube", "Light", "Camera"):
            bpy.data.objects.remove(bpy.data.objects[name])
        bpy.context.view_layer.update()
        yield bpy.context


def points_at(context, place):
    context.view_layer.update()
    (xy,) = bridge.project(context, beds()[0], place)
    return aim.find_target(context, (float(xy[0]), float(xy[1]))) is not None


def cover(context, distance=4.0):
    """Add a cube on the ray of the covered place, at a distance from it towards the eye, Blender units."""
    place = beds()[0].matrix_world @ Vector(COVERED[0] * SCALE)
    way = (_eye(context) - place).normalized()
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=place + distance * way)
    return bpy.context.object


def _eye(context):
    return context.region_data.view_matrix.inverted().translation


def look(context, bed):
    """Return how far the eye is from the covered place."""
    return (_eye(context) - bed.matrix_world @ Vector(COVERED[0] * SCALE)).length


def hang(thing, bed):
    thing.parent, thing.matrix_parent_inverse = bed, bed.matrix_world.inverted()


def isolate(bed, times):
    """Enter or leave a local view of the bed."""
    bpy.ops.object.select_all(action="DESELECT")
    for part in (bed, *bed.children_recursive):
        part.select_set(True)
    for _ in range(times):
        bpy.ops.view3d.localview(frame_selected=False)


def shade(context, kind, xray):
    context.space_data.shading.type = kind
    setattr(context.space_data.shading, xray, True)


def add_flat_things(context):
    """Add what has no surface or no size where a cube would hide the pins; return a curve among it."""
    where = cover(context).location.copy()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.object.empty_add(location=where)
    bpy.ops.curve.primitive_bezier_circle_add(radius=0.5, location=where)
    curve = bpy.context.object
    bpy.ops.object.light_add(location=where)
    bpy.ops.mesh.primitive_cube_add(location=where)
    bpy.context.object.scale = (0.0, 1.0, 1.0)
    context.scene.collection.objects.link(
        bpy.data.objects.new("Nothing", bpy.data.meshes.new("Nothing"))
    )
    return curve


def fill(curve):
    curve.dimensions, curve.fill_mode = "2D", "BOTH"


def instance(context):
    """Make a cube in front an instance of a collection that the scene does not have."""
    cube, apart = cover(context), bpy.data.collections.new("Apart")
    for held in list(cube.users_collection):
        held.objects.unlink(cube)
    apart.objects.link(cube)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", apart
    context.scene.collection.objects.link(empty)
    return empty


def in_front(thing):
    thing.show_in_front = True
    return thing


#: What is done, and whether the pixel of the covered place points at the bed then.
IN_FRONT = {
    "nothing": (lambda view, bed: None, True),
    "a cube": (lambda view, bed: cover(view), False),
    "a cube behind the pins": (lambda view, bed: cover(view, -4.0), True),
    "a cube as wires": (lambda view, bed: setattr(cover(view), "display_type", "WIRE"), True),
    "a cube as bounds": (lambda view, bed: setattr(cover(view), "display_type", "BOUNDS"), True),
    "a cube parented to the bed, no part of it": (lambda view, bed: hang(cover(view), bed), False),
    "a hidden cube": (lambda view, bed: cover(view).hide_set(True), True),
    "a disabled cube": (lambda view, bed: setattr(cover(view), "hide_viewport", True), True),
    "a cube where no curves are shown": (
        lambda view, bed: (cover(view), setattr(view.space_data, "show_object_viewport_curve", False)), False,
    ),
    "a cube outside the local view": (lambda view, bed: (cover(view), isolate(bed, 1)), True),
    "a cube after the local view": (lambda view, bed: (cover(view), isolate(bed, 2)), False),
    "a cube in X-ray": (lambda view, bed: (cover(view), shade(view, "SOLID", "show_xray")), True),
    "a cube of wires in X-ray": (
        lambda view, bed: (cover(view), shade(view, "WIREFRAME", "show_xray_wireframe")), True,
    ),
    "a cube of a material": (lambda view, bed: (cover(view), shade(view, "MATERIAL", "show_xray")), False),
    "a cube behind the eye": (lambda view, bed: cover(view, look(view, bed) + 2.0), True),
    # 2.5 mm about the eye; drawn from 10 mm on.
    "a cube nearer than is drawn": (
        lambda view, bed: setattr(cover(view, look(view, bed)), "scale", (0.01, 0.01, 0.01)), True,
    ),
    "a cube, the bed in front of all": (lambda view, bed: (cover(view), in_front(bed)), True),
    "both in front of all": (lambda view, bed: in_front(cover(view)) and in_front(bed), False),
    "a cube behind the pins in front of all": (lambda view, bed: in_front(cover(view, -4.0)), False),
    "what has no surface or size": (lambda view, bed: add_flat_things(view), True),
    "a filled curve": (
        lambda view, bed: fill(add_flat_things(view).data), False,
    ),
    "an instance of a collection": (lambda view, bed: instance(view), False),
    "a hidden instance": (lambda view, bed: instance(view).hide_set(True), True),
}  # fmt: skip


@pytest.mark.parametrize("case", IN_FRONT)
def test_what_a_view_shows_in_front_of_the_pins_takes_the_click(context, case):
    change, met = IN_FRONT[case]
    assert points_at(context, COVERED)
    change(context, beds()[0])
    assert points_at(context, COVERED) is met
    assert points_at(context, BARE)


def test_where_no_meshes_are_shown_neither_is_the_bed(context):
    context.space_data.show_object_viewport_mesh = False
    assert not points_at(context, BARE)


def test_the_bed_does_not_hide_itself_with_its_fingertip(context):
    tip = fingertip_of(beds()[0])
    tip.location = Vector(COVERED[0] * SCALE) + Vector((0.0, 0.0, 0.02))
    assert points_at(context, COVERED)
    for part in tip.children:
        del part[ROLE]  # what a user has hung on it is no part
    assert not points_at(context, COVERED)


def test_a_clipping_region_takes_away_what_is_outside_it(context):
    looking = context.region_data
    cover(context)
    (xy,) = bridge.project(context, beds()[0], BARE)
    x, y = int(xy[0]), int(xy[1])
    bpy.ops.view3d.clip_border(
        xmin=x - 20, xmax=x + 20, ymin=y - 20, ymax=y + 20, wait_for_input=False
    )
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


ON_TOP, BESIDE, CURSOR = "on top of it", "beside it", ""
#: The factory file's cube, changed, or what is added in place of it; where and how high a bed
#: stands then.
PLACES = {
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
    "another bed": (
        {"add": bpy.ops.mesh.digital_clay_add, "location": (0.1, 0.1, 0.0)},
        BESIDE,
        0.0,
    ),
}


@pytest.mark.parametrize("case", PLACES)
def test_a_new_bed_stands_at_the_cursor_unless_what_is_there_hides_it(factory_view, case):
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


def test_a_bed_with_a_location_is_put_there_and_a_sample_where_it_is_seen(factory_view):
    bpy.ops.mesh.digital_clay_add(location=(0.0, 0.2, 0.1))
    new = bpy.context.object
    assert [*new.location.xy, new.location.z + view.underside(new)] == pytest.approx(
        [0.0, 0.2, 0.1]
    )
    bpy.data.objects.remove(new)
    bpy.ops.digiclay.add_sample(sample="session:tap", take=False)
    assert bpy.context.object.location.z > 1.0
