"""File > Import > Digital Clay run: one instant of a finished run as a bed."""

# No postponed annotations here: Blender reads an operator's properties from them.
from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..core.scene_file import load
from ..device.instant import read
from .add_bed import add_shown, select_only, stand_at_cursor

__all__ = ["ImportRun", "entry"]


class ImportRun(bpy.types.Operator):  # type: ignore[misc]
    """Show one instant of a finished Digital Clay run as a bed of pins"""

    bl_idname = "import_scene.digital_clay_run"
    bl_label = "Import Digital Clay Run"
    bl_options = {"REGISTER", "UNDO", "PRESET"}  # noqa: RUF012

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_PRESET"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.npz", options={"HIDDEN"})  # type: ignore[valid-type]
    row: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Row",
        description="Which recorded row to show: 0 is the start, -1 the last one",
        default=-1,
    )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Read the run and build the bed at the 3D cursor."""
        try:
            path = Path(bpy.path.abspath(self.filepath))
            instant, scene = read(path, self.row), load(path.with_name("scene.toml"))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        bed = add_shown(context, scene, instant)
        stand_at_cursor(context, bed)
        select_only(context, bed)
        return {"FINISHED"}


def entry(menu: Any, context: Any) -> None:
    """Draw the entry in File > Import."""
    menu.layout.operator(ImportRun.bl_idname, text="Digital Clay run (.npz)")
