"""Operator of the Press tool: path of the mouse while the button is held, queued for the session."""

import time
from dataclasses import replace
from functools import partial
from typing import Any

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..device import view
from ..live import running, selection, tick
from ..live.stroke import DEEPEST, SYMMETRIES, deepen, draw
from ..live.stroke_queue import change_stroke, find_stroke, queue_stroke
from ..press import aim, brush
from . import status
from .action import Polled

__all__ = ["Press"]

#: Depth of a turn of the wheel, and of a pixel of Ctrl-drag at a UI scale of 1; m.
WHEEL, PIXEL = 0.25e-3, 0.02e-3
WHEELS = {"WHEELUPMOUSE": -WHEEL, "WHEELDOWNMOUSE": WHEEL}
KEYS = (
    "Depth {:.2f} mm  |  Ctrl and wheel, or Ctrl and drag: depth  |  Esc or right click: take the press back"
)


class Press(Polled, bpy.types.Operator):
    """Press the fingertip into the pins under the mouse, and drag it"""

    bl_idname = "digiclay.press"
    bl_label = "Press"
    # No undo step of its own: the session makes it when the finger has finished the stroke.
    bl_options = {"INTERNAL"}

    depth: bpy.props.FloatProperty(
        name="Depth (mm)",
        description="Depth of the press below the surface, in mm",
        default=4.0,
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=10.0,
        precision=2,
        step=25,
    )
    strength: bpy.props.FloatProperty(
        name="Strength",
        description="Share of the depth that a stroke reaches; pen pressure scales it further",
        default=1.0,
        min=0.01,
        max=1.0,
        subtype="FACTOR",
        precision=2,
    )
    symmetry: bpy.props.EnumProperty(
        name="Symmetry",
        description=(
            "Mirror images of a stroke about the middle of the bed. The device has one finger: "
            "it forms them one after the other, as one undo step"
        ),
        items=brush.SYMMETRY_ITEMS,
        default="NONE",
    )
    use_pressure: bpy.props.BoolProperty(
        name="Pen Pressure",
        description="Pen pressure scales the depth, up to its value",
        default=True,
    )

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A view is needed, in object mode, with a bed in it."""
        if context.area is None or context.area.type != "VIEW_3D" or context.mode != "OBJECT":
            return "Pins are pressed in a 3D view, in Object Mode"
        seen = any(view.is_bed(thing) for thing in context.visible_objects)
        return "" if seen else "Add a bed first: Add > Mesh > Digital Clay"

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin where the mouse points; beside the bed there is nothing to press."""
        found = aim.find_target(context, (event.mouse_region_x, event.mouse_region_y))
        if found is None:
            return {"PASS_THROUGH"}
        try:
            session = _session(context, found.bed)
        except (DigiclayError, RuntimeError) as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        if session.paused:
            self.report({"WARNING"}, "The session is paused: the fingertip follows after it resumes")
        selection.deselect(found.bed)
        # The hand draws on the surface it has seen when it began, not on pins that give way under it.
        self.uid, self.grid, self.height = session.uid, found.grid, found.height.copy()
        self.region, self.began, self.before = context.region, time.perf_counter(), event.mouse_y
        self.full, self.pressure, self.ticked = 1e-3 * self.depth, 1.0, 0.0
        self._feel(event)
        place = float(found.point[0]), float(found.point[1])
        mirrors = SYMMETRIES[self.symmetry]
        session, self.number = queue_stroke(session, *place, self._pressed_depth(), mirrors)
        running.put(session)
        context.window_manager.modal_handler_add(self)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Draw the stroke on; whatever is not for it goes on to Blender, to turn the view for instance."""
        bed = brush.find_bed(bpy.context, self.uid)
        session = running.find(bed)
        stroke = session and find_stroke(session, self.number)
        if stroke is None:
            if bed is None or session is None:
                self.report({"WARNING"}, "The press stroke ended: its session or bed was removed")
            return self._end({"CANCELLED", "PASS_THROUGH"})
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            tick.withdraw_strokes(context, self.uid)
            return self._end({"CANCELLED"})
        if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE"):
            self._move(context, bed, event)
        elif event.type in WHEELS and event.ctrl:
            self._deepen(context, WHEELS[event.type])
        elif event.type == "LEFTMOUSE":
            self._move(context, bed, event)
            self._change(lambda stroke: replace(stroke, held=False))
            # A press while it is held: another operator has had the release. That one is another stroke.
            again = {"PASS_THROUGH"} if event.value == "PRESS" else set()
            return self._end({"FINISHED"} | again)
        else:
            if event.type == "TIMER":
                # Blender may hand a timer over before moves that were made earlier; not so the one before.
                self._change(lambda stroke: replace(stroke, known=self.ticked))
                self.ticked = self._time()
            return {"PASS_THROUGH"}
        self._tell(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Blender ends the operator, for instance to load a file."""
        self._change(lambda stroke: replace(stroke, held=False))
        self._end(set())

    def _move(self, context: Any, bed: Any, event: Any) -> None:
        """Draw on to the place under the mouse, or with Ctrl change the depth."""
        down, self.before = self.before - event.mouse_y, event.mouse_y
        self._feel(event)
        if event.ctrl and event.type != "LEFTMOUSE":
            self._deepen(context, PIXEL * down / context.preferences.system.ui_scale)
            return
        xy = event.mouse_x - self.region.x, event.mouse_y - self.region.y
        with context.temp_override(region=self.region):
            point = aim.hit_point(bpy.context, bed, self.grid, self.height, xy)
        if point is not None and event.value != "PRESS":
            x, y = float(point[0]), float(point[1])
            self._change(partial(draw, time=self._time(), x=x, y=y, depth=self._pressed_depth()))

    def _deepen(self, context: Any, by: float) -> None:
        """Press deeper, m, from here on; the tool shows the new depth beside the cursor and in the header."""
        self.full = min(max(self.full + by, 0.0), DEEPEST)
        self._change(partial(deepen, time=self._time(), by=by * self.strength * self.pressure))
        self._keep_depth(context)

    def _pressed_depth(self) -> float:
        """Return how deep to press now, m."""
        return float(self.full * self.strength * self.pressure)

    def _change(self, change: Any) -> None:
        """Put a changed stroke into the session's queue."""
        session = running.find(brush.find_bed(bpy.context, self.uid))
        if session is not None:
            running.put(change_stroke(session, self.number, change))

    def _time(self) -> float:
        """Return the time since the mouse went down, s."""
        return time.perf_counter() - self.began

    def _feel(self, event: Any) -> None:
        """Take a pen's pressure."""
        if self.use_pressure and event.is_tablet:
            self.pressure = min(max(float(event.pressure), 0.0), 1.0)

    def _keep_depth(self, context: Any) -> None:
        """Let the next press have the depth of this one."""
        self.depth = 1e3 * self.full
        settings = brush.tool_settings(context)
        if settings is not None:
            settings.depth = self.depth

    def _tell(self, context: Any) -> None:
        """Show depth and keys in the status bar."""
        status.show(context, KEYS.format(1e3 * self._pressed_depth()))

    def _end(self, result: set[str]) -> set[str]:
        """Give back the status bar."""
        status.clear()
        return result


def _session(context: Any, bed: Any) -> running.Running:
    """Return the session of a bed; one is started if there is none.

    Raises
    ------
    DigiclayError, RuntimeError
        When it cannot be started, with the reason.
    """
    if running.find(bed) is None:
        context.view_layer.objects.active = bed
        bpy.ops.digiclay.session("INVOKE_DEFAULT")
    session = running.find(bed)
    if session is None:
        raise DigiclayError(f"The session of {bed.name} could not be started; its panel says why.")
    return session
