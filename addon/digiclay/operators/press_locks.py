"""Locks of pins beside the brush Lock: of all pins, by height, and by a box or a lasso in the view."""

from typing import Any

import numpy as np

from .. import bridge
from ..compat import Area, Context, Event, Menu, Operator, bpy
from ..core.base.arrays import Floats
from ..panels.base import menu
from ..press import aim, brush, tool
from ..settings.declared import choice, flag
from ..strokes.locks import find_inside, place_images
from ..strokes.stroke import Brush, Place
from ..ui_text import localize
from .action import Action, Drawing, Result, action, inform, millimeters, show_status
from .poll_messages import no_finger, no_tool_in_view
from .press_plan import tell_all

NEEDS = no_tool_in_view, no_finger
CHANGES = (
    ("INVERT", "Invert", "Lock the pins that are not locked, and unlock those that are"),
    ("CLEAR", "Clear", "Unlock all pins"),
    ("GROW", "Grow", "Lock pins as far as those beside them are"),
    ("SHRINK", "Shrink", "Unlock pins as far as those beside them are"),
    ("BLUR", "Blur", "Lock pins in part, by the mean of those beside them: brushes move them less"),
)
SIDES = (
    ("ABOVE", "Above", "Pins that stand at this height or above it"),
    ("BELOW", "Below", "Pins that stand at this height or below it"),
)
SHAPES = (
    ("BOX", "Box", "Drag from one corner to the other"),
    ("LASSO", "Lasso", "Draw around the pins; one that crosses itself has holes"),
)
KEYS = "{}: drag around the pins  |  Ctrl: unlock  |  Esc or right click: cancel"
NONE = "No pin was inside: the locks are as they were"
UNLOCK = flag("Unlock", "Unlock these pins", default=False)


@action(
    "digiclay.press_locks",
    "Change Locks",
    *NEEDS,
    options=("UNDO",),
    change=choice("Change", "What becomes of the locks of all pins", items=CHANGES),
)
def change_locks(operator: Operator, context: Context) -> Result | None:
    """Change the locks of all pins"""
    return tell_all(operator, context, Brush(operator.change + "_LOCKS"))


class LockByHeight(Action, Operator):
    """Lock, or unlock, the pins that stand above or below a height"""

    bl_idname = "digiclay.press_locks_height"
    bl_label = "Lock by Height"
    bl_options = {"UNDO"}
    needs = NEEDS

    side: choice("Pins", "Which pins are locked", items=SIDES)
    height: millimeters("Height", 3e-3, "Height above rest", min=-100.0, max=100.0)
    unlock: UNLOCK

    def invoke(self, context: Context, event: Event) -> Result:
        """Ask for the height."""
        result: Result = context.window_manager.invoke_props_dialog(self)
        return result

    def perform(self, context: Context) -> Result | None:
        height, above = 1e-3 * self.height, self.side == "ABOVE"
        limits = (height, np.inf) if above else (-np.inf, height)
        return tell_all(self, context, choose_kind(self.unlock), limits=limits)


def choose_kind(unlock: bool) -> Brush:
    """Return the brush that locks pins, or unlocks them."""
    return Brush.UNLOCK_PINS if unlock else Brush.LOCK_PINS


class LockArea(Drawing, Operator):
    """Lock, or with Ctrl unlock, the pins inside a box or a lasso and its mirror images, also hidden ones"""

    bl_idname = "digiclay.press_locks_area"
    bl_label = "Lock Area"
    bl_options = {"UNDO"}
    needs = NEEDS

    shape: choice("Shape", "What is drawn", items=SHAPES)
    unlock: UNLOCK

    def prepare(self, context: Context, event: Event) -> None:
        """Begin where the mouse went down, or wait for it."""
        self.path: list[Place] = []
        if event.type == "LEFTMOUSE":
            self.path = [brush.find_press(context, event)]
        label = next(label for name, label, _ in SHAPES if name == self.shape)
        show_status(context, localize(KEYS, localize(label)))

    def modal(self, context: Context, event: Event) -> Result:
        """Draw until the mouse button is released."""
        if not self.poll(context) or (
            event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS"
        ):
            return self.end(context, "CANCELLED")
        place = self.locate(event)
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self.path, self.unlock = [place], self.unlock != event.ctrl
        elif event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE", "LEFTMOUSE") and self.path:
            self.path.append(place)
            if event.type == "LEFTMOUSE":
                self.end(context)
                with context.temp_override(region=self.region):
                    return self._lock(bpy.context)
        elif event.type != "MOUSEMOVE":
            return {"PASS_THROUGH"}
        self.region.tag_redraw()
        return {"RUNNING_MODAL"}

    def _lock(self, context: Context) -> Result:
        """Lock the pins inside."""
        bed: Any = brush.bed_in_use(context)
        # The images of a symmetry are a group: what comes to a pin is among those it comes to.
        images, outline = brush.find_images(brush.tool_settings(context)), self._outline()
        found = [
            find_inside(bridge.project(context, bed, places), outline)
            for places in place_images(images, *aim.read_surface(bed))
        ]
        pins = np.flatnonzero(np.any(found, axis=0)).tolist()
        if not pins:
            inform(self, NONE)
            return {"CANCELLED"}
        done = tell_all(self, context, choose_kind(self.unlock), pins=tuple(pins))
        return done or {"FINISHED"}

    def _outline(self) -> Floats:
        """Return the closed outline, (k, 2), pixels of the region."""
        path = np.array(self.path, np.float64)
        if self.shape == "LASSO":
            return tool.close(path)
        (left, bottom), (right, top) = path[[0, -1]].tolist()
        return tool.close(np.array([(left, bottom), (right, bottom), (right, top), (left, top)]))

    def draw_view(self, area: Area) -> None:
        """Draw the outline in the view the operator was called in."""
        from ..overlay.draw import cursor

        context = bpy.context
        if self.path and context.area == area and context.region == self.region:
            width = context.preferences.system.pixel_size
            cursor(tool.make_lines([self._outline()], width))


@menu("DIGICLAY_MT_locks", "Locks")
def locks(entries: Menu, context: Context) -> None:
    """Locks of pins."""
    layout = entries.layout
    # From the header an operator would be called there.
    layout.operator_context = "INVOKE_REGION_WIN"
    layout.operator_enum(change_locks.bl_idname, "change")
    layout.separator()
    layout.operator(LockByHeight.bl_idname, text="By Height...")
    layout.operator_enum(LockArea.bl_idname, "shape")
