"""Picks pins in another workspace, presses Esc while a session steps aside, copies and deletes beds."""

from collections.abc import Iterator
from typing import Any

import bpy


def modal() -> list[str]:
    return [one.bl_idname for one in bpy.context.window_manager.windows[0].modal_operators]


def script(blender: Any) -> Iterator[float | None]:
    yield from blender.scene_with_bed(rows=9, columns=9)
    yield from pick(blender)
    yield from escape(blender)
    yield from units(blender)


def pick(blender: Any) -> Iterator[float | None]:
    """Begin to pick in one workspace, and go on in another; there, click beside all views as well."""
    picked = blender.part("device.view").picked_pins
    blender.call(bpy.ops.digiclay.pick_pins, "INVOKE_DEFAULT")
    yield None
    yield from blender.click(blender.on_the_bed(-6, -9))
    blender.SEEN["picked"] = list(picked(blender.beds()[0]))
    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Animation"]
    yield None
    yield None
    timeline = next(area for area in blender.window().screen.areas if area.type == "DOPESHEET_EDITOR")
    yield from blender.click((timeline.x + timeline.width // 2, timeline.y + timeline.height // 2))
    blender.SEEN["clicked in the timeline"] = list(picked(blender.beds()[0]))
    blender.key("HOME", blender.middle())
    yield None
    yield from blender.click(blender.on_the_bed(6, -9))
    blender.SEEN["picked elsewhere"] = list(picked(blender.beds()[0]))
    blender.SEEN["told in"] = list(blender.part("operators.action")._TOLD)
    blender.key("RET", blender.middle())
    yield 0.3
    blender.SEEN["after Enter"] = modal(), list(blender.part("operators.action")._TOLD)
    blender.window().workspace = home
    yield None


def escape(blender: Any) -> Iterator[float | None]:
    """Press Esc while nobody drives the session: over a 3D view, and over another editor."""
    loop, session_loop = blender.part("live.loop"), blender.part("operators.session_loop")
    # Long enough that the key comes in it for sure; else it is a tenth of a second every 20 s.
    usual = session_loop.EVERY, session_loop.MOMENT
    session_loop.EVERY, session_loop.MOMENT = 0.5, 5.0
    for name in ("VIEW_3D", "PROPERTIES"):
        blender.select(blender.beds()[0])
        blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
        area = next(one for one in blender.window().screen.areas if one.type == name)
        at = area.x + area.width // 2, area.y + area.height // 2
        blender.event("MOUSEMOVE", "NOTHING", at)
        yield from blender.until(loop.is_aside)
        before = modal(), len(blender.sessions())
        blender.key("ESC", at)
        yield 0.5
        after = len(blender.sessions())
        yield session_loop.MOMENT
        blender.SEEN[f"Esc over {name}"] = [*before, after, modal(), loop.token()]
    session_loop.EVERY, session_loop.MOMENT = usual


def counted(blender: Any, name: str) -> None:
    """Count the beds, those with a fingertip, the objects of the scene, those hidden, and the sessions."""
    scene = blender.window().scene
    tips = [blender.part("roles").fingertip_of(bed) for bed in blender.beds()]
    whole = sum(tip is not None for tip in tips)
    hidden = sum(thing.hide_get() for thing in scene.objects)
    blender.SEEN[name] = [len(tips), whole, len(scene.objects), hidden, len(blender.sessions())]


def looked(blender: Any, name: str) -> Iterator[float | None]:
    """Wait until Blender has done what was asked for and it was looked at; count."""
    watch = blender.part("device.unit")
    yield 1.0
    yield from blender.until(lambda: not bpy.app.timers.is_registered(watch._repair_when_idle))
    if blender.sessions():
        yield from blender.until(lambda: not all(one.stale for one in blender.sessions()))
    yield 0.5
    counted(blender, name)


def pressed(blender: Any, name: str, kind: str, **held: bool) -> Iterator[float | None]:
    blender.key(kind, blender.middle(), **held)
    yield from looked(blender, name)


def units(blender: Any) -> Iterator[float | None]:
    """Delete a bed, undo and redo that; drag a copy off, undo and redo that; hide; delete in mid-session."""
    blender.event("MOUSEMOVE", "NOTHING", blender.middle())
    blender.select(blender.beds()[0])
    yield 0.5
    counted(blender, "one bed")
    yield from pressed(blender, "deleted", "DEL")
    yield from pressed(blender, "delete undone", "Z", ctrl=True)
    yield from pressed(blender, "delete redone", "Z", ctrl=True, shift=True)
    yield from pressed(blender, "delete undone again", "Z", ctrl=True)
    blender.select(blender.beds()[0])
    blender.key("D", blender.middle(), shift=True)
    yield 1.0
    counted(blender, "copy in hand")
    x, y = blender.middle()
    blender.event("MOUSEMOVE", "NOTHING", (x + 120, y))
    yield 0.5
    blender.key("LEFTMOUSE", (x + 120, y))
    yield from looked(blender, "copied")
    yield from pressed(blender, "copy undone", "Z", ctrl=True)
    yield from pressed(blender, "copy redone", "Z", ctrl=True, shift=True)
    blender.select(blender.beds()[0])
    yield from pressed(blender, "hidden", "H")
    yield from pressed(blender, "shown", "H", alt=True)
    yield from blender.start(blender.beds()[1])
    counted(blender, "session")
    # A bed with a session is not selected, so that no outline encloses its pins.
    blender.select(blender.beds()[1])
    yield from pressed(blender, "deleted in mid-session", "DEL")
    yield from pressed(blender, "undone after it", "Z", ctrl=True)
    blender.call(bpy.ops.object.select_all, action="SELECT")
    bpy.ops.ed.undo_push(message="Select")
    blender.key("D", blender.middle(), alt=True)
    yield 1.0
    blender.key("RIGHTMOUSE", blender.middle())
    yield from looked(blender, "all copied")
    blender.call(bpy.ops.object.select_all, action="SELECT")
    bpy.ops.ed.undo_push(message="Select")
    yield from pressed(blender, "all deleted", "DEL")
    yield from pressed(blender, "all back", "Z", ctrl=True)
