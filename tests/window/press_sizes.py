"""Sets sizes with F, draws symmetric strokes, lines and rings, by X events from outside."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.append(str(Path(__file__).parents[2]))

from tests.window.hand_strokes import (
    add_bed,
    drag,
    finish,
    focus_window,
    hand,
    note,
    on_the_screen,
    reset,
    take_tool,
    to,
)

#: Ends of the stroke that is mirrored, mm.
MIRRORED = ((-27.0, 12.0), (-9.0, 12.0))
#: Radius of the ring, mm.
RADIUS = 21.0
#: How far the mouse goes sideways to make the fingertip larger, mm on the bed: half of what its size grows.
WIDER = 4.0


def script(blender: Any) -> Iterator[float | None]:
    """Do what a hand does."""
    add_bed(blender)
    blender.call(bpy.ops.view3d.view_axis, type="TOP")
    blender.call(bpy.ops.view3d.view_all)
    take_tool(blender)
    yield from focus_window()
    # The first press starts the session.
    yield from finish(blender, hand(to(on_the_screen(blender, -24.0, -24.0)), "click 1"))
    yield from sizes(blender)
    yield from reset(blender)
    # What Ctrl-Z goes back to: a reset has no step of its own.
    bpy.ops.ed.undo_push(message="Reset")
    yield from symmetric(blender)


def settings(blender: Any) -> Any:
    """Return the tool's settings."""
    return blender.part("press.brush").tool_settings(bpy.context)


def write_down(blender: Any, name: str) -> None:
    """Note the sizes, in mm, and the sessions."""
    note(blender, name)
    bed, tip = blender.beds()[0], blender.fingertip()
    session = blender.part("sessions.running").find(bed)
    blender.SEEN[name] |= {
        "size": bed.digiclay.size,
        "drawn size": 2e3 * blender.part("bridge").finger_of(tip).width,
        "simulated": 2e3 * session.scene.fingers[0].fingertip.width if session else 0.0,
        "blister": bed.digiclay.blister.radius,
        "depth": settings(blender).depth,
        "strength": settings(blender).strength,
    }


def keys(*names: str) -> str:
    """Return what types keys, one after the other."""
    return " ".join(f"key {name} sleep 0.15" for name in names)


def sizes(blender: Any) -> Iterator[float | None]:
    """Use F, Shift F, Ctrl F, the brackets, Esc and Ctrl-Z."""
    start, end = on_the_screen(blender, 0.0, 0.0), on_the_screen(blender, WIDER, 0.0)
    write_down(blender, "begun")
    yield from done(blender, to(start), keys("f"), drag(start, end, 0.4, 60))
    blender.shot("size_f")
    yield from done(blender, "click 1")
    write_down(blender, "larger")
    yield from done(blender, keys("ctrl+z"))
    write_down(blender, "undone")
    yield from done(blender, to(start), keys("f"), drag(start, end, 0.4, 60), keys("Escape"))
    write_down(blender, "escaped")
    yield from done(blender, to(start), keys("f", "2", "4", "Return"))
    write_down(blender, "typed")
    yield from done(blender, to(start), keys("f", "1", "c", "m", "Return"))
    write_down(blender, "typed cm")
    yield from done(blender, keys("bracketright", "bracketright", "bracketleft"))
    write_down(blender, "brackets")
    yield from done(blender, keys("f", "1", "6", "Return"))
    yield from done(blender, to(start), keys("shift+f"), drag(start, (start[0] + 40, start[1]), 0.4, 60))
    blender.shot("size_depth")
    yield from done(blender, "click 1")
    write_down(blender, "deeper")
    yield from done(blender, keys("shift+f", "4", "Return", "ctrl+f", "5", "0", "Return"))
    write_down(blender, "strength")
    yield from done(blender, keys("ctrl+f", "1", "0", "0", "Return"))


def done(blender: Any, *words: str) -> Iterator[float | None]:
    """Let the hand do it, and the sessions take it up."""
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield 0.5
    yield from blender.settle(10)


def symmetric(blender: Any) -> Iterator[float | None]:
    """Draw a stroke in one quarter of the bed, with both symmetries."""
    settings(blender).symmetry = "XY"
    start, end = (on_the_screen(blender, *place) for place in MIRRORED)
    process = hand(to(start), "mousedown 1", drag(start, end, 0.8, 60), "mouseup 1")
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot("symmetric")
    yield from finish(blender, process)
    note(blender, "symmetric")
    yield from finish(blender, hand(keys("ctrl+z")))
    note(blender, "symmetric undone")
    settings(blender).symmetry = "NONE"
    yield from reset(blender)
    yield from shapes(blender)


def shapes(blender: Any) -> Iterator[float | None]:
    """Drag a line, then click with Shift; drag a ring; draw with a stabilizer."""
    brush = settings(blender)
    brush.path = "LINE"
    start, end = on_the_screen(blender, -27.0, -24.0), on_the_screen(blender, 27.0, -24.0)
    yield from finish(blender, hand(to(start), "mousedown 1", drag(start, end, 0.4, 60), "mouseup 1"))
    brush.path = "FREE"
    corner = on_the_screen(blender, 27.0, 27.0)
    yield from finish(blender, hand(to(corner), "keydown shift sleep 0.1 click 1 sleep 0.1 keyup shift"))
    note(blender, "lines")
    yield from reset(blender)
    brush.path = "RING"
    start, end = on_the_screen(blender, 0.0, 0.0), on_the_screen(blender, RADIUS, 0.0)
    process = hand(to(start), "mousedown 1", drag(start, end, 0.4, 60))
    yield from blender.until(lambda: process.poll() is not None)
    yield 0.5
    blender.shot("ring_preview")
    yield from finish(blender, hand("mouseup 1"))
    note(blender, "ring")
    blender.shot("ring")
    yield from reset(blender)
    brush.path, brush.stabilizer = "FREE", 9.0
    start, end = on_the_screen(blender, -27.0, 0.0), on_the_screen(blender, 27.0, 0.0)
    yield from finish(blender, hand(to(start), "mousedown 1", drag(start, end, 1.0, 60), "mouseup 1"))
    note(blender, "stabilized")
    brush.stabilizer = 0.0
