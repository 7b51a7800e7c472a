"""Erases, locks and stamps with the Press tool, about a placed center: X events from outside."""

import bpy

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    brush,
    done,
    drag,
    finish,
    hand,
    line,
    note,
    on_the_screen,
    prepare,
    reset,
    stroke,
    to,
)

#: How long the hand takes for a stroke, s, and moves a second.
HOW = (0.5, 60)
#: Half the length of a stroke, and where the center of symmetry is placed, mm.
LONG, CENTER = 21.0, (6.0, -3.0)


def keep(name):
    note(name)
    session = blender.session()
    locked = blender.part("core.base.modes").Mode.LOCKED
    blender.SEEN[name]["locked"] = (
        [] if session is None else (session.state.mode() == locked).tolist()
    )
    blender.shot(f"verbs_{name.replace(' ', '_')}")


def script():
    yield from prepare()
    settings = brush()
    yield from stroke("groove", (-LONG, 0.0), (LONG, 0.0), *HOW)
    settings.brush = "LOCK"
    process = line((0.0, -LONG), (0.0, LONG), *HOW)
    yield from done(process)
    yield from finish(process)
    keep("locked")
    settings.brush = "ERASE"
    yield from stroke("erased", (-LONG, 0.0), (LONG, 0.0), *HOW)
    keep("erased")
    yield from act(to(on_the_screen(0.0, 30.0)), "key ctrl+z")
    keep("erasing undone")
    yield from locks(settings)
    yield from stamp(settings)
    yield from center(settings)


def locks(settings):
    """Turn the locks over, undo that, and clear them; take one off by Ctrl before."""
    settings.brush = "LOCK"
    blender.call(bpy.ops.digiclay.press_locks, "INVOKE_DEFAULT", True, change="INVERT")
    yield from finish(hand("sleep 0.1"))
    keep("inverted")
    yield from act(to(on_the_screen(0.0, 30.0)), "key ctrl+z")
    keep("inverting undone")
    yield from stroke("unlocked", (0.0, -LONG), (0.0, 0.0), *HOW, key="ctrl")
    keep("unlocked")
    blender.call(bpy.ops.digiclay.press_locks, "INVOKE_DEFAULT", True, change="CLEAR")
    yield from finish(hand("sleep 0.1"))
    keep("cleared")


def stamp(settings):
    """Stamp a pyramid by dragging from its middle, and take it back; press one in by Ctrl."""
    settings.brush, settings.stamp, settings.height = "STAMP", "pyramid", 12.0
    start, end = (on_the_screen(x, 18.0) for x in (0.0, 15.0))
    process = hand(to(start), "mousedown 1", drag(start, end, *HOW), "sleep 1 mouseup 1")
    yield from blender.until(
        lambda: bool(bpy.context.window.modal_operators.get("DIGICLAY_OT_press_shape"))
    )
    yield 0.8
    blender.shot("verbs_stamp_under_way")
    yield from finish(process)
    keep("stamped")
    yield from act(to(on_the_screen(0.0, -30.0)), "key ctrl+z")
    keep("stamping undone")
    settings.depth = 8.0
    yield from stroke("imprinted", (0.0, 18.0), (12.0, 18.0), *HOW, key="ctrl")
    keep("imprinted")


def center(settings):
    """Place a center and draw a ray five times about it; mirror a line across a placed axis."""
    settings.brush, settings.symmetry, settings.radial = "RAISE", "RADIAL", 5
    yield from reset()
    note("flat")
    yield from blender.settle()
    start = on_the_screen(*CENTER)
    end = on_the_screen(CENTER[0] + 15.0, CENTER[1] + 15.0)
    area, region = blender.view()
    with bpy.context.temp_override(window=blender.window(), area=area, region=region):
        bpy.ops.digiclay.press_center("INVOKE_DEFAULT")
    process = hand(to(start), "mousedown 1", drag(start, end, *HOW), "mouseup 1")
    yield from done(process)
    blender.SEEN["center"] = [settings.center_x, settings.center_y, settings.axis]
    settings.depth = settings.height = 6.0
    x, y = CENTER
    yield from stroke("radial", (x + 9.0, y), (x + 21.0, y), *HOW)
    keep("radial")
    settings.symmetry = "Y"
    yield from blender.settle()
    yield from act(to(on_the_screen(12.0, 12.0)))
    blender.shot("verbs_axis")
