"""Presets of a device: apply, save, remove; parts from a file; own control methods are loaded again."""

from dataclasses import replace
from pathlib import Path

from .. import preferences
from ..compat import Context, Event, Operator, OperatorProperties, bpy
from ..core.scene.scene_source import load, make_scene, read_parts
from ..core.scene.toml_table import PRESETS, tabulate
from ..roles import bed_of
from ..settings import own_folder, own_presets, properties
from ..settings.declared import text
from ..settings.devices import change_layout, find_first, resize
from ..settings.groups import PRESET_WORDS
from .action import Action, FileAction, Result, action, file_of, inform
from .poll_messages import cannot_change, no_bed, no_own_methods, no_own_preset


class ApplyPreset(Action, Operator):
    """Set the bed's parameters to those of a preset; its layout stays"""

    bl_idname = "digiclay.preset_apply"
    bl_label = "Apply Digital Clay Preset"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}
    needs = (cannot_change,)

    preset: text("Preset")

    @classmethod
    def description(cls, context: Context, chosen: OperatorProperties) -> str:
        """Return the description of the chosen preset."""
        return PRESET_WORDS.get(
            chosen.preset, "A preset of your own: every parameter but the layout"
        )

    def perform(self, context: Context) -> None:
        """Set the parameters; a session that runs on the bed goes on with them."""
        bed = bed_of(context)
        settings = bed.digiclay
        if self.preset in PRESETS:
            settings.preset, settings.own_preset = self.preset, ""
        else:
            layout = properties.read_scene(bed).layout
            properties.write_scene(bed, change_layout(load(own_presets.path(self.preset)), layout))
            settings.own_preset = self.preset


class SavePreset(Action, Operator):
    """Save the bed's parameters as a custom preset, for other beds and files"""

    bl_idname = "digiclay.preset_save"
    bl_label = "Save Digital Clay Preset"
    needs = (no_bed,)

    name: text(
        "Name", "Name of the preset; a preset of that name is replaced", maxlen=own_presets.LONGEST
    )

    def invoke(self, context: Context, event: Event) -> Result:
        self.name = bed_of(context).digiclay.own_preset
        return set(context.window_manager.invoke_props_dialog(self))

    def perform(self, context: Context) -> None:
        bed = bed_of(context)
        scene = properties.read_scene(bed)
        alone = replace(scene, name=self.name.strip(), fingers=scene.fingers[:1])
        file = own_presets.save(self.name, alone)
        bed.digiclay.own_preset = file.stem
        inform(self, "Saved as {}", file)


class RemovePreset(Action, Operator):
    """Remove the custom preset that was applied last"""

    bl_idname = "digiclay.preset_remove"
    bl_label = "Remove Digital Clay Preset"
    needs = cannot_change, no_own_preset

    def invoke(self, context: Context, event: Event) -> Result:
        return set(context.window_manager.invoke_confirm(self, event))

    def perform(self, context: Context) -> None:
        """Remove it; the bed keeps its parameters."""
        settings = bed_of(context).digiclay
        own_presets.remove(settings.own_preset)
        inform(self, "Removed the preset {}", settings.own_preset)
        settings.own_preset = ""


@action(
    "digiclay.preset_parts",
    "Device and Finger from File",
    cannot_change,
    bases=(FileAction,),
    **file_of("*.toml", "SKIP_SAVE"),
)
def take_parts(operator: Operator, context: Context) -> None:
    """Set the parameters of device and finger that a file has, such as fitted.toml; the others stay"""
    path, bed = Path(bpy.path.abspath(operator.filepath)), bed_of(context)
    scene = make_scene(None, tabulate(properties.read_scene(bed)), read_parts(path))
    tip = scene.fingers[0].fingertip
    if tip is not None:
        resize(find_first(bed), tip)  # a blister may follow
    blister = properties.read_scene(bed).blister
    properties.write_scene(bed, replace(scene, blister=blister))
    inform(operator, "Device and finger have the parameters of {}", path.name)


@action("digiclay.methods_reload", "Reload Methods", no_own_methods, options=(), in_any_mode=True)
def reload_methods(operator: Operator, context: Context) -> None:
    """Run the Python files of the folder of own control methods again; running sessions keep their method"""
    preferences.take_methods(preferences.get(context), context)
    present = own_folder.read_present()
    for line in present.refused:
        operator.report({"WARNING"}, line)
    inform(operator, "{} control methods loaded", len(present.names))
