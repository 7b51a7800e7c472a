"""Popovers in the header of the Press tool: stroke and pen."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from ..compat import Context, OperatorProperties, UILayout, bpy
from ..press.brush import tool_settings
from ..press.tool import draw_curves, draw_presets
from .base import declare


def popover(idname: str, label: str) -> Callable[[Callable[[UILayout, Context], None]], Any]:
    """Return a decorator that makes a panel, opened from the tool's header, of what draws its settings."""

    def make(draw_settings: Callable[[UILayout, Context], None]) -> Any:
        def draw(panel: bpy.types.Panel, context: Context) -> None:
            panel.layout.use_property_split = True
            panel.layout.use_property_decorate = False
            settings = tool_settings(context)
            if settings is not None:
                draw_settings(panel.layout.column(), settings)

        return declare(
            (bpy.types.Panel,),
            "draw",
            idname,
            label,
            bl_space_type="VIEW_3D",
            bl_region_type="HEADER",
            bl_ui_units_x=12,
            poll=classmethod(lambda cls, context: tool_settings(context) is not None),
        )(wraps(draw_settings)(draw))

    return make


@popover("DIGICLAY_PT_press_stroke", "Stroke")
def stroke_options(column: UILayout, settings: OperatorProperties) -> None:
    """Path, stabilizer and symmetry of a stroke."""
    draw_presets(column)  # a narrow header has them here alone
    column.prop(settings, "path")
    row = column.column()
    row.enabled = settings.path == "FREE"
    row.prop(settings, "stabilizer")
    column.prop(settings, "project")
    column.prop(settings, "symmetry")
    if settings.symmetry == "RADIAL":
        column.prop(settings, "radial")
    if settings.symmetry != "NONE":
        column.prop(settings, "center_x")
        column.prop(settings, "center_y")
        if settings.symmetry != "RADIAL":
            column.prop(settings, "axis")
    # From a popover an operator would be called in the header.
    column.operator_context = "INVOKE_REGION_WIN"
    column.operator("digiclay.press_center", icon="PIVOT_CURSOR")
    column.prop(settings, "falloff")
    column.prop(settings, "accumulate")
    column.operator("digiclay.press_base", icon="FILE_REFRESH")
    column.prop(settings, "combine")
    column.prop(settings, "use_limit")
    if settings.use_limit:
        column.prop(settings, "limit_low")
        column.prop(settings, "limit_high")
    column.prop(settings, "finish")
    draw_curves(column)


@popover("DIGICLAY_PT_press_pen", "Pen")
def pen_options(column: UILayout, settings: OperatorProperties) -> None:
    """Effects of a pen's pressure and tilt."""
    column.prop(settings, "use_pressure")
    row = column.column()
    row.enabled = settings.use_pressure
    row.prop(settings, "pressure_curve")
    column.prop(settings, "use_tilt")


CLASSES = (stroke_options, pen_options)
