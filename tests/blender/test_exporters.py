"""Other programs get the form: Blender's own exporters, Convert and Make Instances Real have pins or skin."""

from itertools import cycle

import bpy
import numpy as np
import pytest
import trimesh
from digiclay import bridge

pytestmark = pytest.mark.usefixtures("extension")

ROWS, COLUMNS = 2, 3
#: Points of a pin's mesh.
ROD = 253
#: Coordinates are float32 at 100 mm from the origin, through two matrices: some 1e-8 m each.
NEAR = 2e-7


def formed(unit, form):
    """Add a small bed, turned and moved, every pin at a height of its own, to an empty scene."""
    empty(unit)
    bpy.ops.mesh.digital_clay_add(rows=ROWS, columns=COLUMNS)
    bed = bpy.context.object
    bed.location, bed.rotation_euler = (0.03 / unit, -0.02 / unit, 0.01 / unit), (0.3, -0.2, 1.1)
    cells = bridge.read_cells(bed.data)
    height = 0.04 + 0.001 * np.arange(ROWS * COLUMNS) ** 0.7
    bridge.write_cells(bed.data, cells["position"], height)
    bed.digiclay_display.form = form
    bed.digiclay_display.skin = "membrane"  # which goes through every pin; the smooth one rounds
    bpy.context.view_layer.update()
    return bed


def empty(unit):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.unit_settings.scale_length = unit


def points_of_scene():
    """Return the points of all meshes that are drawn, in the world, Blender units."""
    clouds = []
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        if item.object.type == "MESH":
            cloud = np.empty((len(item.object.data.vertices), 3), np.float32)
            item.object.data.vertices.foreach_get("co", cloud.ravel())
            placed = np.array(item.matrix_world)
            clouds.append(cloud @ placed[:3, :3].T + placed[:3, 3])
    return np.concatenate(clouds)


def read_gltf(file):
    x, y, z = trimesh.load_scene(file).to_geometry().vertices.T
    return np.column_stack([x, -z, y])


def by_gltf(path):
    # Blender 4.2 cannot export instances of a selection.
    for part in bpy.context.object.children_recursive:
        bpy.data.objects.remove(part)
    bpy.ops.export_scene.gltf(filepath=path + ".glb", export_apply=True, export_gn_mesh=True)
    return read_gltf(path + ".glb")


def by_plain_gltf(path):
    bpy.context.object.digiclay_display.realize = True
    bpy.ops.export_scene.gltf(filepath=path + ".glb", use_selection=True, export_apply=True)
    return read_gltf(path + ".glb")


def by_usd(path):
    unit = bpy.context.scene.unit_settings.scale_length
    bpy.ops.wm.usd_export(filepath=path + ".usdc", selected_objects_only=True)
    empty(unit)
    bpy.ops.wm.usd_import(filepath=path + ".usdc")
    return points_of_scene()


def by_alembic(path):
    bpy.ops.wm.alembic_export(filepath=path + ".abc", selected=True)
    empty(1.0)
    bpy.ops.wm.alembic_import(filepath=path + ".abc", as_background_job=False)
    return points_of_scene()


def by_obj(path):
    bpy.ops.wm.obj_export(filepath=path + ".obj", export_selected_objects=True)
    empty(1.0)
    bpy.ops.wm.obj_import(filepath=path + ".obj")
    return points_of_scene()


def alone(things):
    """Remove all objects but some."""
    for thing in set(bpy.data.objects) - set(things):
        bpy.data.objects.remove(thing)
    bpy.context.view_layer.update()
    return points_of_scene()


def by_convert(path):
    bed = bpy.context.object
    bed.digiclay_display.realize = True
    bpy.ops.object.convert(target="MESH")
    # What the skin was made with stays in Blender.
    assert {"low", "high", "pin"}.isdisjoint(bed.data.attributes.keys())
    assert "no longer that of its pins" in bridge.find_fault(bed.data)
    return alone([bed])


def by_make_real(path):
    bed = bpy.context.object
    bpy.ops.object.duplicates_make_real()
    return alone(set(bpy.context.selected_objects) - {bed})


FORMS = [("pins", 1), ("skin", 1), ("both", 2)]
WAYS = [by_gltf, by_usd, by_alembic, by_obj, by_convert]


@pytest.mark.parametrize(
    "way, unit, form, tops",
    [
        *((way, 0.001, "both", 2) for way in WAYS),
        *((way, 1.0, form, tops) for way, (form, tops) in zip(WAYS, cycle(FORMS), strict=False)),
        (by_plain_gltf, 0.001, "pins", 1),
        (by_make_real, 0.001, "pins", 1),
        (by_make_real, 0.001, "both", 1),
        (by_make_real, 1.0, "pins", 1),
    ],
)
def test_every_pin_or_the_skin_over_it_arrives_at_its_height(tmp_path, way, unit, form, tops):
    bed = formed(unit, form)
    placed = np.array(bed.matrix_world)
    pins = np.array([vertex.co for vertex in bed.data.vertices]) / bridge.SCALE
    points = way(str(tmp_path / "bed"))
    points = (points - placed[:3, 3]) @ np.linalg.inv(placed[:3, :3]).T / bridge.SCALE
    met = [int((np.abs(points - pin).max(axis=1) < NEAR).sum()) for pin in pins]
    assert met == [tops] * len(pins)
    assert points[:, 2].max() == pytest.approx(pins[:, 2].max(), abs=NEAR)
    assert (len(points) >= ROD * len(pins)) == (form != "skin")
