"""Selection of the pins whose heights the overlay shows."""

from typing import Any

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..device import display
from ..device.view import bed_of
from ..press import aim
from ..ui_text import localize
from . import status
from .action import Action, Polled
from .poll_messages import no_bed

NO_BED = "Select a bed of pins first"
KEYS = "Click pins to pick them, or again to drop them.  Enter, Esc or right click: done"


class PickPins(Polled, bpy.types.Operator):
    """Click pins of the active bed to see their heights in the overlay"""

    bl_idname = "digiclay.pick_pins"
    bl_label = "Pick Pins"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """There must be a bed to pick pins of, in a view to click into."""
        in_view = context.area is not None and context.area.type == "VIEW_3D"
        return no_bed(context, NO_BED) or ("" if in_view else "Pins are picked in a 3D view")

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Wait for clicks."""
        self.changed = False
        status.show(context, localize(KEYS))
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Pick or drop the pin under a click; what is no click goes on to the view."""
        status.show(context, localize(KEYS))
        if event.type in ("ESC", "RET", "RIGHTMOUSE") and event.value == "PRESS":
            status.clear()
            return {"FINISHED"} if self.changed else {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self._clicked(context, event)
        return {"PASS_THROUGH"}

    def cancel(self, context: Any) -> None:
        """Blender ends the operator, for instance to load a file."""
        status.clear()

    def _clicked(self, context: Any, event: Any) -> set[str]:
        """Pick or drop the pin under the mouse; a click beside the bed goes on to whatever lies there."""
        # The view it was started in may be gone by now: another workspace, another editor in its place.
        area, region = _under(context.window.screen, event)
        if region is None:
            return {"PASS_THROUGH"}
        with context.temp_override(area=area, region=region):
            found = aim.find_target(bpy.context, (event.mouse_x - region.x, event.mouse_y - region.y))
        if found is None or found.bed != bed_of(context):
            return {"PASS_THROUGH"}
        present = display.picked_pins(found.bed)
        pins = [pin for pin in present if pin != found.pin]
        try:
            display.pick_pins(found.bed, pins if found.pin in present else [*pins, found.pin])
        except DigiclayError as error:
            self.report({"WARNING"}, str(error))
        else:
            self.changed = True
        return {"RUNNING_MODAL"}


def _under(screen: Any, event: Any) -> tuple[Any, Any] | tuple[None, None]:
    """Return the 3D view that the mouse is in and its main region, of which it may have four."""
    for area in screen.areas:
        for region in area.regions if area.type == "VIEW_3D" else ():
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type == "WINDOW" and 0 <= x < region.width and 0 <= y < region.height:
                return area, region
    return None, None


class ClearPins(Action, bpy.types.Operator):
    """Remove all picked pins of the active bed"""

    bl_idname = "digiclay.clear_pins"
    bl_label = "Clear"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """There must be picked pins."""
        return no_bed(context, NO_BED) or (
            "" if display.picked_pins(bed_of(context)) else "No pins are picked"
        )

    def perform(self, context: Any) -> None:
        """Drop them."""
        display.pick_pins(bed_of(context), ())
