"""Rebuild: the bed's pins and housing after its settings."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..device import rebuild
from ..device.view import bed_of
from .reasons import allowed, baked, edited, no_bed, session_runs

__all__ = ["Rebuild"]


class Rebuild(bpy.types.Operator):  # type: ignore[misc]
    """Make the pins and the housing anew after the settings; what was formed is lost, the fingertip stays"""

    bl_idname = "digiclay.rebuild"
    bl_label = "Rebuild"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is needed, and no session on it."""
        why = (
            no_bed(context)
            or session_runs(context, "Stop the session first: its pins cannot be exchanged")
            or baked(context, "Free the bake in the Takes panel first: it moves the pins there are now")
            or edited(context, "Leave Edit Mode first")
        )
        return allowed(cls, why)

    def execute(self, context: Any) -> set[str]:
        """Make it anew."""
        try:
            scene = rebuild.rebuild(bed_of(context))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"The bed has {scene.layout.rows} x {scene.layout.columns} pins now")
        return {"FINISHED"}
