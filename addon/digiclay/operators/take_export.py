"""Write a take as a scene file that `digiclay run` simulates; and throw a take away."""

# No postponed annotations here: Blender reads an operator's properties from them.
from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..core.scene_table import text
from ..core.take import as_scene
from ..core.whole_files import write_whole
from ..device.view import bed_of
from ..recorded import takes
from .reasons import allowed, no_bed, no_take

__all__ = ["ExportTake", "RemoveTake"]


class ExportTake(bpy.types.Operator):  # type: ignore[misc]
    """Write a take as a scene file for `digiclay run`"""

    bl_idname = "digiclay.take_export"
    bl_label = "Export Take"
    bl_options = {"REGISTER"}  # noqa: RUF012

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})  # type: ignore[valid-type]
    take: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Take", description="Number of the take; empty: the last one"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed with a take is needed."""
        return allowed(cls, no_bed(context) or no_take(context))

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the file, named after the take."""
        bed = bed_of(context)
        number = self.take or takes.entries(bed)[-1].number
        name = next((one.name for one in takes.entries(bed) if one.number == number), "take")
        self.filepath = bpy.path.clean_name(name) + ".toml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Write it."""
        bed = bed_of(context)
        try:
            number = self.take or takes.last(bed)
            take = takes.read(bed, number)
            name = next(one.name for one in takes.entries(bed) if one.number == number)
            # A point in the name is not where an ending begins: "ridge 1.5" is no "ridge 1".
            file = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".toml"))
            write_whole(file, text(as_scene(take, name)).encode())
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{name} written to {file}")
        return {"FINISHED"}


class RemoveTake(bpy.types.Operator):  # type: ignore[misc]
    """Throw a take away"""

    bl_idname = "digiclay.take_remove"
    bl_label = "Remove Take"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    take: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Take", description="Number of the take; empty: the last one"
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed with a take is needed."""
        return allowed(cls, no_bed(context) or no_take(context))

    def execute(self, context: Any) -> set[str]:
        """Remove it."""
        bed = bed_of(context)
        try:
            takes.remove(bed, self.take or takes.last(bed))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}
