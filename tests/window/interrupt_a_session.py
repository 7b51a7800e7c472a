"""Deletes, edits and switches what a session needs while it runs; disables the extension; loads a file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import addon_utils
import bpy


def start(blender: Any) -> Iterator[float | None]:
    """Start a session on the active bed."""
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from blender.settle()


def press(blender: Any) -> Iterator[float | None]:
    """Form a hollow, as one undo step that ends with the fingertip lifted."""
    tip = blender.fingertip()
    for z in (46.0, 43.0, 40.0, 38.0, 37.0, 37.0, 40.0, 46.0):
        tip.location.z = (z + 8.0) * 1e-3 * blender.part("bridge").SCALE
        yield from blender.settle(1)
    bpy.ops.ed.undo_push(message="Press")
    yield None


def edit_in_mid_stroke(blender: Any) -> Iterator[float | None]:
    """Draw a stroke, go to Edit Mode before the finger has finished it, and take it back with Esc there."""
    blender.select(blender.beds()[0])
    yield None
    move, press = ("MOUSEMOVE", "NOTHING"), "LEFTMOUSE"
    way = [(*move, x) for x in (15, -15) * 4]  # more than the finger goes until Tab
    for kind, value, x in ((*move, -15), (press, "PRESS", -15), *way, (press, "RELEASE", -15)):
        blender.event(kind, value, blender.on_the_bed(x, -25.0))  # beside the sidebar
        yield 0.05
    (session,) = blender.part("sessions.running").list_sessions()
    yield from blender.until(lambda: blender.part("sessions.running").list_sessions()[0].tick > session.tick)
    blender.key("TAB", blender.middle())
    yield from blender.settle()
    strokes = [len(session.strokes) for session in blender.part("sessions.running").list_sessions()]
    blender.look("edited")
    blender.shot("session_edited")
    blender.key("ESC", blender.middle())
    yield from blender.settle()
    left = [len(session.strokes) for session in blender.part("sessions.running").list_sessions()]
    blender.SEEN["strokes"] = [strokes, left]
    blender.key("TAB", blender.middle())
    yield from blender.settle()
    blender.look("edited no more")


def script(blender: Any) -> Iterator[float | None]:
    """Do to a session what can be done to it."""
    yield from blender.empty_scene()
    blender.call(bpy.ops.mesh.digital_clay_add)
    bpy.ops.ed.undo_push(message="Add")
    yield from blender.open_sidebar()
    blender.key("HOME", blender.middle())
    yield from start(blender)
    yield from press(blender)
    blender.look("formed")

    blender.select(blender.fingertip())
    blender.key("DEL", blender.middle())
    yield from blender.settle()
    blender.look("fingertip deleted")
    blender.shot("session_waits")
    blender.key("Z", blender.middle(), ctrl=True)
    yield from blender.settle()
    blender.look("fingertip back")

    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Animation"]
    yield None
    yield from blender.settle()
    blender.look("in another workspace")
    blender.shot("session_workspace")
    blender.window().workspace = home
    yield None

    scene = blender.window().scene
    blender.window().scene = bpy.data.scenes.new("Other")
    yield None
    yield from blender.settle()
    blender.look("in another scene")
    blender.SEEN["in another scene"]["waits"] = (
        blender.part("sessions.running").list_sessions()[0].blocking_reason
    )
    blender.window().scene = scene
    yield from blender.settle()
    blender.look("scene back")

    yield from edit_in_mid_stroke(blender)

    blender.beds()[0].scale = (1.0, 1.0, 1.5)
    yield from blender.settle()
    blender.look("scaled")
    blender.key("F", blender.on_the_bed(0.0, -25.0))  # at every redraw it would fail
    yield 1.0
    blender.SEEN["adjusting"] = [operator.bl_idname for operator in blender.window().modal_operators]
    blender.beds()[0].scale = (1.0, 1.0, 1.0)
    yield from blender.settle()
    blender.look("scaled no more")

    blender.call(bpy.ops.mesh.digital_clay_add, rows=9, columns=9)
    bpy.context.view_layer.objects.active.location.x = 1.5
    yield from start(blender)
    blender.look("two beds")
    blender.select(bpy.context.view_layer.objects.active)
    blender.key("DEL", blender.middle())
    yield from blender.settle()
    blender.look("second bed deleted")

    bpy.ops.ed.undo_push(message="Before")
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.key("DEL", blender.middle())
    yield from blender.until(lambda: not blender.part("sessions.running").list_sessions())
    blender.look("all deleted")
    blender.key("Z", blender.middle(), ctrl=True)
    yield 1.0
    blender.look("all back")
    blender.select(blender.beds()[0])
    yield from start(blender)
    blender.look("started again")

    addon_utils.disable(blender.EXTENSION)
    yield 1.0
    blender.SEEN["panels left"] = [name for name in dir(bpy.types) if name.startswith("DIGICLAY_")]
    blender.event("MOUSEMOVE", "NOTHING", blender.middle())
    yield 1.0
    addon_utils.enable(blender.EXTENSION)
    yield None
    blender.look("enabled again")
    yield from start(blender)
    blender.look("going on")

    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    blender.look("another file")
    drawing = getattr(bpy.types.STATUSBAR_HT_header.draw, "_draw_funcs", [])
    blender.SEEN["keys drawn"] = [f.__module__ for f in drawing if f.__module__.startswith(blender.EXTENSION)]
    blender.call(bpy.ops.mesh.digital_clay_add)
    yield from start(blender)
    blender.look("before quitting")
    blender.hand_over()
    bpy.ops.wm.quit_blender()  # with the session on: nobody disables the extension before
    yield 60.0
