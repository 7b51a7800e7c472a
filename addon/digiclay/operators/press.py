"""The Press tool's gesture: the fingertip goes under the mouse and presses as long as the button is held."""

# No postponed annotations here: Blender reads an operator's properties from them.
import time
from dataclasses import replace
from typing import Any

from .. import bridge, preferences
from ..compat import bpy
from ..core.errors import DigiclayError
from ..device import view
from ..live import running, sculpting, tick, waiting
from ..press import aim
from ..press.gesture import DEEPEST, DONE, advanced, begun, deeper, dragged
from . import status
from .reasons import allowed

__all__ = ["Press"]

#: Depth of a turn of the wheel, and of a pixel of Ctrl-drag at a UI scale of 1; m.
WHEEL, PIXEL = 0.25e-3, 0.02e-3
WHEELS = {"WHEELUPMOUSE": -WHEEL, "WHEELDOWNMOUSE": WHEEL}
KEYS = "Depth {:.2f} mm  |  Wheel, or Ctrl and drag: depth  |  Esc or right click: take the gesture back"


class Press(bpy.types.Operator):  # type: ignore[misc]
    """Press the fingertip into the pins under the mouse, and drag it on"""

    bl_idname = "digiclay.press"
    bl_label = "Press"
    bl_options = {"UNDO"}  # noqa: RUF012

    depth: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Depth (mm)",
        description="How deep to press below the surface as it was, in mm",
        default=4.0,
        min=0.1,
        max=1e3 * DEEPEST,
        soft_max=10.0,
        precision=2,
        step=25,
    )
    use_pressure: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Pen Pressure",
        description="A pen presses as deep as its pressure says, up to the depth",
        default=True,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A view is needed, in object mode, with a bed in it."""
        if context.area is None or context.area.type != "VIEW_3D" or context.mode != "OBJECT":
            return allowed(cls, "Pins are pressed in a 3D view, in Object Mode")
        seen = any(view.is_bed(thing) for thing in context.visible_objects)
        return allowed(cls, "" if seen else "Add a bed first: Add > Mesh > Digital Clay")

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin where the mouse points; beside the bed there is nothing to press."""
        found = aim.target(context, (event.mouse_region_x, event.mouse_region_y))
        if found is None:
            return {"PASS_THROUGH"}
        try:
            session = _session(context, found.bed)
            tip = view.fingertip_of(found.bed)
            at, finger = bridge.pose(tip), bridge.finger_of(tip)
        except (DigiclayError, RuntimeError) as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        if session.stale:
            self.report({"INFO"}, "The bed is just taking up what was undone: press again")
            return {"CANCELLED"}
        if session.paused:
            self.report({"WARNING"}, "The session is paused: the pins follow when it goes on")
        place = float(found.point[0]), float(found.point[1])
        self.uid, self.seen = session.uid, session.state.period
        session, self.start = sculpting.marked(session)
        running.put(session)
        self.gesture = begun(found.grid, found.height, finger, at, place, 1e-3 * self.depth)
        self._feel(event)
        self.region, self.last, self.before = context.region, time.perf_counter(), event.mouse_y
        rate = preferences.of(context).redraw_rate
        self.timer = context.window_manager.event_timer_add(1.0 / rate, window=context.window)
        context.window_manager.modal_handler_add(self)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Follow the mouse; timers go on to the session."""
        bed = _bed(self.uid)
        tip = None if bed is None else view.fingertip_of(bed)
        if tip is None or running.of(bed) is None:
            self.report({"WARNING"}, "The gesture ended: its session, bed or fingertip is gone")
            self._end(context)
            return {"CANCELLED"}
        if event.type == "TIMER":
            return self._timed(context, bed, tip)
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self._taken_back(context, bed)
        if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE"):
            self._moved(context, bed, event)
        elif event.type in WHEELS:
            self.gesture = deeper(self.gesture, WHEELS[event.type])
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.gesture = replace(self.gesture, held=False)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Blender ends the operator, for instance to load a file."""
        self._end(context)

    def _moved(self, context: Any, bed: Any, event: Any) -> None:
        """Follow the mouse over the surface as it was, or with Ctrl change the depth."""
        if not self.gesture.held:
            return
        down, self.before = self.before - event.mouse_y, event.mouse_y
        self._feel(event)
        if event.ctrl:
            scale = context.preferences.system.ui_scale
            self.gesture = deeper(self.gesture, PIXEL * down / scale)
            return
        xy = event.mouse_x - self.region.x, event.mouse_y - self.region.y
        with context.temp_override(region=self.region):
            point = aim.meets(bpy.context, bed, self.gesture.grid, self.gesture.height, xy)
        if point is not None:
            self.gesture = dragged(self.gesture, (float(point[0]), float(point[1])))

    def _feel(self, event: Any) -> None:
        """Take a pen's pressure."""
        if self.use_pressure and event.is_tablet and self.gesture.held:
            self.gesture = replace(self.gesture, pressure=min(max(float(event.pressure), 0.0), 1.0))

    def _timed(self, context: Any, bed: Any, tip: Any) -> set[str]:
        """Let the finger go on, and hand the timer on to the session."""
        now, session = time.perf_counter(), running.of(bed)
        still = session.paused or bool(session.waits)
        simulated = (session.state.period - self.seen) * session.system.period
        seconds = now - self.last if still else max(0.0, simulated)
        self.gesture = advanced(self.gesture, seconds, None if still else session.pose)
        self.last, self.seen = now, session.state.period
        bridge.place_fingertip(tip, self.gesture.at, self.gesture.finger)
        if self.gesture.phase != DONE:
            return {"PASS_THROUGH"}
        self._keep_depth(context)
        self._end(context)
        return {"FINISHED"}

    def _taken_back(self, context: Any, bed: Any) -> set[str]:
        """Bring bed and fingertip back to where the gesture began; a session that waits, the finger alone."""
        self._end(context)
        session = running.of(bed)
        if waiting.obstacle(context, bed, session.system.grid.count):
            bridge.place_fingertip(view.fingertip_of(bed), self.start.pose, self.gesture.finger)
            return {"CANCELLED"}
        back = sculpting.taken_back(session, self.start)
        tick.show(bed, back)
        tick.place(context, bed, back)
        return {"CANCELLED"}

    def _keep_depth(self, context: Any) -> None:
        """Let the next gesture start with the depth this one ended with."""
        self.depth = 1e3 * self.gesture.depth
        tool = context.workspace.tools.from_space_view3d_mode("OBJECT")
        if tool is not None and tool.idname == "digiclay.press_tool":
            tool.operator_properties(self.bl_idname).depth = self.depth

    def _tell(self, context: Any) -> None:
        """Show depth and keys in the status bar."""
        status.tell(context, KEYS.format(1e3 * self.gesture.depth * self.gesture.pressure))

    def _end(self, context: Any) -> None:
        """Give back timer and status bar."""
        context.window_manager.event_timer_remove(self.timer)
        status.clear()


def _bed(uid: int) -> Any | None:
    """Return the bed, fetched anew since undo invalidates what is kept, or None when it is deleted."""
    return next((thing for thing in bpy.context.scene.objects if thing.session_uid == uid), None)


def _session(context: Any, bed: Any) -> running.Running:
    """Return the session of a bed; one is started if there is none.

    Raises
    ------
    DigiclayError, RuntimeError
        When it cannot be started, with the reason.
    """
    if running.of(bed) is None:
        context.view_layer.objects.active = bed
        bpy.ops.digiclay.session("INVOKE_DEFAULT")
    session = running.of(bed)
    if session is None:
        raise DigiclayError(f"The session of {bed.name} could not be started; its panel says why.")
    return session
