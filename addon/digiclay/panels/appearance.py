"""Sub-panel Display: colors, arrows, and content of the overlay."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..device import display, form, view
from ..ui_text import localize
from .base import Panel, bed_of, draw_number, is_edited


class Display(Panel, bpy.types.Panel):
    """Display of the bed; a disabled item takes no time."""

    bl_label = "Display"
    bl_idname = "DIGICLAY_PT_display"
    bl_order = 30

    def draw(self, context: Any) -> None:
        """Draw the panel."""
        bed, layout = bed_of(context), self.layout
        layout.enabled = not is_edited(context)
        layout.use_property_split = True
        layout.use_property_decorate = False
        shown, drawn = bed.digiclay_display, view.is_drawn(bed)
        if not drawn:
            layout.label(text="The bed's geometry nodes were removed", icon="ERROR")
        column = layout.column()
        column.enabled = drawn
        skin = column.column()
        skin.enabled = form.can_show_skin(bed)
        skin.row().prop(shown, "form")
        row = skin.row()
        row.active = shown.form != "pins"
        row.prop(shown, "skin", expand=True)
        column.row().prop(shown, "color", expand=True)
        row = column.row()
        row.active = shown.color == "force"
        draw_number(row, shown, "top_force")
        column.prop(shown, "arrows")
        row = column.row()
        row.active = shown.arrows
        draw_number(row, shown, "arrow_length")
        layout.prop(shown, "overlay")
        column = layout.column()
        column.active = shown.overlay
        column.prop(shown, "overlay_full")
        row = column.row()
        row.active = shown.overlay_full
        draw_number(row, shown, "seconds")
        pins = ", ".join(str(pin) for pin in display.picked_pins(bed))
        column.label(text=localize("Picked pins: {}", pins or localize("none")))
        row = column.row(align=True)
        row.operator("digiclay.pick_pins")
        row.operator("digiclay.clear_pins")


CLASSES = (Display,)
