"""Panel Shapes: what the bed displays before the finger comes, and what it becomes."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from .base import Panel, bed_of

__all__ = ["CLASSES", "Shapes"]


class Shapes(Panel, bpy.types.Panel):  # type: ignore[misc]
    """A shape in, clay, the finger, a shape out."""

    bl_idname = "DIGICLAY_PT_shapes"
    bl_label = "Shapes"
    bl_order = 60
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Draw the ways in, what is displayed, and the way out."""
        settings = bed_of(context).digiclay
        column = self.layout.column(align=True)
        column.operator("digiclay.shape_from_object", icon="OBJECT_DATA")
        column.operator_context = "INVOKE_DEFAULT"
        column.operator("digiclay.shape_from_file", text="Shape from File...", icon="FILE_FOLDER")
        column.operator_menu_enum("digiclay.shape_sample", "sample", text="Sample Shape", icon="RNDCURVE")
        if not settings.use_shape:
            self.layout.label(text="No shape: sessions begin at rest", icon="INFO")
        else:
            self._displayed(settings)
        column = self.layout.column(align=True)
        column.operator("digiclay.shape_keep", icon="PINNED")
        column.operator("mesh.digital_clay_make", icon="OUTLINER_OB_MESH")

    def _displayed(self, settings: Any) -> None:
        """Draw what is displayed, and how the surface gets there."""
        shape, box = settings.shape, self.layout.box()
        row = box.row()
        row.label(text=shape.file or "Formed", icon="RNDCURVE")
        row.operator("digiclay.shape_remove", text="", icon="X")
        column = box.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(shape, "refresh")
        if shape.refresh != "one_time":
            column.prop(shape, "surfaces")


CLASSES = (Shapes,)
