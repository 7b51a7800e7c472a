"""Starts a session, forms a valley with G, undoes, redoes, pauses, rewinds, saves and loads, stops."""

from collections.abc import Iterator
from typing import Any

import bpy


def script(blender: Any) -> Iterator[float | None]:
    after, undo = blender.after, blender.undo
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
    yield from blender.start()
    blender.look("started")
    yield from blender.grab((0, 0, -9), "Z", look_as="pressing")
    yield from after("pressed")
    yield from blender.grab((22, 0, 0), "X", steps=8, look_as="drawing")
    yield from after("drawn")
    blender.shot("session_ridge")
    yield from blender.grab((0, 0, 14), "Z")
    yield from after("lifted")
    blender.shot("session_lifted")
    yield from undo("lift undone")
    yield from undo("draw undone")
    blender.shot("session_undone")
    yield from undo("draw redone", redo=True)
    yield from undo("lift redone", redo=True)

    yield from after("paused", "P")
    yield from after("paused later")
    yield from after("single step", "P", shift=True)
    blender.shot("session_paused")
    yield from after("resumed", "P")
    yield from after("rewound", "BACK_SPACE")
    yield from undo("rewinding undone")

    path = str(blender.OUT / "mid_session.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    blender.look("saved")
    yield None
    bpy.ops.wm.open_mainfile(filepath=path)
    yield from after("loaded")
    blender.shot("session_loaded")
    yield from blender.start(blender.beds()[0])
    blender.look("going on")
    yield from after("stopped", "ESC")
    blender.shot("session_stopped")
    for _ in range(3):
        blender.key("Z", blender.middle(), ctrl=True)
        yield 0.6
