"""Operators on what is seen of a bed: pins picked for the overlay, and the live skin."""

from collections.abc import Iterable

from ..compat import Area, Context, Event, Object, Operator, Region, Screen, bpy
from ..core.base.errors import DigiclayError
from ..core.session.recent_trace import PICKED
from ..device import detail, view
from ..overlay import views
from ..press import aim
from ..roles import bed_of
from ..ui_text import localize
from .action import Modal, Result, action, clear_status, show_status
from .poll_messages import cannot_change, no_pins, no_skin, no_view

KEYS = "Click pins to pick them, or again to drop them.  Enter, Esc or right click: done"


def pick_pins(bed: Object, pins: Iterable[int]) -> None:
    """Choose the pins whose heights the overlay shows: at most 6 different ones of the bed."""
    chosen, count = tuple(pins), len(bed.data.vertices)
    if len(chosen) > PICKED or len(set(chosen)) != len(chosen):
        raise DigiclayError(
            f"Display.picked must be at most {PICKED} different pins (got {list(chosen)})."
        )
    unknown = [pin for pin in chosen if not 0 <= pin < count]
    if unknown:
        raise DigiclayError(
            f"Display.picked must be pins 0 to {count - 1} of {bed.name} (got {unknown[0]})."
        )
    bed.digiclay_display.picked = (*chosen, *[view.NO_PIN] * (PICKED - len(chosen)))
    views.redraw()


class PickPins(Modal, Operator):
    """Click pins of the active bed to see their heights in the overlay"""

    bl_idname = "digiclay.pick_pins"
    bl_label = "Pick Pins"
    bl_options = {"UNDO"}
    needs = cannot_change, no_view

    def prepare(self, context: Context, event: Event) -> None:
        self.changed = False
        show_status(context, localize(KEYS))

    def modal(self, context: Context, event: Event) -> Result:
        """Pick or drop the pin under a click; any other event is passed to the view."""
        show_status(context, localize(KEYS))
        if event.type in ("ESC", "RET", "RIGHTMOUSE") and event.value == "PRESS":
            clear_status()
            return {"FINISHED"} if self.changed else {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self._click(context, event)
        return {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        clear_status()

    def _click(self, context: Context, event: Event) -> Result:
        """Pick or drop the pin under the mouse; a click beside the bed is passed to what lies there."""
        # The view it was started in may be gone by now: another workspace, another editor in its
        # place.
        area, region = _under(context.window.screen, event)
        if region is None:
            return {"PASS_THROUGH"}
        with context.temp_override(area=area, region=region):
            target = aim.find_target(
                bpy.context, (event.mouse_x - region.x, event.mouse_y - region.y)
            )
        if target is None or target.bed != bed_of(context):
            return {"PASS_THROUGH"}
        present = view.picked_pins(target.bed)
        pins = [pin for pin in present if pin != target.pin]
        try:
            pick_pins(target.bed, pins if target.pin in present else [*pins, target.pin])
        except DigiclayError as error:
            self.report({"WARNING"}, str(error))
        else:
            self.changed = True
        return {"RUNNING_MODAL"}


def _under(screen: Screen, event: Event) -> tuple[Area, Region] | tuple[None, None]:
    """Return the 3D view that the mouse is in and its main region, of which it may have four."""
    for area in screen.areas:
        for region in area.regions if area.type == "VIEW_3D" else ():
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if region.type == "WINDOW" and 0 <= x < region.width and 0 <= y < region.height:
                return area, region
    return None, None


@action("digiclay.clear_pins", "Clear", cannot_change, no_pins, options=("UNDO",))
def clear_pins(operator: Operator, context: Context) -> None:
    """Remove all picked pins of the active bed"""
    pick_pins(bed_of(context), ())


@action("digiclay.skin_toggle", "Toggle Skin", cannot_change, no_skin)
def toggle_skin(operator: Operator, context: Context) -> None:
    """Show the surface of the pins as a skin, or the pins again"""
    bed = bed_of(context)
    seen, before = view.is_skin_shown(bed), bed.get(view.BEFORE)
    # The form there was before, if that changes what is seen.
    if before in view.FORMS:
        view.set_form(bed, before)
        detail.follow()
    if before not in view.FORMS or view.is_skin_shown(bed) == seen:
        before = before or view.read_form(bed)
        view.set_form(bed, "pins" if seen else "skin")
        bed[view.BEFORE] = before
