"""Picks pins while the workspace changes under it, and presses Esc in the moment a session steps aside."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy


def modal() -> list[str]:
    """Return the modal operators of the window."""
    return [one.bl_idname for one in bpy.context.window_manager.windows[0].modal_operators]


def on_the_bed(blender: Any, x: float, y: float) -> tuple[int, int]:
    """Return where a place on the pins at rest, mm, is seen in the first 3D view."""
    from mathutils import Vector

    blender.evaluate()
    scale = blender.part("bridge").SCALE * 1e-3
    return blender.pixel(blender.beds()[0].matrix_world @ Vector((x * scale, y * scale, 40 * scale)))


def click(blender: Any, at: tuple[int, int]) -> Iterator[float | None]:
    """Click at a place of the window."""
    blender.event("MOUSEMOVE", "NOTHING", at)
    yield 0.2
    blender.key("LEFTMOUSE", at)
    yield 0.3


def script(blender: Any) -> Iterator[float | None]:
    """Do both."""
    yield from blender.empty_scene()
    blender.call(bpy.ops.mesh.digital_clay_add, rows=9, columns=9)
    bpy.ops.ed.undo_push(message="Add")
    blender.key("HOME", blender.middle())
    yield None
    yield from pick(blender)
    yield from escape(blender)


def pick(blender: Any) -> Iterator[float | None]:
    """Begin to pick in one workspace, and go on in another; there, click beside all views as well."""
    picked = blender.part("device.display").picked
    blender.call(bpy.ops.digiclay.pick_pins, "INVOKE_DEFAULT")
    yield None
    yield from click(blender, on_the_bed(blender, -6, -9))
    blender.SEEN["picked"] = list(picked(blender.beds()[0]))
    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Animation"]
    yield None
    yield None
    timeline = next(area for area in blender.window().screen.areas if area.type == "DOPESHEET_EDITOR")
    yield from click(blender, (timeline.x + timeline.width // 2, timeline.y + timeline.height // 2))
    blender.SEEN["clicked in the timeline"] = list(picked(blender.beds()[0]))
    blender.key("HOME", blender.middle())
    yield None
    yield from click(blender, on_the_bed(blender, 6, -9))
    blender.SEEN["picked elsewhere"] = list(picked(blender.beds()[0]))
    blender.SEEN["told in"] = list(blender.part("operators.status")._TOLD)
    blender.key("RET", blender.middle())
    yield 0.3
    blender.SEEN["after Enter"] = modal(), list(blender.part("operators.status")._TOLD)
    blender.window().workspace = home
    yield None


def escape(blender: Any) -> Iterator[float | None]:
    """Press Esc while nobody drives the session: over a 3D view, and over another editor."""
    loop, session_loop = blender.part("live.loop"), blender.part("operators.session_loop")
    # Long enough that the key comes in it for sure; else it is a tenth of a second every 20 s.
    session_loop.EVERY, session_loop.MOMENT = 0.5, 8.0
    for name in ("VIEW_3D", "PROPERTIES"):
        blender.select(blender.beds()[0])
        blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
        area = next(one for one in blender.window().screen.areas if one.type == name)
        at = area.x + area.width // 2, area.y + area.height // 2
        blender.event("MOUSEMOVE", "NOTHING", at)
        yield from blender.until(loop.aside)
        before = modal(), len(blender.part("live.running").all())
        blender.key("ESC", at)
        yield 0.5
        after = len(blender.part("live.running").all())
        yield session_loop.MOMENT
        blender.SEEN[f"Esc over {name}"] = [*before, after, modal(), loop.token()]
