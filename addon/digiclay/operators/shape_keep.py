"""Formed surface as the bed's shape; removal of a bed's shape."""

from dataclasses import replace
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.shapes.fitting import pack
from ..core.shapes.request import Shape
from ..device.view import bed_of
from ..settings import properties
from ..ui_text import localize
from .action import Action
from .poll_messages import no_bed, session_runs


class KeepShape(Action, bpy.types.Operator):
    """Make the formed surface the bed's shape: sessions begin with it, elastic and viscous beds keep to it"""

    bl_idname = "digiclay.shape_keep"
    bl_label = "Keep Formed as Shape"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed without a running session is needed."""
        return no_bed(context) or session_runs(context)

    def perform(self, context: Any) -> None:
        """Keep the heights."""
        bed = bed_of(context)
        scene = properties.scene_of(bed)
        heights = bridge.read_cells(bed.data)["height"]
        before = scene.shape or Shape()
        shape = replace(before, file="Formed", fit="placed", heights=pack(heights))
        properties.write_scene(bed, replace(scene, shape=shape))
        self.report(
            {"INFO"}, localize("{} has a shape of {} heights: sessions begin with it", bed.name, heights.size)
        )


class RemoveShape(Action, bpy.types.Operator):
    """Remove the bed's shape: sessions begin at rest; the formed surface stays until then"""

    bl_idname = "digiclay.shape_remove"
    bl_label = "Remove Shape"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed with a shape is needed, and no running session."""
        return no_bed(context) or session_runs(context) or _no_shape(context)

    def perform(self, context: Any) -> None:
        """Forget it."""
        settings = bed_of(context).digiclay
        settings.use_shape = False
        settings.shape.heights = ""
        settings.shape.file = Shape().file


def _no_shape(context: Any) -> str:
    """The bed displays nothing."""
    return "" if bed_of(context).digiclay.use_shape else "The bed has no shape"
