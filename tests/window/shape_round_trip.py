"""Displays a sample shape and an object, presses the finger into it live, and keeps what was formed."""

from collections.abc import Iterator
from typing import Any

import bpy


def script(blender: Any) -> Iterator[float | None]:
    yield from blender.empty_scene()
    yield from blender.add_paper_bed()
    yield from blender.open_sidebar()
    blender.key("HOME", blender.middle())
    yield None
    blender.select(blender.beds()[0])
    blender.look("added")
    blender.call(bpy.ops.digiclay.shape_sample, "EXEC_DEFAULT", True, sample="ripple", rise=12.0)
    yield None
    blender.look("displayed")
    blender.call(bpy.ops.wm.call_panel, "INVOKE_DEFAULT", name="DIGICLAY_PT_shapes")
    yield None
    blender.shot("shape_panel")
    blender.key("ESC", blender.middle())
    yield None

    yield from blender.start(blender.fingertip())
    blender.look("started")
    yield from blender.grab((0, 0, -10), "Z", look_as="pressing")
    yield from blender.settle()
    blender.shot("shape_pressed")
    yield from blender.grab((0, 0, 25), "Z")
    yield from blender.settle()
    blender.key("ESC", blender.middle())
    yield None
    yield None
    blender.look("formed")
    blender.call(bpy.ops.digiclay.shape_keep, "EXEC_DEFAULT", True)
    yield None
    blender.SEEN["kept"] = len(blender.beds()[0].digiclay.shape.heights)
    blender.call(bpy.ops.mesh.digital_clay_make, "EXEC_DEFAULT", True, kind="solid", beside=False)
    yield None
    mesh = blender.window().view_layer.objects.active
    blender.SEEN["mesh"] = max(vertex.co.z for vertex in mesh.data.vertices) / blender.part("bridge").SCALE
    blender.key("Z", blender.middle(), ctrl=True)
    yield None

    blender.key("Z", blender.middle(), ctrl=True)
    yield None
    blender.SEEN["keeping undone"] = blender.beds()[0].digiclay.shape.file

    blender.call(bpy.ops.wm.call_menu, "INVOKE_DEFAULT", name="DIGICLAY_MT_samples")
    yield None
    blender.shot("sample_menu")
    blender.key("ESC", blender.middle())
    yield None
    blender.call(bpy.ops.digiclay.add_sample, "EXEC_DEFAULT", True, sample="session:signature")
    yield None
    blender.key("HOME", blender.middle())
    yield None
    blender.shot("sample_signature")
    blender.SEEN["beds"] = len(blender.beds())
    blender.key("Z", blender.middle(), ctrl=True)
    yield None
    blender.SEEN["beds after undo"] = len(blender.beds())
