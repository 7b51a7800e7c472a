"""Played by `driver`: forms with two fingertips, and with a hand, which come and go during a session."""

from collections.abc import Iterator
from typing import Any

import bpy

#: Pins as a user sees them.
FINE_PINS = True


def note(blender: Any, name: str) -> None:
    session, roles = blender.sessions()[0], blender.part("roles")
    bed = blender.beds()[0]
    blender.SEEN[name] = {
        "numbers": list(session.numbers), "tips": list(roles.fingertips_of(bed)),
        "poses": (1e3 * session.poses[:, :3]).tolist(), "waits": session.blocking_reason,
        "forces": session.state.finger_forces().tolist(),
    }  # fmt: skip


def script(blender: Any) -> Iterator[float | None]:
    """Press two fingertips, then a hand by its palm; delete it, undo that, copy a fingertip."""
    yield from blender.scene_with_bed(bed="paper")
    yield from blender.open_sidebar()
    yield from blender.start()
    blender.call(bpy.ops.digiclay.add_fingertip)
    yield from blender.settle()
    note(blender, "two")
    roles = blender.part("roles")
    for number, x in ((1, -14.0), (2, 14.0)):
        tip = roles.fingertips_of(blender.beds()[0])[number]
        tip.location.x, tip.location.y = 1e-2 * x, 0.0
        blender.select(tip)
        yield from blender.grab((0.0, 0.0, -9.0), "Z", periods=4)
    note(blender, "two pressed")
    blender.shot("two")
    blender.select(blender.beds()[0])
    blender.call(bpy.ops.digiclay.add_hand)
    yield from blender.settle()
    note(blender, "hand")
    blender.shot("hand above")
    yield from blender.grab((0.0, 0.0, -9.0), "Z", periods=4)
    note(blender, "hand pressed")
    blender.beds()[0].digiclay_display.overlay_full = True
    yield from blender.rounds(10)
    blender.shot("hand")
    yield from blender.grab((0.0, 0.0, 12.0), "Z", periods=4)
    blender.key("DEL", blender.middle())
    yield from blender.settle(10)
    note(blender, "deleted")
    yield from blender.undo("undone")
    yield from blender.settle(10)
    note(blender, "hand again")
    blender.select(roles.fingertips_of(blender.beds()[0])[4])
    blender.key("D", blender.middle(), shift=True)
    yield 0.5
    blender.key("RET", blender.middle())
    yield from blender.settle(10)
    note(blender, "copied")
    blender.shot("copied")
    blender.call(bpy.ops.digiclay.session_stop)
    yield from blender.stopped()
