"""Popovers in the header of the Press tool: stroke and pen."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..press.brush import tool_settings
from ..press.tool import draw_presets


class Popover:
    """Mixin of a panel that opens from the tool's header."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_ui_units_x = 12

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Show it while the tool is in hand."""
        return tool_settings(context) is not None

    def draw(self, context: Any) -> None:
        """Draw its settings in a column."""
        layout: Any = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = tool_settings(context)
        if settings is not None:
            self.draw_settings(layout.column(), settings)

    def draw_settings(self, column: Any, settings: Any) -> None:
        """Draw the tool's settings that it holds."""
        raise NotImplementedError


class StrokeOptions(Popover, bpy.types.Panel):
    """Path, stabilizer and symmetry of a stroke."""

    bl_label = "Stroke"
    bl_idname = "DIGICLAY_PT_press_stroke"

    def draw_settings(self, column: Any, settings: Any) -> None:
        draw_presets(column)  # a narrow header has them here alone
        column.prop(settings, "path")
        row = column.column()
        row.enabled = settings.path == "FREE"
        row.prop(settings, "stabilizer")
        column.prop(settings, "symmetry")


class PenOptions(Popover, bpy.types.Panel):
    """Effects of a pen's pressure and tilt."""

    bl_label = "Pen"
    bl_idname = "DIGICLAY_PT_press_pen"

    def draw_settings(self, column: Any, settings: Any) -> None:
        column.prop(settings, "use_pressure")
        row = column.column()
        row.enabled = settings.use_pressure
        row.prop(settings, "pressure_curve")
        column.prop(settings, "use_tilt")


CLASSES = (StrokeOptions, PenOptions)
