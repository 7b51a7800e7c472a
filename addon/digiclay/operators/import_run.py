"""File > Import > Digital Clay run: one instant of a run as a bed."""

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.scene.scene_source import load
from ..device.instant import read
from .action import FileAction
from .add_bed import Placed, add_shown


class ImportRun(Placed, FileAction, bpy.types.Operator):
    """Show one instant of a Digital Clay run as a bed of pins"""

    bl_idname = "import_scene.digital_clay_run"
    bl_label = "Import Digital Clay Run"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_PRESET"})
    filter_glob: bpy.props.StringProperty(default="*.npz", options={"HIDDEN"})
    row: bpy.props.IntProperty(
        name="Row",
        description="Recorded row to show: 0 is the first, -1 the last",
        default=-1,
    )

    def perform(self, context: Any) -> None:
        """Read the run and build the bed at the 3D cursor."""
        path = Path(bpy.path.abspath(self.filepath))
        instant, scene = read(path, self.row), load(path.with_name("scene.toml"))
        bed = add_shown(context, scene, instant)
        self.place(context, bed)


def entry(menu: Any, context: Any) -> None:
    """Draw the entry in File > Import. `menu` bpy.types.Menu; `context` bpy.types.Context."""
    menu.layout.operator(ImportRun.bl_idname, text="Digital Clay run (.npz)")
