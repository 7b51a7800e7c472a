"""Forms along a text and an imported SVG, then stamps the text, on a bed in a real window."""

from pathlib import Path

import addon_utils
import bpy
import numpy as np

from tests.window.hand_strokes import (
    act,
    add_bed,
    brush,
    done,
    focus_window,
    hand,
    note,
    on_the_screen,
    take_tool,
    to,
)

#: A ring, and a roof in it that is open below, in mm.
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="80mm" height="80mm" viewBox="0 0 80 80">
<circle cx="40" cy="40" r="30" fill="none" stroke="black"/>
<path d="M28 30 L40 18 L52 30" fill="none" stroke="black"/></svg>"""


def script(blender):
    add_bed(blender, bed="design")
    take_tool(blender)
    yield from focus_window()
    settings = brush(blender)
    settings.brush, settings.height = "RAISE", 8.0
    add_curves(blender)
    yield from blender.rounds()
    yield from look_at_menus(blender)
    blender.call(bpy.ops.digiclay.press_curves, "EXEC_DEFAULT", True)
    yield from blender.rounds()
    blender.SEEN["queued"] = blender.session().begun_strokes
    blender.shot("curves_queued")
    yield from formed(blender, "formed")
    yield from act(blender, to(on_the_screen(blender, 0.0, 0.0)), "key ctrl+z")
    note(blender, "undone")
    for thing in curves():
        thing.select_set(thing.type == "FONT")
    blender.call(bpy.ops.digiclay.press_curves, "EXEC_DEFAULT", True, fill=True)
    yield from formed(blender, "stamped")


def curves():
    return [thing for thing in bpy.context.scene.objects if thing.type in ("CURVE", "FONT")]


def add_curves(blender):
    """Add both over the bed, selected, and write down the lines that Blender itself makes of them, mm."""
    file = Path(blender.OUT, "logo.svg")
    file.write_text(SVG)
    addon_utils.enable("io_curve_svg")
    blender.call(bpy.ops.import_curve.svg, filepath=str(file))
    addon_utils.disable("io_curve_svg")
    for thing in curves():
        thing.scale, thing.location = (16.0,) * 3, (-0.64, -0.64, 0.6)
    blender.call(bpy.ops.object.text_add, location=(-0.2, -0.34, 0.6))
    bpy.context.object.data.body, bpy.context.object.data.size = "R", 0.6
    for thing in curves():
        thing.select_set(True)
    blender.evaluate()
    blender.SEEN["lines"] = [line for thing in curves() for line in convert(thing)]
    bpy.ops.ed.undo_push(message="Curves")


def convert(thing):
    data = thing.data.copy()
    if data.dimensions == "2D":
        data.fill_mode = "NONE"
    other = bpy.data.objects.new("Lines", data)
    mesh = other.to_mesh()
    places = np.array([100.0 * (thing.matrix_world @ one.co) for one in mesh.vertices])[:, :2]
    after, lines = {edge.vertices[0]: edge.vertices[1] for edge in mesh.edges}, []
    while after:
        line = [min(after)]
        while line[-1] in after:
            line.append(after.pop(line[-1]))
        lines.append(places[line].tolist())
    other.to_mesh_clear()
    return lines


def look_at_menus(blender):
    for name, operator in (("DIGICLAY_PT_press_stroke", "panel"), ("VIEW3D_MT_object", "menu")):
        yield from done(blender, hand(to((300, 250), 0.3)))
        blender.call(getattr(bpy.ops.wm, f"call_{operator}"), "INVOKE_DEFAULT", name=name)
        yield from blender.rounds()
        blender.shot(f"curves_{operator}")
        yield from done(blender, hand("key Escape"))


def formed(blender, name):
    yield from blender.until(lambda: not blender.session().strokes)
    yield 2.0
    note(blender, name)
    for thing in curves():
        thing.hide_set(True)
    yield from blender.rounds()
    blender.shot(f"curves_{name}")
    for thing in curves():
        thing.hide_set(False)
