"""Rebuild: the bed's pins and housing after its settings."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..device import rebuild
from ..device.view import bed_of
from ..live import running
from ..recorded.bake import is_baked

__all__ = ["Rebuild"]


class Rebuild(bpy.types.Operator):  # type: ignore[misc]
    """Make the pins and the housing anew after the settings; what was formed is lost, the fingertip stays"""

    bl_idname = "digiclay.rebuild"
    bl_label = "Rebuild"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is needed, and no session on it."""
        bed = bed_of(context)
        if bed is None:
            cls.poll_message_set("Select a bed or its fingertip first")
        elif running.of(bed) is not None:
            cls.poll_message_set("Stop the session first: its pins cannot be exchanged")
        elif is_baked(bed):
            cls.poll_message_set("Free the bake in the Takes panel first: it moves the pins there are now")
        elif context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode first")
        else:
            return True
        return False

    def execute(self, context: Any) -> set[str]:
        """Make it anew."""
        try:
            scene = rebuild.rebuild(bed_of(context))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"The bed has {scene.layout.rows} x {scene.layout.columns} pins now")
        return {"FINISHED"}
