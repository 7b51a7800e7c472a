"""Popovers in the header of the Press tool: stroke and pen."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from ..compat import Context, OperatorProperties, UILayout, bpy
from ..press import brush_presets
from ..press.brush import EXTREMES, tool_settings
from ..press.tool import draw_curves, draw_presets
from ..strokes.nominal import LIMITS
from ..strokes.stroke import COMBINATIONS, LOCKS, STAMPS, Brush
from .base import declare


def popover(
    idname: str, label: str, width: int = 12
) -> Callable[[Callable[[UILayout, Context], None]], Any]:
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
            bl_ui_units_x=width,
            poll=classmethod(lambda cls, context: tool_settings(context) is not None),
        )(wraps(draw_settings)(draw))

    return make


@popover("DIGICLAY_PT_press_stroke", "Stroke")
def stroke_options(column: UILayout, settings: OperatorProperties) -> None:
    """Path, symmetry and form of a stroke; gray is what its brush does without."""
    brush = Brush(settings.brush)
    draw_presets(column)  # a narrow header has them here alone
    column.separator()
    column.prop(settings, "path")
    _draw(column, settings, "stabilizer", enabled=settings.path == "FREE")
    column.prop(settings, "project")
    column.separator()
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
    column.separator()
    _draw(column, settings, "falloff", enabled=brush not in STAMPS)
    _draw(column, settings, "accumulate", enabled=brush not in (*LOCKS, *STAMPS))
    _draw(column, settings, "combine", enabled=brush in COMBINATIONS and brush not in EXTREMES)
    column.operator("digiclay.press_base", icon="FILE_REFRESH")
    column.separator()
    column.prop(settings, "use_limit")
    if settings.use_limit:
        column.prop(settings, "limit_low")
        column.prop(settings, "limit_high")
    _draw(column, settings, "finish", enabled=brush in LIMITS)
    column.separator()
    draw_curves(column)


def _draw(column: UILayout, settings: OperatorProperties, name: str, *, enabled: bool) -> None:
    """Draw a setting, gray unless it is of use."""
    row = column.column()
    row.enabled = enabled
    row.prop(settings, name)


#: Columns of presets, and height of a picture, in Blender's units.
COLUMNS, PICTURE = 3, 5.0


@popover("DIGICLAY_PT_press_presets", "Presets", 20)
def presets(column: UILayout, settings: OperatorProperties) -> None:
    """Brush presets that come along, then the user's own; what keeps one, and removes that applied last."""
    grid = column.grid_flow(row_major=True, columns=COLUMNS, even_columns=True)
    folders = map(Path, bpy.utils.preset_paths(brush_presets.SUBFOLDER))
    for file in (file for folder in folders for file in sorted(folder.glob("*.py"))):
        entry = grid.column(align=True)
        # One that cannot be read has no picture, and says why when it is chosen.
        entry.template_icon(brush_presets.find_icon(file, settings), scale=PICTURE)
        words = bpy.path.display_name(file.stem, title_case=False)
        entry.operator("digiclay.press_brush", text=words).filepath = str(file)
    row = column.row(align=True)
    row.operator("digiclay.press_brush_save", text="Save", icon="ADD")
    row.operator("digiclay.press_brush_save", text="Remove", icon="REMOVE").remove_active = True


@popover("DIGICLAY_PT_press_pen", "Pen")
def pen_options(column: UILayout, settings: OperatorProperties) -> None:
    """Effects of a pen's pressure and tilt."""
    column.prop(settings, "use_pressure")
    _draw(column, settings, "pressure_curve", enabled=settings.use_pressure)
    column.prop(settings, "use_tilt")


CLASSES = (stroke_options, presets, pen_options)
