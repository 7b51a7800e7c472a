"""Header of the Press tool: what is set most often first, the rest in popovers; narrow windows show all."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live.stroke import Brush
from ..settings import finger_size
from .brush import amount_name, bed_in_use
from .fingers import find_kind

#: Width from which on a header names brushes and popovers in full, in pixels at a resolution scale of 1.
WIDE = 1000
#: Widths of what it holds, in Blender's units of 20 pixels.
BRUSH, SIZE, AMOUNT, STRENGTH = 4.6, 5.8, 6.6, 6.0


def draw_header(context: Any, layout: Any, settings: Any) -> None:
    """Draw the tool's settings into the header.

    `context` bpy.types.Context; `layout` bpy.types.UILayout; `settings` bpy.types.OperatorProperties.
    """
    wide = context.region.width >= WIDE * context.preferences.system.ui_scale
    row = layout.row(align=True)
    if wide:
        row.prop(settings, "brush", expand=True)
    else:
        row.ui_units_x = BRUSH
        row.prop(settings, "brush", text="")
    bed = bed_in_use(context)
    if bed is not None:
        row = layout.row(align=True)
        _number(row, bed.digiclay, "size", SIZE)
        row.prop(bed.digiclay, "blister_follows", text="", icon="LINKED")
    if Brush(settings.brush).has_amount:
        _number(layout, settings, amount_name(Brush(settings.brush)), AMOUNT)
    _number(layout, settings, "strength", STRENGTH)
    if bed is not None:
        kind = find_kind(finger_size.read_finger(bed.digiclay))
        words = (kind.label if kind else "Finger") if wide else ""
        layout.menu("DIGICLAY_MT_fingers", text=words, icon="NONE" if wide else "VIEW_PAN")
    layout.popover("DIGICLAY_PT_press_stroke", text="Stroke" if wide else "", icon="CURVE_BEZCURVE")
    layout.popover("DIGICLAY_PT_press_pen", text="Pen" if wide else "", icon="STYLUS_PRESSURE")
    if wide:
        draw_presets(layout)
    layout.operator("digiclay.skin_toggle", text="", icon="SURFACE_DATA")


def draw_presets(layout: Any) -> None:
    """Draw the menu of brush presets, and what keeps and removes one. `layout` bpy.types.UILayout."""
    row = layout.row(align=True)
    row.menu("DIGICLAY_MT_brushes", text=bpy.types.DIGICLAY_MT_brushes.bl_label)
    row.operator("digiclay.press_brush_save", text="", icon="ADD")
    row.operator("digiclay.press_brush_save", text="", icon="REMOVE").remove_active = True


def _number(layout: Any, owner: Any, name: str, units: float) -> None:
    """Draw a number no wider than it needs."""
    row = layout.row(align=True)
    row.ui_units_x = units
    row.prop(owner, name)
