"""Presets of the Press tool: fingers and brushes."""

from typing import Any

from bl_operators.presets import AddPresetBase  # type: ignore[import-not-found]

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..panels.base import menu
from ..press import brush
from ..press.brush import FINGERS
from ..settings import finger_size
from ..settings.declared import choice
from ..ui_text import localize
from .action import Action, Polled
from .poll_messages import no_finger, no_tool_in_view


class TakeFinger(Action, bpy.types.Operator):
    """Give the fingertip the form of a finger, a palm or a tool; its blister follows"""

    bl_idname = "digiclay.press_finger"
    bl_label = "Preset Finger"
    bl_options = {"REGISTER", "UNDO"}
    needs = (no_finger,)

    kind: choice(
        "Finger", "Form and size of the fingertip",
        items=[(name, kind.label, kind.source) for name, kind in FINGERS.items()],
    )  # fmt: skip

    @classmethod
    def description(cls, context: Any, chosen: Any) -> str:
        """Return measures and source of the chosen finger."""
        kind = FINGERS[chosen.kind]
        axes = (kind.finger.length, kind.finger.width, kind.finger.height)
        measures = " × ".join(f"{2e3 * axis:g}" for axis in axes)
        return localize("{} mm: {}. The blister follows, the contact law stays", measures, kind.source)

    def perform(self, context: Any) -> None:
        bed: Any = brush.bed_in_use(context)
        finger_size.resize(bed.digiclay, FINGERS[self.kind].finger)


@menu("DIGICLAY_MT_fingers", "Finger")
def fingers(entries: Any, context: Any) -> None:
    """Preset fingers."""
    for name, kind in FINGERS.items():
        entries.layout.operator(TakeFinger.bl_idname, text=kind.label).kind = name


class ApplyBrush(Action, bpy.types.Operator):
    """Set fingertip, brush, stroke and symmetry of the Press tool to those of a preset"""

    bl_idname = "digiclay.press_brush"
    bl_label = "Brush Preset"
    bl_options = {"UNDO", "INTERNAL"}
    needs = no_tool_in_view, no_finger

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    menu_idname: bpy.props.StringProperty(default="DIGICLAY_MT_brushes", options={"SKIP_SAVE"})

    def perform(self, context: Any) -> None:
        try:
            bpy.ops.script.execute_preset(filepath=self.filepath, menu_idname=self.menu_idname)
        except RuntimeError as error:  # what Blender says of the file
            raise DigiclayError(str(error).removeprefix("Error: ").strip()) from None


class BrushMenu(bpy.types.Menu):
    """Brush presets that come along, then the user's own."""

    bl_idname = "DIGICLAY_MT_brushes"
    bl_label = "Presets"
    preset_subdir = brush.SUBFOLDER
    preset_operator = ApplyBrush.bl_idname
    draw = bpy.types.Menu.draw_preset


class SaveBrush(AddPresetBase, Polled, bpy.types.Operator):
    """Save fingertip, brush, stroke and symmetry as a preset, or remove the one applied last"""

    bl_idname = "digiclay.press_brush_save"
    bl_label = "Save Brush Preset"
    needs = no_tool_in_view, no_finger
    preset_menu = BrushMenu.bl_idname
    preset_subdir = brush.SUBFOLDER
    preset_defines = brush.DEFINES

    @property
    def preset_values(self) -> list[str]:
        """What the preset stores."""
        return brush.preset_values(brush.tool_settings(bpy.context))
