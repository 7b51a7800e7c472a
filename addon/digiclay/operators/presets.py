"""Presets of a device: apply, save, remove; own control methods are loaded again."""

from dataclasses import replace
from typing import Any

from .. import preferences
from ..compat import bpy
from ..core.scene.scene_source import load
from ..core.scene.toml_table import PRESETS
from ..device.view import bed_of
from ..settings import own_folder, own_presets, properties
from ..settings.devices import change_layout
from ..settings.groups import PRESET_WORDS
from ..ui_text import localize
from .action import Action
from .poll_messages import no_bed


class ApplyPreset(Action, bpy.types.Operator):
    """Set the bed's parameters to those of a preset; its layout stays"""

    bl_idname = "digiclay.preset_apply"
    bl_label = "Apply Digital Clay Preset"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    preset: bpy.props.StringProperty(name="Preset")

    @classmethod
    def description(cls, context: Any, chosen: Any) -> str:
        """Return the description of the preset.

        `context` bpy.types.Context; `chosen` bpy.types.OperatorProperties, the operator's settings.
        """
        return PRESET_WORDS.get(chosen.preset, "A preset of your own: every parameter but the layout")

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed; a session that runs on it goes on with the new parameters."""
        return no_bed(context)

    def perform(self, context: Any) -> None:
        """Set the parameters."""
        bed = bed_of(context)
        settings = bed.digiclay
        if self.preset in PRESETS:
            settings.preset, settings.own_preset = self.preset, ""
        else:
            layout = properties.read_scene(bed).layout
            properties.write_scene(bed, change_layout(load(own_presets.path(self.preset)), layout))
            settings.own_preset = self.preset


class SavePreset(Action, bpy.types.Operator):
    """Save the bed's parameters as a custom preset, for other beds and files"""

    bl_idname = "digiclay.preset_save"
    bl_label = "Save Digital Clay Preset"

    name: bpy.props.StringProperty(
        name="Name",
        description="Name of the preset; a preset of that name is replaced",
        maxlen=own_presets.LONGEST,
    )

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed."""
        return no_bed(context)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the dialog for the name."""
        self.name = bed_of(context).digiclay.own_preset
        result: set[str] = context.window_manager.invoke_props_dialog(self)
        return result

    def perform(self, context: Any) -> None:
        """Save it."""
        bed = bed_of(context)
        file = own_presets.save(self.name, replace(properties.read_scene(bed), name=self.name.strip()))
        bed.digiclay.own_preset = file.stem
        self.report({"INFO"}, localize("Saved as {}", file))


class RemovePreset(Action, bpy.types.Operator):
    """Remove the custom preset that was applied last"""

    bl_idname = "digiclay.preset_remove"
    bl_label = "Remove Digital Clay Preset"

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A preset of the user's own must be the bed's: the core's cannot be removed."""
        return no_bed(context) or _no_own_preset(context)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Make sure."""
        result: set[str] = context.window_manager.invoke_confirm(self, event)
        return result

    def perform(self, context: Any) -> None:
        """Remove it; the bed keeps its parameters."""
        settings = bed_of(context).digiclay
        own_presets.remove(settings.own_preset)
        self.report({"INFO"}, localize("Removed the preset {}", settings.own_preset))
        settings.own_preset = ""


def _no_own_preset(context: Any) -> str:
    """The bed's parameters are of no preset of the user's own."""
    own = bed_of(context).digiclay.own_preset in own_presets.names()
    return "" if own else "Apply a preset of your own first: those that come along cannot be removed"


class ReloadMethods(Action, bpy.types.Operator):
    """Run the Python files of the folder of own control methods again; running sessions keep their method"""

    bl_idname = "digiclay.methods_reload"
    bl_label = "Reload Methods"
    in_any_mode = True

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The preferences must allow code of the folder."""
        return "" if preferences.get(context).run_own_methods else "Turn on Run Own Methods first"

    def perform(self, context: Any) -> None:
        """Run them."""
        preferences.take_methods(preferences.get(context), context)
        found = own_folder.read_present()
        for line in found.refused:
            self.report({"WARNING"}, line)
        self.report({"INFO"}, localize("{} control methods loaded", len(found.names)))
