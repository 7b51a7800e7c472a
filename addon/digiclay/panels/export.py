"""Panel Export: the features of what was formed, and the ways it leaves the bed."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..exchange import formed_bed
from .base import Panel, bed_of

__all__ = ["CLASSES", "Export"]

#: Property of a bed that holds the list of its features; the operator that lists them writes it.
LISTED = "digiclay_features"
#: Lines shown of a long list.
MOST = 24


class Export(Panel, bpy.types.Panel):  # type: ignore[misc]
    """What was formed, as meshes."""

    bl_idname = "DIGICLAY_PT_export"
    bl_label = "Export"
    bl_order = 80
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: Any) -> None:
        """Draw the list of features, and what can be done."""
        bed, layout = bed_of(context), self.layout
        column = layout.column(align=True)
        column.operator("digiclay.find_features", icon="VIEWZOOM")
        lines = str(bed.get(LISTED, "")).splitlines()
        if lines:
            listed = column.box().column(align=True)
            listed.scale_y = 0.8
            for line in lines[:MOST]:
                listed.label(text=line)
            if len(lines) > MOST:
                listed.label(text="...")
        kept = formed_bed.is_kept(bed)
        column = layout.column(align=True)
        column.label(text="Measured from the kept surface" if kept else "Measured from the bed at rest")
        row = column.row(align=True)
        row.operator("digiclay.keep_surface")
        row.operator("digiclay.forget_surface")
        column = layout.column(align=True)
        column.operator_menu_enum("mesh.digital_clay_make", "kind", text="Make Mesh", icon="MESH_DATA")
        column.menu("DIGICLAY_MT_export", text="Export", icon="EXPORT")


CLASSES = (Export,)
