"""Starts a session, forms a valley with G, undoes, redoes, pauses, rewinds, saves and loads, stops."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy


def script(blender: Any) -> Iterator[float | None]:
    """Do what a user does; every yield lets Blender work off the events."""
    yield from blender.empty_scene()
    yield from blender.add_paper_bed()
    yield from blender.open_sidebar()
    blender.key("HOME", blender.middle())
    yield None
    blender.look("added")
    blender.select(blender.fingertip())
    yield None
    yield from blender.grab((9, 0, 0), "X", steps=2)
    blender.look("dragged")
    blender.key("Z", blender.middle(), ctrl=True)
    yield 0.8
    blender.look("drag undone")
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from blender.settle()
    blender.look("started")
    yield from blender.grab((0, 0, -9), "Z", look_as="pressing")
    yield from blender.settle()
    blender.look("pressed")
    yield from blender.grab((22, 0, 0), "X", steps=8, look_as="drawing")
    yield from blender.settle()
    blender.look("drawn")
    blender.shot("session_ridge")
    yield from blender.grab((0, 0, 14), "Z")
    yield from blender.settle()
    blender.look("lifted")
    blender.shot("session_lifted")

    blender.key("Z", blender.middle(), ctrl=True)
    yield from blender.settle()
    blender.look("lift undone")
    blender.key("Z", blender.middle(), ctrl=True)
    yield from blender.settle()
    blender.look("draw undone")
    blender.shot("session_undone")
    blender.key("Z", blender.middle(), ctrl=True, shift=True)
    yield from blender.settle()
    blender.look("draw redone")
    blender.key("Z", blender.middle(), ctrl=True, shift=True)
    yield from blender.settle()
    blender.look("lift redone")

    blender.key("P", blender.middle())
    yield from blender.settle()
    blender.look("paused")
    yield from blender.settle()
    blender.look("paused later")
    blender.key("P", blender.middle(), shift=True)
    yield from blender.settle()
    blender.look("single step")
    blender.shot("session_paused")
    blender.key("P", blender.middle())
    yield from blender.settle()
    blender.look("resumed")
    blender.key("BACK_SPACE", blender.middle())
    yield from blender.settle()
    blender.look("rewound")
    blender.key("Z", blender.middle(), ctrl=True)
    yield from blender.settle()
    blender.look("rewinding undone")

    path = str(blender.OUT / "mid_session.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    blender.look("saved")
    yield None
    bpy.ops.wm.open_mainfile(filepath=path)
    yield from blender.settle()
    blender.look("loaded")
    blender.shot("session_loaded")
    blender.select(blender.beds()[0])
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from blender.settle()
    blender.look("going on")
    blender.key("ESC", blender.middle())
    yield from blender.settle()
    blender.look("stopped")
    blender.shot("session_stopped")
    for _ in range(3):
        blender.key("Z", blender.middle(), ctrl=True)
        yield 0.6
    blender.look("stop undone")
