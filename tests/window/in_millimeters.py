"""Adds a bed to a scene in millimeters and draws on it by hand; adds a large and a small one."""

import bpy

from tests.window import driver as blender
from tests.window.hand_strokes import brush, catch_up, focus_window, stroke, take_tool

#: Beds that the factory file's view would cut off: what they are made with.
LARGE, SMALL = {"bed": "paper", "pitch": 100.0}, {"bed": "paper", "scale": 0.003}
#: Places of pins, pitches from the middle.
PLACES = (3.0, 3.0), (11.0, 11.0), (-11.0, -11.0)


def script():
    units = bpy.context.scene.unit_settings
    units.scale_length, units.length_unit = 1e-3, "MILLIMETERS"
    yield from add(bed="paper")
    area, _ = blender.view()
    bed, graph = blender.bed(), bpy.context.evaluated_depsgraph_get()
    blender.SEEN["size"] = list(bed.evaluated_get(graph).dimensions)
    blender.SEEN["millimeter"] = bpy.context.window_manager.operators[-1].properties.millimeter
    area.spaces.active.show_region_hud = True
    blender.shot("millimeters_added")
    catch_up()
    take_tool()
    yield from focus_window()
    brush().brush, brush().height = "RAISE", 6.0
    yield from stroke("raised", (-27.0, 0.0), (27.0, 0.0), picture="millimeters_drawn")
    blender.shot("millimeters_raised")
    for name, chosen in (("large", LARGE), ("small", SMALL)):
        yield from add(**chosen)
        blender.shot(f"millimeters_{name}")
        blender.SEEN[name] = [find_pin(*place) for place in PLACES]


def find_pin(column, row):
    """Return the place of the pin that is seen at a place, pitches from the middle; None without."""
    pitch = blender.bed().digiclay.layout.pitch
    x, y = blender.on_the_bed(pitch * column, pitch * row)
    _, region = blender.view()
    with blender.in_the_view():
        target = blender.part("press.aim").find_target(bpy.context, (x - region.x, y - region.y))
    return target and [target.pin % 25 - 12, target.pin // 25 - 12]


def add(**chosen):
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.call(bpy.ops.object.delete)
    blender.call(bpy.ops.mesh.digital_clay_add, "INVOKE_DEFAULT", True, **chosen)
    yield 1.0
