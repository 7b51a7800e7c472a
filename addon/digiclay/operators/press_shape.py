"""Operators of the Press tool for paths that no hand draws: line and ring."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..compat import bpy
from ..live import running
from ..live.stroke import SYMMETRIES, Brush, lay_line, lay_path, lay_ring
from ..live.stroke_queue import change_stroke, last_place, queue_stroke
from ..press import aim, brush, marks
from ..ui_text import localize
from . import status
from .action import Polled
from .press_stroke import NOT_PRESSED, find_pressed, open_session

#: Path between two places of the bed, by the tool's setting.
SHAPES: dict[str, Callable[[Any, Any], Any]] = {"LINE": lay_line, "RING": lay_ring}
KEYS = {
    "LINE": "Length {:.1f} mm  |  Release: form the line  |  Esc or right click: cancel",
    "RING": "Radius {:.1f} mm  |  Release: form the ring  |  Esc or right click: cancel",
}


class PressShape(Polled, bpy.types.Operator):
    """Form a line from the place under the mouse, or a ring about it, by dragging to its end or rim"""

    bl_idname = "digiclay.press_shape"
    bl_label = "Press Line or Ring"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The tool is set to one of them; else the press is for the free stroke."""
        settings = brush.tool_settings(context)
        chosen = settings is not None and settings.path in SHAPES
        return "" if chosen else "Select the Press tool, and Line or Ring in its header"

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin where the mouse points."""
        found = find_pressed(self, context, brush.find_press(context, event))
        if found is None:
            return NOT_PRESSED
        settings: Any = brush.tool_settings(context)
        self.uid, self.grid, self.height = found.bed.session_uid, found.grid, found.height.copy()
        self.region, self.shape = context.region, settings.path
        self.kind = brush.choose_brush(settings.brush, event)
        self.start = self.end = float(found.point[0]), float(found.point[1])
        self.handler = bpy.types.SpaceView3D.draw_handler_add(
            self._draw, (context.area,), "WINDOW", "POST_PIXEL"
        )
        context.window_manager.modal_handler_add(self)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Draw the path on until the mouse button is released; the view can be turned meanwhile."""
        bed = brush.find_bed(context, self.uid)
        if bed is None or brush.tool_settings(context) is None:
            return self._end(context, {"CANCELLED", "PASS_THROUGH"})
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self._end(context, {"CANCELLED"})
        if event.type == "MOUSEMOVE" or event.type == "LEFTMOUSE":
            xy = event.mouse_x - self.region.x, event.mouse_y - self.region.y
            with context.temp_override(region=self.region):
                point = aim.hit_point(bpy.context, bed, self.grid, self.height, xy)
            if point is not None:
                self.end = float(point[0]), float(point[1])
            self._tell(context)
            if event.type == "MOUSEMOVE":
                return {"RUNNING_MODAL"}
            self._end(context, set())
            return _queue_path(self, context, bed, self._path(), self.kind)
        return {"PASS_THROUGH"}

    def cancel(self, context: Any) -> None:
        """Blender ends the operator, for instance to load a file."""
        self._end(context, set())

    def _path(self) -> Any:
        """Return the path as it is now, (k, 2), m."""
        return SHAPES[self.shape](self.start, self.end)

    def _tell(self, context: Any) -> None:
        """Show the length or the radius, and draw the path."""
        length = float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))
        self.words = localize(KEYS[self.shape], 1e3 * length)
        status.show(context, self.words)
        self.region.tag_redraw()

    def _draw(self, area: Any) -> None:
        """Draw the path and its mirror images on the pins."""
        context = bpy.context
        bed, settings = brush.find_bed(context, self.uid), brush.tool_settings(context)
        if bed is None or settings is None or context.area != area:
            return
        from ..overlay.draw import cursor

        lines = []
        for mirror in SYMMETRIES[settings.symmetry]:
            path = self._path() * mirror
            heights = self.height[self.grid.at(path[:, 0], path[:, 1])]
            points = aim.project(context, bed, np.column_stack([path, heights]))
            if len(points) > 1 and np.isfinite(points).all():
                lines.append(points)
        preferences = context.preferences.system
        at = aim.project(context, bed, np.array([[*self.end, float(self.height.max())]]))[0]
        text = marks.make_label(self.words.partition("  |")[0], (at[0], at[1] - 14.0), preferences.ui_scale)
        cursor(marks.make_lines(lines, preferences.pixel_size), text if np.isfinite(at).all() else ())

    def _end(self, context: Any, result: set[str]) -> set[str]:
        """Give back status bar and view."""
        status.clear()
        if self.handler is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self.handler, "WINDOW")
            self.handler = None
        for area in context.screen.areas if context.screen else ():
            area.tag_redraw()
        return result


class PressLine(Polled, bpy.types.Operator):
    """Form a line from the end of the last stroke to the place under the mouse"""

    bl_idname = "digiclay.press_line"
    bl_label = "Press Line from Last Stroke"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """The Press tool is needed."""
        return "" if brush.tool_settings(context) is not None else "Select the Press tool"

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Queue the line; without a stroke before it, the place alone."""
        found = find_pressed(self, context, (event.mouse_region_x, event.mouse_region_y))
        if found is None:
            return NOT_PRESSED
        end = float(found.point[0]), float(found.point[1])
        session = running.find(found.bed)
        start = last_place(session) if session is not None else None
        settings: Any = brush.tool_settings(context)
        path = [end] if start is None else lay_line(start, end)
        return _queue_path(self, context, found.bed, path, Brush(settings.brush))


def _queue_path(operator: Any, context: Any, bed: Any, path: Any, kind: Brush) -> set[str]:
    """Queue a path for the finger, as the tool's settings have it."""
    settings: Any = brush.tool_settings(context)
    session = open_session(operator, context, bed, kind)
    if session is None:
        return {"CANCELLED"}
    share, (x, y) = float(settings.strength), path[0]
    depth = 1e-3 * share * getattr(settings, brush.amount_name(kind))
    session, number = queue_stroke(session, x, y, depth, SYMMETRIES[settings.symmetry], kind, share)
    running.put(change_stroke(session, number, partial(lay_path, points=path)))
    return {"FINISHED"}
