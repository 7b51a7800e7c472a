"""Brush presets: menu, and operators that apply, save and remove one."""

from typing import Any

from bl_operators.presets import AddPresetBase  # type: ignore[import-not-found]

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..press import brush, brush_presets
from .action import Action, Polled
from .radial import no_tool


class ApplyBrush(Action, bpy.types.Operator):
    """Set fingertip, brush, stroke and symmetry of the Press tool to those of a preset"""

    bl_idname = "digiclay.press_brush"
    bl_label = "Brush Preset"
    bl_options = {"UNDO", "INTERNAL"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    menu_idname: bpy.props.StringProperty(default="DIGICLAY_MT_brushes", options={"SKIP_SAVE"})

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The Press tool is needed, and a bed."""
        return no_tool(context)

    def perform(self, context: Any) -> None:
        """Apply it."""
        try:
            bpy.ops.script.execute_preset(filepath=self.filepath, menu_idname=self.menu_idname)
        except RuntimeError as error:  # what Blender says of the file
            raise DigiclayError(str(error).removeprefix("Error: ").strip()) from None


class BrushMenu(bpy.types.Menu):
    """Brush presets that come along, then the user's own."""

    bl_idname = "DIGICLAY_MT_brushes"
    bl_label = "Presets"
    preset_subdir = brush_presets.SUBFOLDER
    preset_operator = ApplyBrush.bl_idname
    draw = bpy.types.Menu.draw_preset


class SaveBrush(AddPresetBase, Polled, bpy.types.Operator):
    """Save fingertip, brush, stroke and symmetry as a preset, or remove the one applied last"""

    bl_idname = "digiclay.press_brush_save"
    bl_label = "Save Brush Preset"
    preset_menu = BrushMenu.bl_idname
    preset_subdir = brush_presets.SUBFOLDER
    preset_defines = brush_presets.DEFINES

    @property
    def preset_values(self) -> list[str]:
        """What is kept."""
        return brush_presets.preset_values(brush.tool_settings(bpy.context))

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The Press tool is needed, and a bed."""
        return no_tool(context)
