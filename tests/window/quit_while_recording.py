"""Closes a file in mid-recording: by loading another, by saving it first, and by quitting Blender."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy


def script(blender: Any) -> Iterator[float | None]:
    """Record, and let the file go away, three times."""
    yield from recorded(blender)
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    blender.look("loaded")
    yield from blender.open_sidebar()
    blender.shot("closed_file")
    left = blender.part("live.handlers").file_path()
    bpy.ops.wm.recover_auto_save("EXEC_DEFAULT", filepath=str(left))
    yield 1.0
    blender.SEEN["recovered"] = takes(blender)

    yield from recorded(blender)
    left.unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(blender.OUT / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "saved.blend"))
    yield 1.0
    blender.SEEN["saved before"] = takes(blender)
    blender.SEEN["left although saved"] = left.exists()

    yield from recorded(blender)
    blender.hand_over()
    bpy.ops.wm.quit_blender()  # with the session on: nobody disables the extension before
    yield 60.0


def recorded(blender: Any) -> Iterator[float | None]:
    """Have the session of a bed, a new one if there is none, record for a moment."""
    if not blender.beds():
        blender.call(bpy.ops.mesh.digital_clay_add, rows=9, columns=9)
    blender.select(blender.beds()[0])
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    yield from blender.settle()
    blender.call(bpy.ops.digiclay.take_record)
    yield from blender.settle()


def takes(blender: Any) -> list[str]:
    """Return the names of the bed's takes."""
    return [entry.name for entry in blender.part("recorded.takes").list_takes(blender.beds()[0])]
