"""What is formed becomes the bed's shape; and a bed's shape is taken away again."""

# No postponed annotations here: Blender reads an operator's properties from them.
from dataclasses import replace
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.errors import DigiclayError
from ..core.shape import Shape
from ..core.shape_text import packed
from ..device.view import bed_of
from ..settings import properties
from .reasons import allowed, no_bed, session_runs

__all__ = ["KeepShape", "RemoveShape"]


class KeepShape(bpy.types.Operator):  # type: ignore[misc]
    """Make what is formed the bed's shape: sessions begin with it, elastic and viscous beds go back to it"""

    bl_idname = "digiclay.shape_keep"
    bl_label = "Keep Formed as Shape"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed without a running session is needed."""
        return allowed(cls, no_bed(context) or session_runs(context))

    def execute(self, context: Any) -> set[str]:
        """Keep the heights."""
        bed = bed_of(context)
        try:
            scene = properties.scene_of(bed)
            heights = bridge.read_cells(bed.data)["height"]
            before = scene.shape or Shape()
            shape = replace(before, file="Formed", fit="placed", heights=packed(heights))
            properties.adopt(bed, replace(scene, shape=shape))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{bed.name} has a shape of {heights.size} heights: sessions begin with it")
        return {"FINISHED"}


class RemoveShape(bpy.types.Operator):  # type: ignore[misc]
    """Take the bed's shape away: sessions begin at rest; what is formed stays until then"""

    bl_idname = "digiclay.shape_remove"
    bl_label = "Remove Shape"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed with a shape is needed, and no running session."""
        return allowed(cls, no_bed(context) or session_runs(context) or _no_shape(context))

    def execute(self, context: Any) -> set[str]:
        """Forget it."""
        settings = bed_of(context).digiclay
        settings.use_shape = False
        settings.shape.heights = ""
        settings.shape.file = Shape().file
        return {"FINISHED"}


def _no_shape(context: Any) -> str:
    """The bed displays nothing."""
    return "" if bed_of(context).digiclay.use_shape else "The bed has no shape"
