"""What can be active, and what can have become of a bed: a row is a name and what is done to a new bed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from digiclay.device import view

__all__ = ["ODD"]


def activate(thing: Any) -> None:
    """Make an object active, and it alone selected."""
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = thing
    if thing is not None:
        thing.select_set(True)


def join(bed: Any) -> None:
    """Join the cube into the bed."""
    bpy.data.objects["Cube"].select_set(True)
    bpy.ops.object.join()


def dissolve(bed: Any) -> None:
    """Delete all pins in Edit Mode."""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.delete(type="VERT")


ODD: dict[str, Callable[[Any], object]] = {
    "a bed": lambda bed: None,
    "its fingertip": lambda bed: activate(view.fingertip_of(bed)),
    "nothing": lambda bed: activate(None),
    "another mesh": lambda bed: activate(bpy.data.objects["Cube"]),
    "a light": lambda bed: activate(bpy.data.objects["Light"]),
    "no bed in the file": lambda bed: bpy.ops.wm.read_homefile(use_empty=True),
    "a linked duplicate": lambda bed: bpy.ops.object.duplicate(linked=True),
    "a bed edited": lambda bed: bpy.ops.object.mode_set(mode="EDIT"),
    "its pins edited by another bed": lambda bed: (
        bpy.ops.object.duplicate(linked=True), bpy.ops.object.mode_set(mode="EDIT"),
        setattr(bpy.context.view_layer.objects, "active", bed),
    ),
    "a bed sculpted": lambda bed: bpy.ops.object.mode_set(mode="SCULPT"),
    "a bed painted": lambda bed: bpy.ops.object.mode_set(mode="VERTEX_PAINT"),
    "a bed weighted": lambda bed: bpy.ops.object.mode_set(mode="WEIGHT_PAINT"),
    "another mesh edited": lambda bed: (
        activate(bpy.data.objects["Cube"]), bpy.ops.object.mode_set(mode="EDIT"),
    ),
    "a bed whose pins were deleted": dissolve,
    "a bed without vertices": lambda bed: bed.data.clear_geometry(),
    "a bed of another mesh": lambda bed: setattr(bed, "data", bpy.data.meshes["Cube"]),
    "a bed without an attribute": lambda bed: bed.data.attributes.remove(bed.data.attributes["mode"]),
    "a bed converted to points": lambda bed: (activate(bed), bpy.ops.object.convert(target="POINTCLOUD")),
    "a bed converted as it is drawn": lambda bed: (activate(bed), bpy.ops.object.convert(target="MESH")),
    "a bed joined with a cube": join,
    "a bed without geometry nodes": lambda bed: bed.modifiers.clear(),
    "a bed without a fingertip": lambda bed: bpy.data.objects.remove(view.fingertip_of(bed)),
    "a bed whose fingertip has no parent": lambda bed: setattr(view.fingertip_of(bed), "parent", None),
    "a bed hidden": lambda bed: bed.hide_set(True),
    "a bed stretched": lambda bed: setattr(bed, "scale", (1.0, 2.0, 1.0)),
    "a bed mirrored": lambda bed: setattr(bed, "scale", (-1.0, 1.0, 1.0)),
    "a bed scaled to nothing": lambda bed: setattr(bed, "scale", (0.0, 0.0, 0.0)),
    "a bed deleted": lambda bed: bpy.data.objects.remove(bed),
}  # fmt: skip
