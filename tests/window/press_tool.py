"""Draws a valley with the Press tool, changes the depth; turns what is shown on and off."""

import os

import addon_utils
import bpy
import numpy as np

from tests.window import driver as blender

#: The guide's pictures show the pins as a user sees them.
FINE_PINS = "DIGICLAY_SCREENSHOTS" in os.environ
#: A finger that is on its way moves in each of so many ticks of its session.
TICKS = 3


def drag(way, pause=0.3):
    """Hold the mouse along a way over the bed, mm, at its start until the finger is there; it stays down."""
    for step, (x, y) in enumerate(way):
        at = blender.on_the_bed(x, y)
        blender.hover(at)
        yield 0.15
        if step == 0:
            blender.event("LEFTMOUSE", "PRESS", at)
            yield from come()
        yield pause
    yield from come()


def come():
    """Wait until the finger has come to rest: it stays where it is while the session ticks on.

    By time alone a slow machine, on which nothing happens for a second, would be taken for a finger
    at rest.
    """
    last, still, since = None, 0, 0
    for _ in range(480):
        yield 0.25
        now = tuple(blender.fingertip().location)
        moment = max((session.tick for session in blender.sessions()), default=0)
        if now != last:
            last, still, since = now, 0, moment
            continue
        still += 1
        if still >= 3 and moment >= since + TICKS:
            return
    raise AssertionError("The finger does not come to rest")


def let_go(x, y):
    blender.event("LEFTMOUSE", "RELEASE", blender.on_the_bed(x, y))
    yield from come()


def note(name):
    blender.look(name)
    tip = blender.fingertip()
    blender.SEEN[name] |= {
        "bed": blender.heights().round(4).tolist(),
        "finger": (1e3 * blender.part("bridge").pose(tip)[:3]).tolist(),
        "overlay": blender.part("overlay.views").shown(),
        "forces written": bool(
            blender.part("bridge").read_cells(blender.bed().data)["force"].any()
        ),
        "picked": list(blender.part("device.view").picked_pins(blender.bed())),
    }


def script():
    yield from blender.scene_with_bed(bed="paper")
    # Software GL draws a frame or two a second; in between the session is to catch up.
    blender.preferences().most_periods = 100
    blender.choose_tool()
    yield None
    note("added")
    # An outline about 625 pins is what takes software GL longest.
    blender.call(bpy.ops.object.select_all, action="DESELECT")
    blender.hover(blender.on_the_bed(-15, 5))
    yield 1.0
    blender.shot("press_cursor")
    yield from edges()
    yield from keys()

    yield from drag([(-18.0 + 6.0 * step, 6.0) for step in range(0, 7, 2)])
    note("pressed")
    blender.shot("press_held")
    yield from let_go(18.0, 6.0)
    note("let go")
    yield from depths()
    yield from shown()
    yield from ended()
    yield from disabled()


def said(name):
    """Write down what is shown beside the cursor."""
    chosen = blender.part("press.brush").tool_settings(bpy.context)
    blender.SEEN[name] = blender.part("press.tool").describe(blender.bed(), chosen)


def keys():
    """Hold Ctrl and Shift over the bed, with a hand at rest, and let go of Ctrl where nobody sees it."""
    at = blender.on_the_bed(-15, 5)
    for name, held in (("LEFT_CTRL", {"ctrl": True}), ("RIGHT_SHIFT", {"shift": True})):
        blender.event(name, "PRESS", at, **held)
        yield from blender.rounds()
        said(f"{name} held")
        blender.event(name, "RELEASE", at)
        yield from blender.rounds()
        said(f"{name} let go")
    blender.event("LEFT_CTRL", "PRESS", at, ctrl=True)
    yield from blender.rounds()
    blender.hover((at[0] + 1, at[1]))
    yield from blender.rounds()
    said("moved without Ctrl")


def edges():
    """Move the mouse into corners of a view full of pins; find where the text beside it is drawn."""
    area, region = blender.view()
    looking = area.spaces.active.region_3d
    preferences = bpy.context.preferences.addons[blender.EXTENSION].preferences
    area.spaces.active.show_region_ui = True
    distance, looking.view_distance = looking.view_distance, 0.4
    yield 0.5
    left, bottom, right, top = blender.part("overlay.views").find_free_room(area, region)
    places = {"middle": (0.4, 0.6), "right": (0.98, 0.6), "corner": (0.97, 0.03)}
    blender.SEEN["room"], blender.SEEN["text"] = (left, bottom, right, top), {}
    for name, (x, y) in places.items():
        at = (
            round(region.x + left + x * (right - left)),
            round(region.y + bottom + y * (top - bottom)),
        )
        pictures = []
        for preferences.show_cursor_text in (False, True):
            blender.hover(at)
            yield from blender.rounds(8)
            blender.shot(f"press_text_{name}")
            pictures.append(blender.read_shot(f"press_text_{name}"))
        rows, columns = np.nonzero((pictures[0] != pictures[1]).any(axis=2))
        ends = [columns.min(), rows.min(), columns.max(), rows.max()] - np.tile(
            [region.x, region.y], 2
        )
        blender.SEEN["text"][name] = ends.tolist()
    looking.view_distance, area.spaces.active.show_region_ui = distance, False
    yield 0.5


def depths():
    yield from drag([(-20.0, -20.0)])
    note("before the wheel")
    at = blender.on_the_bed(-20, -20)
    for _ in range(8):
        blender.event("WHEELDOWNMOUSE", "PRESS", at, ctrl=True)
        yield 0.1
    yield from come()
    # Moves that Blender makes up itself have the keys that are held.
    blender.event("LEFT_CTRL", "PRESS", at, ctrl=True)
    for step in range(1, 5):
        blender.hover((at[0], at[1] + 20 * step), ctrl=True)
        yield 0.1
    yield from come()
    note("after Ctrl")
    said("deeper")
    blender.event("LEFT_CTRL", "RELEASE", at)
    blender.key("ESC", at)
    yield from blender.settle()
    blender.event("LEFTMOUSE", "RELEASE", at)
    yield from blender.settle()
    said("the next one")
    blender.key("P", at)  # pauses: the stroke stays in the queue
    yield from blender.until(lambda: blender.session().paused)
    blender.event("LEFT_CTRL", "PRESS", at, ctrl=True)
    blender.event("LEFTMOUSE", "PRESS", at, ctrl=True)
    yield from blender.until(lambda: any(session.strokes for session in blender.sessions()))
    blender.event("LEFTMOUSE", "RELEASE", at, ctrl=True)
    blender.event("LEFT_CTRL", "RELEASE", at)
    yield from blender.rounds()
    said("while Raise forms")
    blender.key("Z", at, ctrl=True)
    yield from blender.settle()
    blender.key("P", at)
    yield from blender.until(lambda: not blender.session().paused)
    yield from blender.settle()


def disabled():
    """Disable the extension with the tool in hand and the mouse over the bed, and go on moving it."""
    yield from blender.add_bed(bed="paper")
    tools, at = blender.window().workspace.tools, blender.on_the_bed(-15, 5)
    held = [tools.from_space_view3d_mode("OBJECT").idname]
    blender.hover(at)
    yield 1.0
    addon_utils.disable(blender.EXTENSION)
    held.append(tools.from_space_view3d_mode("OBJECT").idname)
    for step in range(3):
        blender.hover((at[0] + 5 * step, at[1]))
        yield 1.0
    blender.SEEN["tools held"] = held
    addon_utils.enable(blender.EXTENSION)  # for what comes after the script


def shown():
    blender.window().view_layer.objects.active = blender.bed()
    blender.call(bpy.ops.digiclay.pick_pins, "INVOKE_DEFAULT")
    yield None
    for x in (-12.0, 0.0, 12.0):
        yield from blender.click(blender.on_the_bed(x, -27))
    blender.key("RET")
    yield 0.5
    note("picked")
    chosen = bpy.context.preferences.addons[blender.EXTENSION].preferences
    chosen.overlay_corner = "bottom_right"  # the finger is on the left
    display = blender.bed().digiclay_display
    blender.part("overlay.ready_view").SIDEBAR = 0.0  # none is opened in the guide's picture
    # The bed makes room for all of the overlay: the hand goes where it then is seen.
    display.form, display.color, display.arrows, display.overlay_full = "pins", "force", True, True
    yield 0.5
    yield from drag([(-12.0 + 4.0 * step, -24.0) for step in range(0, 5, 2)])
    yield from blender.settle()
    note("forces shown")
    blender.shot("guide_forces")
    yield from let_go(4.0, -24.0)
    preferences = bpy.context.preferences
    theme = bpy.utils.preset_paths("interface_theme")[0]
    bpy.ops.script.execute_preset(
        filepath=f"{theme}/Blender_Light.xml", menu_idname="USERPREF_MT_interface_theme_presets"
    )
    display.form, display.color, display.arrows, display.overlay_full = "skin", "mode", False, False
    chosen.overlay_corner = "top_left"
    yield 1.5
    blender.shot("press_light")
    preferences.view.ui_scale = 1.5
    yield 1.5
    blender.shot("press_scaled")
    preferences.view.ui_scale = 1.0
    display.overlay = False
    yield from blender.settle()
    note("overlay off")
    display.overlay = True
    yield from blender.settle()
    note("overlay on")


def ended():
    """End the session; then a press starts it anew, and losing the bed under the mouse ends the gesture."""
    blender.key("ESC")
    yield from blender.stopped()
    note("ended")
    yield from drag([(20.0, 20.0)])
    note("started anew")
    bpy.data.objects.remove(blender.bed())
    yield from blender.stopped()
    blender.look("bed deleted")
    blender.event("LEFTMOUSE", "RELEASE", blender.middle())
    yield 0.5
