"""Operators of the Press tool for paths that no hand draws: line and ring."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .. import bridge
from ..compat import bpy
from ..press import aim, brush, tool
from ..sessions import running
from ..sessions.stroke_queue import change_stroke, last_place, queue_stroke
from ..strokes.stroke import SYMMETRIES, Brush, lay_line, lay_path, lay_ring
from ..ui_text import localize
from . import status
from .action import Drawing, Polled
from .poll_messages import no_tool
from .press_stroke import NOT_PRESSED, find_pressed, open_session

#: Path between two places of the bed, by the tool's setting.
SHAPES: dict[str, Callable[[Any, Any], Any]] = {"LINE": lay_line, "RING": lay_ring}
KEYS = {
    "LINE": "Length {:.1f} mm  |  Release: form the line  |  Esc or right click: cancel",
    "RING": "Radius {:.1f} mm  |  Release: form the ring  |  Esc or right click: cancel",
}


def _no_shape(context: Any) -> str:
    """The tool is set to free strokes, or another one is in use: the press is for another operator."""
    settings = brush.tool_settings(context)
    chosen = settings is not None and settings.path in SHAPES
    return "" if chosen else "Select the Press tool, and Line or Ring in its header"


class PressShape(Drawing, bpy.types.Operator):
    """Form a line from the place under the mouse, or a ring about it, by dragging to its end or rim"""

    bl_idname = "digiclay.press_shape"
    bl_label = "Press Line or Ring"
    bl_options = {"INTERNAL"}
    needs = (_no_shape,)

    def invoke(self, context: Any, event: Any) -> set[str]:
        target = find_pressed(self, context, brush.find_press(context, event))
        if target is None:
            return NOT_PRESSED
        settings: Any = brush.tool_settings(context)
        self.uid, self.grid, self.height = target.bed.session_uid, target.grid, target.height.copy()
        self.shape, self.kind = settings.path, brush.choose_brush(settings.brush, event)
        self.start = self.to = float(target.point[0]), float(target.point[1])
        self.begin(context)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Draw the path until the mouse button is released; the view can be turned meanwhile."""
        bed = brush.find_bed(context, self.uid)
        if bed is None or brush.tool_settings(context) is None:
            return self.end(context, "CANCELLED", "PASS_THROUGH")
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self.end(context, "CANCELLED")
        if event.type not in ("MOUSEMOVE", "LEFTMOUSE"):
            return {"PASS_THROUGH"}
        xy = event.mouse_x - self.region.x, event.mouse_y - self.region.y
        with context.temp_override(region=self.region):
            point = aim.hit_point(bpy.context, bed, self.grid, self.height, xy)
        if point is not None:
            self.to = float(point[0]), float(point[1])
        self._show(context)
        if event.type == "MOUSEMOVE":
            return {"RUNNING_MODAL"}
        self.end(context)
        return _queue_path(self, context, bed, self._path(), self.kind)

    def _path(self) -> Any:
        """Return the path as it is now, (k, 2), m."""
        return SHAPES[self.shape](self.start, self.to)

    def _show(self, context: Any) -> None:
        """Show the length or the radius, and draw the path."""
        length = float(np.hypot(self.to[0] - self.start[0], self.to[1] - self.start[1]))
        self.words = localize(KEYS[self.shape], 1e3 * length)
        status.show(context, self.words)
        self.region.tag_redraw()

    def draw_view(self, area: Any) -> None:
        context = bpy.context
        bed, settings = brush.find_bed(context, self.uid), brush.tool_settings(context)
        if bed is None or settings is None or context.area != area:
            return
        from ..overlay.draw import cursor

        lines = []
        for mirror in SYMMETRIES[settings.symmetry]:
            path = self._path() * mirror
            heights = self.height[self.grid.at(path[:, 0], path[:, 1])]
            points = bridge.project(context, bed, np.column_stack([path, heights]))
            if len(points) > 1 and np.isfinite(points).all():
                lines.append(points)
        system = context.preferences.system
        at = bridge.project(context, bed, np.array([[*self.to, float(self.height.max())]]))[0]
        text = tool.make_label(self.words.partition("  |")[0], (at[0], at[1] - 14.0), system.ui_scale)
        cursor(tool.make_lines(lines, system.pixel_size), text if np.isfinite(at).all() else ())


class PressLine(Polled, bpy.types.Operator):
    """Form a line from the end of the last stroke to the place under the mouse"""

    bl_idname = "digiclay.press_line"
    bl_label = "Press Line from Last Stroke"
    bl_options = {"INTERNAL"}
    needs = (no_tool,)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Queue the line; without a stroke before it, the place alone."""
        target = find_pressed(self, context, (event.mouse_region_x, event.mouse_region_y))
        if target is None:
            return NOT_PRESSED
        to = float(target.point[0]), float(target.point[1])
        session = running.find(target.bed)
        start = last_place(session) if session is not None else None
        settings: Any = brush.tool_settings(context)
        path = [to] if start is None else lay_line(start, to)
        return _queue_path(self, context, target.bed, path, Brush(settings.brush))


def _queue_path(operator: Any, context: Any, bed: Any, path: Any, kind: Brush) -> set[str]:
    """Queue a path for the fingertip, as the tool's settings have it."""
    settings: Any = brush.tool_settings(context)
    session = open_session(operator, context, bed, kind)
    if session is None:
        return {"CANCELLED"}
    share, (x, y) = float(settings.strength), path[0]
    depth = 1e-3 * share * getattr(settings, brush.amount_name(kind))
    session, number = queue_stroke(session, x, y, depth, SYMMETRIES[settings.symmetry], kind, share)
    running.put(change_stroke(session, number, partial(lay_path, points=path)))
    return {"FINISHED"}
