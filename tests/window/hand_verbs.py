"""Erases, locks and stamps with the Press tool, about a placed center: X events from outside."""

import bpy

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


def keep(blender, name):
    note(blender, name)
    session = blender.session()
    locked = blender.part("core.base.modes").Mode.LOCKED
    blender.SEEN[name]["locked"] = (
        [] if session is None else (session.state.mode() == locked).tolist()
    )
    blender.shot(f"verbs_{name.replace(' ', '_')}")


def script(blender):
    yield from prepare(blender)
    settings = brush(blender)
    yield from stroke(blender, "groove", (-LONG, 0.0), (LONG, 0.0), *HOW)
    settings.brush = "LOCK"
    process = line(blender, (0.0, -LONG), (0.0, LONG), *HOW)
    yield from done(blender, process)
    yield from finish(blender, process)
    keep(blender, "locked")
    settings.brush = "ERASE"
    yield from stroke(blender, "erased", (-LONG, 0.0), (LONG, 0.0), *HOW)
    keep(blender, "erased")
    yield from act(blender, to(on_the_screen(blender, 0.0, 30.0)), "key ctrl+z")
    keep(blender, "erasing undone")
    yield from locks(blender, settings)
    yield from stamp(blender, settings)
    yield from center(blender, settings)


def locks(blender, settings):
    """Turn the locks over, undo that, and clear them; take one off by Ctrl before."""
    settings.brush = "LOCK"
    blender.call(bpy.ops.digiclay.press_locks, "INVOKE_DEFAULT", True, change="INVERT")
    yield from finish(blender, hand("sleep 0.1"))
    keep(blender, "inverted")
    yield from act(blender, to(on_the_screen(blender, 0.0, 30.0)), "key ctrl+z")
    keep(blender, "inverting undone")
    yield from stroke(blender, "unlocked", (0.0, -LONG), (0.0, 0.0), *HOW, key="ctrl")
    keep(blender, "unlocked")
    blender.call(bpy.ops.digiclay.press_locks, "INVOKE_DEFAULT", True, change="CLEAR")
    yield from finish(blender, hand("sleep 0.1"))
    keep(blender, "cleared")


def stamp(blender, settings):
    """Stamp a pyramid by dragging from its middle, and take it back; press one in by Ctrl."""
    settings.brush, settings.stamp, settings.height = "STAMP", "pyramid", 12.0
    start, end = (on_the_screen(blender, x, 18.0) for x in (0.0, 15.0))
    process = hand(to(start), "mousedown 1", drag(start, end, *HOW), "sleep 1 mouseup 1")
    yield from blender.until(
        lambda: bool(bpy.context.window.modal_operators.get("DIGICLAY_OT_press_shape"))
    )
    yield 0.8
    blender.shot("verbs_stamp_under_way")
    yield from finish(blender, process)
    keep(blender, "stamped")
    yield from act(blender, to(on_the_screen(blender, 0.0, -30.0)), "key ctrl+z")
    keep(blender, "stamping undone")
    settings.depth = 8.0
    yield from stroke(blender, "imprinted", (0.0, 18.0), (12.0, 18.0), *HOW, key="ctrl")
    keep(blender, "imprinted")


def center(blender, settings):
    """Place a center and draw a ray five times about it; mirror a line across a placed axis."""
    settings.brush, settings.symmetry, settings.radial = "RAISE", "RADIAL", 5
    yield from reset(blender)
    note(blender, "flat")
    yield from blender.settle()
    start = on_the_screen(blender, *CENTER)
    end = on_the_screen(blender, CENTER[0] + 15.0, CENTER[1] + 15.0)
    area, region = blender.view()
    with bpy.context.temp_override(window=blender.window(), area=area, region=region):
        bpy.ops.digiclay.press_center("INVOKE_DEFAULT")
    process = hand(to(start), "mousedown 1", drag(start, end, *HOW), "mouseup 1")
    yield from done(blender, process)
    blender.SEEN["center"] = [settings.center_x, settings.center_y, settings.axis]
    settings.depth = settings.height = 6.0
    x, y = CENTER
    yield from stroke(blender, "radial", (x + 9.0, y), (x + 21.0, y), *HOW)
    keep(blender, "radial")
    settings.symmetry = "Y"
    yield from blender.settle()
    yield from act(blender, to(on_the_screen(blender, 12.0, 12.0)))
    blender.shot("verbs_axis")
