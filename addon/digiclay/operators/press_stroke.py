"""Strokes of the Press tool, queued for the session: drawn by the mouse, lines and rings."""

from functools import partial
from typing import Any

import numpy as np

from .. import bridge
from ..compat import Area, Context, Event, Object, Operator, OperatorProperties, bpy
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.control.methods import METHODS
from ..live import beds, loop, tick
from ..press import aim, brush, ghost, pointer, tool
from ..press.pointer import begin_button, read_event
from ..sessions import running, sculpting
from ..sessions.running import find_stroke, last_place
from ..sessions.sculpting import change_stroke, queue_stroke
from ..settings import devices
from ..settings.declared import title
from ..strokes.falloff import Falloff
from ..strokes.stroke import (
    DEEPEST,
    PLACED,
    STAMPS,
    Brush,
    Place,
    deepen,
    draw,
    lay_line,
    lay_ring,
    lay_square,
    let_go,
    needs_blister,
    pull,
    start,
)
from ..strokes.tracking import find_tracking
from ..ui_text import localize
from .action import Drawing, Modal, Polled, Result, clear_status, inform, show_status
from .poll_messages import no_place, no_tool
from .press_settings import PressSettings
from .session_loop import Session

#: How far a turn of the wheel takes the surface up, m.
WHEEL = 0.25e-3
MOVES = frozenset({"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"})
WHEELS = {"WHEELUPMOUSE": WHEEL, "WHEELDOWNMOUSE": -WHEEL}
KEYS = "{}  |  Ctrl and wheel: depth or height  |  Esc or right click: take the stroke back"
KEYS_PLAIN = "{}  |  Esc or right click: take the stroke back"
#: Reports where a brush cannot work.
NO_BLISTER = (
    "{} needs a blister, which the method {} lacks: choose Virtual master or Cell states (Control)"
)
HIDDEN = "{} hides the bed here: press beside it, look from elsewhere, or hide it (H)"
RECOVERS = "These pins will not stay: the method {} moves all pins back"
#: Result of a press on something else: Blender shows no reports of an operator that only passes.
NOT_PRESSED = {"CANCELLED", "PASS_THROUGH"}


class Press(PressSettings, Modal, Operator):
    """Press the fingertip into the pins under the mouse, and drag it"""

    bl_idname = "digiclay.press"
    bl_label = "Press"
    bl_options = {"INTERNAL", "UNDO"}
    needs = (no_place,)

    def prepare(self, context: Context, event: Event) -> Result | None:
        """Begin where the mouse points; beside the bed there is nothing to press."""
        # Shift and Ctrl change the brush for as long as this stroke lasts.
        self.kind = brush.choose_brush(self.brush, event)
        if brush.find_path(self, self.kind) != "FREE":
            return {"PASS_THROUGH"}  # to the operator of lines, rings and stamps
        target = find_pressed(self, context, brush.find_press(context, event), self)
        if target is None:
            return NOT_PRESSED
        options = brush.find_options(self, self.kind)
        session = open_session(self, context, target.bed, self.kind, options["falloff"])
        if session is None:
            return {"CANCELLED"}
        # The hand draws on the surface it has seen when it began, not on pins that give way under
        # it.
        self.uid, self.grid, self.canvas = session.uid, target.grid, target.canvas.copy()
        self.full = 1e-3 * getattr(self, brush.amount_name(self.kind))
        self.strength = brush.read_own(self, "strength", self.kind)
        self.pressure, self.lean = 1.0, (0.0, 0.0)
        self.button = begin_button(event.value, (event.type_prev, event.value_prev))
        self._feel(context, target.bed, event)
        self.lagged = place = find_place(target.point)
        depth, share = self._amount()
        images = brush.find_images(self)
        options |= devices.read_sizes(target.bed)
        stroke = start(0, *place, depth, images, self.kind, share, self.lean, **options)
        session, self.number = queue_stroke(session, stroke)
        running.put(session)
        self._show(context)
        return None

    def borrow(self, context: Context) -> None:
        self.timer = loop.time_window(context)

    def modal(self, context: Context, event: Event) -> Result:
        """Draw the stroke on; other events are passed to Blender, to turn the view for instance."""
        bed = brush.find_bed(bpy.context, self.uid)
        session = running.find(bed)
        stroke = session and find_stroke(session, self.number)
        if session is None or stroke is None:
            if bed is None or session is None:
                inform(
                    self, "The press stroke ended: its session or bed was removed", level="WARNING"
                )
            return self._end({"CANCELLED", "PASS_THROUGH"})
        pressed = event.value == "PRESS"
        if pressed and (event.type in ("ESC", "RIGHTMOUSE") or _is_undo_key(context, event)):
            tick.bring_back(context, bed, sculpting.withdraw_stroke(session))
            return self._end({"CANCELLED"})
        if self._is_released(event):
            self._change(let_go)
            return self._end({"FINISHED", "PASS_THROUGH"})
        if event.type in MOVES:
            self._move(context, bed, event)
        elif event.type in WHEELS and event.ctrl and self.kind.has_amount:
            self._deepen(WHEELS[event.type] if self.kind.rises else -WHEELS[event.type])
        elif event.type == "LEFTMOUSE":
            self._move(context, bed, event)
            self._change(let_go)
            # A press while it is down: another operator has had the release. That one is another
            # stroke.
            again = {"PASS_THROUGH"} if event.value == "PRESS" else set()
            return self._end({"FINISHED"} | again)
        else:
            return {"PASS_THROUGH"}
        self._show(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Context) -> None:
        self._change(let_go)
        self._end(set())

    def _move(self, context: Context, bed: Object, event: Event) -> None:
        """Draw on to the place under the mouse."""
        with context.temp_override(region=self.region):
            self._feel(bpy.context, bed, event)
        place = hit_place(self, context, bed, event)
        if place is not None and event.value != "PRESS":
            # Released, the stroke goes on to the mouse: a stabilized one has not come there yet.
            string = 1e-3 * self.stabilizer if event.type != "LEFTMOUSE" else 0.0
            x, y = self.lagged = pull(self.lagged, place, string)
            depth, share = self._amount()
            self._change(partial(draw, x=x, y=y, depth=depth, share=share, lean=self.lean))

    def _deepen(self, by: float) -> None:
        """Change depth or height of this stroke, m, from here on; the setting of the tool stays."""
        self.full = min(max(self.full + by, 0.0), DEEPEST)
        self._change(partial(deepen, by=by * self.strength * self.pressure))

    def _amount(self) -> Place:
        """Return depth or height, m, and share of a sample drawn now."""
        share = float(self.strength * self.pressure)
        return float(self.full) * share, share

    def _change(self, change: Any) -> None:
        """Put a changed stroke into the session's queue."""
        session = running.find(brush.find_bed(bpy.context, self.uid))
        if session is not None:
            put = beds.put if change is let_go else running.put
            put(change_stroke(session, self.number, change))

    def _feel(self, context: Context, bed: Object, event: Event) -> None:
        """Take a pen's pressure and tilt."""
        if self.use_pressure and event.is_tablet:
            self.pressure = pointer.find_share(float(event.pressure), self.pressure_curve)
        if self.use_tilt and event.is_tablet:
            self.lean = pointer.find_lean(tuple(event.tilt), aim.find_view(context, bed))

    def _is_released(self, event: Event) -> bool:
        """Return whether the button is up though no release has come: a pie menu, say, has had it."""
        if event.type == "LEFTMOUSE":
            return False
        self.button = read_event(self.button, event.type, (event.type_prev, event.value_prev))
        return self.button.up

    def _show(self, context: Context) -> None:
        """Show brush, depth or height, and keys in the status bar."""
        words = brush.describe_stroke(self.kind, self.full, self.strength * self.pressure)
        show_status(context, localize(KEYS if self.kind.has_amount else KEYS_PLAIN, words))

    def _end(self, result: Result) -> Result:
        """Give back the status bar, and the timer."""
        clear_status()
        if self.timer is not None:
            bpy.context.window_manager.event_timer_remove(self.timer)
            self.timer = None
        return result


def _is_undo_key(context: Context, event: Event) -> bool:
    """Return whether an event is the user's key for Undo: a stroke that is being drawn has no step yet."""
    keymap = context.window_manager.keyconfigs.user.keymaps.get("Screen")
    return any(
        item.idname == "ed.undo"
        and item.active
        and item.type == event.type
        and all(
            bool(getattr(item, key)) == getattr(event, key)
            for key in ("ctrl", "shift", "alt", "oskey")
        )
        for item in (keymap.keymap_items if keymap else ())
    )


def find_pressed(
    operator: Operator, context: Context, xy: Place, settings: OperatorProperties
) -> aim.Target | None:
    """Return the place on a bed under a pixel of the region; the operator reports what hides it."""
    target, hider = aim.look_at(context, xy, settings.project)
    if hider is not None:
        inform(operator, HIDDEN, hider.name, level="WARNING")
    return target if hider is None else None


def find_place(point: Floats) -> Place:
    """Return where a point (3,) of a bed is in plan, m."""
    x, y, _ = point.tolist()
    return x, y


def hit_place(operator: Operator, context: Context, bed: Object, event: Event) -> Place | None:
    """Return the place of a bed under the mouse, m, on the surface that an operator began on; or None."""
    with context.temp_override(region=operator.region):
        point = aim.hit_point(
            bpy.context, bed, operator.grid, operator.canvas, operator.locate(event)
        )
    return None if point is None else find_place(point)


def open_session(
    operator: Operator,
    context: Context,
    bed: Object,
    kind: Brush,
    falloff: Falloff = Falloff.DEVICE,
) -> running.Running | None:
    """Return the session of a bed for a stroke, started if there is none; or report why it cannot be."""
    brush.take_finger(context, bed)
    try:
        if running.find(bed) is None:
            context.view_layer.objects.active = bed
            if reason := Session.poll_message(context):
                raise DigiclayError(localize(reason))
            bpy.ops.digiclay.session("INVOKE_DEFAULT")
        session = running.find(bed)
        if session is not None and session.stale:  # the stroke is drawn on what undo has put there
            context.view_layer.update()
            session = tick.take_up(context, bed, session)
            tick.show(bed, session)
        if session is None:
            raise DigiclayError(
                f"The session of {bed.name} could not be started; its panel says why."
            )
    except (DigiclayError, RuntimeError) as error:
        operator.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
        return None
    if needs_blister(kind, falloff) and find_tracking(session.scene, session.system) is None:
        names = brush.LABELS[kind], title(session.scene.method)
        inform(operator, NO_BLISTER, *map(localize, names), level="ERROR")
        return None
    if (
        kind in (Brush.SMOOTH, *PLACED)
        and session.scene.control
        and METHODS[session.scene.method].recovers
    ):
        inform(operator, RECOVERS, localize(title(session.scene.method)), level="WARNING")
    if session.paused:
        words = localize("The session is paused: the fingertip follows after it resumes")
        operator.report({"WARNING"}, words)
    beds.deselect(bed)
    loop.LOOP.ending = False
    return session


#: Path between two places of the bed, by the tool's setting.
SHAPES = {
    "LINE": lay_line,
    "RING": lay_ring,
    "STAMP": lay_square,
}
SHAPE_KEYS = {
    "LINE": "Length {:.1f} mm  |  Release: form the line  |  Esc or right click: cancel",
    "RING": "Radius {:.1f} mm  |  Release: form the ring  |  Esc or right click: cancel",
    "STAMP": "Half width {:.1f} mm  |  Release: stamp  |  Esc or right click: cancel",
}


def _no_shape(context: Context) -> str:
    """The tool is set to free strokes, or another one is in use: the press is for another operator."""
    settings = brush.tool_settings(context)
    chosen = settings is not None and brush.find_path(settings, Brush(settings.brush)) in SHAPES
    return "" if chosen else "Select the Press tool, and Line, Ring or Stamp in its header"


class PressShape(Drawing, Operator):
    """Form a line from the place under the mouse, or a ring or stamp about it, by dragging to its end"""

    bl_idname = "digiclay.press_shape"
    bl_label = "Press Line or Ring"
    bl_options = {"INTERNAL", "UNDO"}
    needs = (_no_shape,)

    def prepare(self, context: Context, event: Event) -> Result | None:
        settings: OperatorProperties = brush.tool_settings(context)
        self.kind = brush.choose_brush(settings.brush, event)
        self.shape = brush.find_path(settings, self.kind)
        if self.shape not in SHAPES:
            return {"PASS_THROUGH"}  # Shift smooths along a free path
        target = find_pressed(self, context, brush.find_press(context, event), settings)
        if target is None:
            return NOT_PRESSED
        self.uid, self.grid, self.height = target.bed.session_uid, target.grid, target.height.copy()
        self.canvas = target.canvas.copy()
        self.start = self.to = find_place(target.point)
        self._show(context)
        return None

    def modal(self, context: Context, event: Event) -> Result:
        """Draw the path until the mouse button is released; the view can be turned meanwhile."""
        bed = brush.find_bed(context, self.uid)
        if bed is None or brush.tool_settings(context) is None:
            return self.end(context, "CANCELLED", "PASS_THROUGH")
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self.end(context, "CANCELLED")
        if event.type not in ("MOUSEMOVE", "LEFTMOUSE"):
            return {"PASS_THROUGH"}
        self.to = hit_place(self, context, bed, event) or self.to
        self._show(context)
        if event.type == "MOUSEMOVE":
            return {"RUNNING_MODAL"}
        self.end(context)
        return _queue_path(self, context, bed, self._lay(), self.kind)

    def _lay(self) -> Floats:
        """Return the path of the stroke, (k, 2), m: that of a stamp is from its middle to its right side."""
        return lay_line(self.start, self.to) if self.shape == "STAMP" else self._path()

    def _path(self) -> Floats:
        """Return what is drawn of the path as it is now, (k, 2), m."""
        return SHAPES[self.shape](self.start, self.to)

    def _show(self, context: Context) -> None:
        """Show the length or the radius, and draw the path."""
        length = float(np.hypot(self.to[0] - self.start[0], self.to[1] - self.start[1]))
        self.words = localize(SHAPE_KEYS[self.shape], 1e3 * length)
        settings, bed = brush.tool_settings(context), brush.find_bed(context, self.uid)
        sizes = devices.read_sizes(bed)
        ghost.plan(self.uid, brush.lay_stroke(settings, self._lay(), self.kind, **sizes))
        show_status(context, self.words)
        self.region.tag_redraw()

    def end(self, context: Context, *result: str) -> Result:
        ghost.plan(self.uid, None)
        return super().end(context, *result)

    def draw_view(self, area: Area) -> None:
        context = bpy.context
        bed, settings = brush.find_bed(context, self.uid), brush.tool_settings(context)
        if bed is None or settings is None or context.area != area:
            return
        lines = []
        for image in brush.find_images(settings):
            path = np.array([image.place(*place) for place in self._path()])
            heights = self.height[self.grid.at(path[:, 0], path[:, 1])]
            lines += [np.column_stack([path, heights])] if len(path) > 1 else []
        at = bridge.project(context, bed, np.array([[*self.to, float(self.height.max())]]))[0]
        tool.draw_on_bed(context, bed, lines, self.words.partition("  |")[0], (at[0], at[1] - 14.0))


class PressLine(Polled, Operator):
    """Form a line from the end of the last stroke to the place under the mouse"""

    bl_idname = "digiclay.press_line"
    bl_label = "Press Line from Last Stroke"
    bl_options = {"INTERNAL", "UNDO"}
    needs = (no_tool,)

    def invoke(self, context: Context, event: Event) -> Result:
        """Queue the line; without a stroke before it, the place alone."""
        settings: OperatorProperties = brush.tool_settings(context)
        xy = event.mouse_region_x, event.mouse_region_y
        target = find_pressed(self, context, xy, settings)
        if target is None:
            return NOT_PRESSED
        to = find_place(target.point)
        session = running.find(target.bed)
        start = last_place(session) if session is not None else None
        kind = Brush(settings.brush)
        path = [to] if start is None or kind in STAMPS else lay_line(start, to)
        return _queue_path(self, context, target.bed, path, kind)


def _queue_path(
    operator: Operator, context: Context, bed: Object, path: Floats | list[Place], kind: Brush
) -> Result:
    """Queue a path for the fingertip, as the tool's settings have it."""
    brush.take_finger(context, bed)
    settings, sizes = brush.tool_settings(context), devices.read_sizes(bed)
    stroke = brush.lay_stroke(settings, path, kind, **sizes)
    session = open_session(operator, context, bed, kind, stroke.falloff)
    if session is None:
        return {"CANCELLED"}
    session, _ = queue_stroke(session, stroke)
    beds.put(session)
    return {"FINISHED"}
