"""What the Press tool's header has beside strokes: the center of symmetry, and the base."""

from typing import Any

from ..compat import Area, Context, Event, Operator, bpy
from ..live import beds
from ..press import aim, brush, tool
from ..press.pointer import HELD
from ..sessions.sculpting import queue_stroke
from ..strokes.stroke import SHALLOWEST, Brush, let_go, start
from ..ui_text import localize
from .action import Drawing, Polled, Result, action, show_status
from .poll_messages import no_finger, no_tool, no_tool_in_view
from .press_stroke import find_place, find_pressed, hit_place, open_session

KEYS = "Press where the center is to be, and drag along the axis  |  Esc or right click: cancel"


class PlaceCenter(Drawing, Operator):
    """Place the center of symmetry: press on the bed, and drag along the mirror's axis"""

    bl_idname = "digiclay.press_center"
    bl_label = "Place Center"
    bl_options = {"INTERNAL"}
    needs = no_tool_in_view, no_finger

    def prepare(self, context: Context, event: Event) -> None:
        """Wait for the press."""
        self.uid, self.center = 0, (0.0, 0.0)
        self.before = brush.read_center(brush.tool_settings(context))
        show_status(context, localize(KEYS))

    def modal(self, context: Context, event: Event) -> Result:
        """Place the center by the press, and the axis until the release; the view can be turned meanwhile."""
        settings = brush.tool_settings(context)
        if settings is None:
            return self.end(context, "CANCELLED", "PASS_THROUGH")
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            for name, value in self.before.items():
                setattr(settings, name, value)
            return self.end(context, "CANCELLED")
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            with context.temp_override(region=self.region):
                target = find_pressed(self, bpy.context, self.locate(event), settings)
            if target is not None:
                self.uid, self.grid = target.bed.session_uid, target.grid
                self.canvas = target.canvas.copy()
                self.center = find_place(target.point)
                brush.put_center(settings, *self.center)
        elif event.type in ("MOUSEMOVE", "LEFTMOUSE") and self.uid:
            bed = brush.find_bed(context, self.uid)
            place = bed and hit_place(self, context, bed, event)
            if place is not None:
                brush.turn_axis(settings, place[0] - self.center[0], place[1] - self.center[1])
            if event.type == "LEFTMOUSE":
                return self.end(context, "FINISHED")
        else:
            return {"PASS_THROUGH"}
        self.region.tag_redraw()
        return {"RUNNING_MODAL"}

    def draw_view(self, area: Area) -> None:
        """Draw center and axes in the view the operator was called in."""
        context = bpy.context
        bed, settings = brush.bed_in_use(context), brush.tool_settings(context)
        if bed is not None and settings is not None and context.area == area:
            tool.draw_on_bed(
                context, bed, tool.find_axes(*aim.read_surface(bed), settings), "", (0.0, 0.0)
            )


class NoteKeys(Polled, Operator):
    """Note whether Ctrl and Shift are held, for the text at the cursor"""

    bl_idname = "digiclay.press_keys"
    bl_label = "Note Keys"
    bl_options = {"INTERNAL"}
    needs = (no_tool,)

    def invoke(self, context: Context, event: Event) -> Result:
        if (HELD.ctrl, HELD.shift) != (event.ctrl, event.shift):
            HELD.ctrl, HELD.shift = event.ctrl, event.shift
            context.area.tag_redraw()
        return {"PASS_THROUGH"}


def tell_all(operator: Operator, context: Context, kind: Brush, **fields: Any) -> Result | None:
    """Queue a stroke that tells all pins something; `fields`: of `Stroke`."""
    session = open_session(operator, context, brush.bed_in_use(context), kind)
    if session is None:
        return {"CANCELLED"}
    x, y = session.pose[:2].tolist()
    stroke = let_go(start(0, x, y, SHALLOWEST, brush=kind, **fields))
    session, _ = queue_stroke(session, stroke)
    beds.put(session)
    return None


@action("digiclay.press_base", "Set Base", no_tool_in_view, no_finger, options=("UNDO",))
def set_base(operator: Operator, context: Context) -> Result | None:
    """Count heights and depths from the surface as it stands, strokes of the queue included"""
    return tell_all(operator, context, Brush.SET_BASE)
