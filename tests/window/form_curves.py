"""Forms along a curve, a text and an SVG, then stamps what is filled: X events, from the menus."""

from pathlib import Path

import addon_utils
import bpy
import numpy as np

from tests.window import driver as blender
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

#: A ring, a filled disc beside it, and in it a roof that is open below, in mm.
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="80mm" height="80mm" viewBox="0 0 80 80">
<circle cx="40" cy="40" r="30" fill="none" stroke="black"/>
<circle cx="9" cy="9" r="6" fill="black"/>
<path d="M28 30 L40 18 L52 30" fill="none" stroke="black"/></svg>"""


#: The Object menu, pixels from the top left corner of the window, and half the height of an entry.
OBJECT, HALF = (328, 41), 10
#: Numbers of its entries from the end: the last one is *Add Presser*.
ALONG, FILLED = 3, 2


def script():
    add_bed(bed="design")
    take_tool()
    yield from focus_window()
    settings = brush()
    settings.brush, settings.height = "RAISE", 8.0
    add_curves()
    yield from blender.rounds()
    yield from act(to(on_the_screen(0.0, 0.0)), "key a sleep 0.5")
    blender.SEEN["selected"] = len([thing for thing in curves() if thing.select_get()])
    yield from click_entry("along", ALONG)
    yield from blender.until(lambda: blender.session() is not None)
    blender.SEEN["queued"] = blender.session().begun_strokes
    blender.shot("curves_queued")
    yield from formed("formed")
    yield from act(to(on_the_screen(0.0, 0.0)), "key ctrl+z")
    note("undone")
    for thing in curves():
        filled = thing.type == "FONT" or thing.data.fill_mode != "NONE"
        thing.select_set(filled and thing.data.dimensions == "2D")
    yield from click_entry("filled", FILLED)
    yield from formed("stamped")


def click_entry(name, number):
    """Open the Object menu by the pointer, and click an entry, by its number from the end.

    The arrow keys tell where it is: the picture changes in it and in the one above.
    """
    yield from done(hand(to(OBJECT, 0.3), "click 1 sleep 0.8"))
    pictures = []
    for words in (["key Up sleep 0.3"] * number, ["key Up sleep 0.3"]):
        yield from done(hand(*words))
        blender.shot(f"curves_{name}")
        pictures.append(blender.read_shot(f"curves_{name}"))
    rows, columns = np.nonzero((np.abs(pictures[1] - pictures[0]) > 0.05).any(axis=-1))
    x, y = int(np.median(columns)), len(pictures[0]) - int(rows.min()) - HALF
    yield from done(hand(to((x + 3, y), 0.3), to((x, y), 0.3)))
    blender.shot(f"curves_{name}")  # a menu takes clicks when it has been drawn
    yield from done(hand("click 1 sleep 0.5"))


def curves():
    return [thing for thing in bpy.context.scene.objects if thing.type in ("CURVE", "FONT")]


def add_curves():
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
    blender.call(bpy.ops.curve.primitive_bezier_curve_add, radius=0.14, location=(0.54, -0.58, 0.6))
    blender.call(bpy.ops.object.select_all, action="DESELECT")
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


def formed(name):
    yield from blender.until(lambda: not blender.session().strokes)
    yield 2.0
    note(name)
    for thing in curves():
        thing.hide_set(True)
    yield from blender.rounds()
    blender.shot(f"curves_{name}")
    for thing in curves():
        thing.hide_set(False)
