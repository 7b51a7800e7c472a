"""Sets sizes with F, draws symmetric strokes, lines and rings, by X events from outside."""

from collections.abc import Iterator
from typing import Any

import bpy

from tests.window.hand_strokes import (
    act,
    brush,
    drag,
    finish,
    hand,
    line,
    note,
    on_the_screen,
    prepare,
    reset,
    rest,
    stroke,
    to,
)

#: Ends of the stroke that is mirrored, mm.
MIRRORED = ((-27.0, 12.0), (-9.0, 12.0))
#: Radius of the ring, mm.
RADIUS = 21.0
#: How far the mouse goes sideways to make the fingertip larger, mm on the bed: half of what its size grows.
WIDER = 4.0


def script(blender: Any) -> Iterator[float | None]:
    yield from prepare(blender, "TOP")
    blender.call(bpy.ops.view3d.view_all)
    # The first press starts the session.
    yield from act(blender, to(on_the_screen(blender, -24.0, -24.0)), "click 1")
    yield from sizes(blender)
    yield from reset(blender)
    bpy.ops.ed.undo_push(message="Reset")  # what Ctrl-Z goes back to: a reset has no step of its own
    yield from symmetric(blender)
    yield from shapes(blender)


def write_down(blender: Any, name: str) -> None:
    """Note the sizes, in mm, and the sessions."""
    note(blender, name)
    bed, settings = blender.beds()[0], brush(blender)
    session = blender.part("sessions.running").find(bed)
    blender.SEEN[name] |= {
        "size": bed.digiclay.size,
        "drawn size": 2e3 * blender.part("bridge").finger_of(blender.fingertip()).width,
        "simulated": 2e3 * session.scene.fingers[0].fingertip.width if session else 0.0,
        "blister": bed.digiclay.blister.radius,
        "depth": settings.depth,
        "strength": settings.strength,
    }


def done(blender: Any, *words: str, name: str = "") -> Iterator[float | None]:
    """Let the hand do it, and the sessions take it up; write down what there is then."""
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield from rest(blender)
    if name:
        write_down(blender, name)


def keys(names: str) -> str:
    return " ".join(f"key {name} sleep 0.15" for name in names.split())


def sizes(blender: Any) -> Iterator[float | None]:
    start, end = on_the_screen(blender, 0.0, 0.0), on_the_screen(blender, WIDER, 0.0)
    write_down(blender, "begun")
    yield from done(blender, to(start), keys("f"), drag(start, end, 0.4, 60))
    blender.shot("size_f")
    yield from done(blender, "click 1", name="larger")
    yield from done(blender, keys("ctrl+z"), name="undone")
    wider = to(start), keys("f"), drag(start, end, 0.4, 60)
    yield from done(blender, *wider, keys("Escape"), name="escaped")
    yield from done(blender, to(start), keys("f 2 4 Return"), name="typed")
    yield from done(blender, to(start), keys("f 1 c m Return"), name="typed cm")
    yield from done(blender, keys("bracketright bracketright bracketleft"), name="brackets")
    yield from done(blender, keys("f 1 6 Return"))
    yield from done(blender, to(start), keys("shift+f"), drag(start, (start[0] + 40, start[1]), 0.4, 60))
    blender.shot("size_depth")
    yield from done(blender, "click 1", name="deeper")
    yield from done(blender, keys("shift+f 4 Return ctrl+f 5 0 Return"), name="strength")
    yield from done(blender, keys("ctrl+f 1 0 0 Return"))


def symmetric(blender: Any) -> Iterator[float | None]:
    brush(blender).symmetry = "XY"
    yield from stroke(blender, "symmetric", *MIRRORED, 0.8, picture="symmetric")
    yield from act(blender, keys("ctrl+z"))
    note(blender, "symmetric undone")
    brush(blender).symmetry = "NONE"
    yield from reset(blender)


def shapes(blender: Any) -> Iterator[float | None]:
    """Drag a line, then click with Shift; drag a ring; draw with a stabilizer."""
    settings = brush(blender)
    settings.path = "LINE"
    yield from finish(blender, line(blender, (-27.0, -24.0), (27.0, -24.0), 0.4))
    settings.path = "FREE"
    corner = on_the_screen(blender, 27.0, 27.0)
    yield from act(blender, to(corner), "keydown shift sleep 0.1 click 1 sleep 0.1 keyup shift")
    note(blender, "lines")
    yield from reset(blender)
    settings.path = "RING"
    process = line(blender, (0.0, 0.0), (RADIUS, 0.0), 0.4, last="")
    yield from blender.until(lambda: process.poll() is not None)
    yield 0.5
    blender.shot("ring_preview")
    yield from act(blender, "mouseup 1")
    note(blender, "ring")
    blender.shot("ring")
    yield from reset(blender)
    settings.path, settings.stabilizer = "FREE", 9.0
    yield from stroke(blender, "stabilized", (-27.0, 0.0), (27.0, 0.0))
    settings.stabilizer = 0.0
