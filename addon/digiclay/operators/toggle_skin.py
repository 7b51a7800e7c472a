"""Toggle of the live skin: the skin alone, or the pins alone."""

from typing import Any

from ..compat import bpy
from ..device import detail, form
from ..device.view import bed_of
from .action import Action
from .poll_messages import linked, no_bed, no_skin


class ToggleSkin(Action, bpy.types.Operator):
    """Show the surface of the pins as a skin, or the pins again"""

    bl_idname = "digiclay.skin_toggle"
    bl_label = "Toggle Skin"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed of this file that has a skin is needed."""
        return no_bed(context) or linked(context) or no_skin(context)

    def perform(self, context: Any) -> None:
        """Show pins where a skin is seen, else the skin; by the form there was before, if that does it."""
        bed = bed_of(context)
        seen, before = form.is_skin_shown(bed), bed.get(form.BEFORE)
        if before in form.FORMS:
            form.set_form(bed, before)
            detail.follow()
        if before not in form.FORMS or form.is_skin_shown(bed) == seen:
            before = before or form.read_form(bed)
            form.set_form(bed, "pins" if seen else "skin")
            bed[form.BEFORE] = before
