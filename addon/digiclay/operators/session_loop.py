"""Live sessions: their modal operator, with ticks, Esc and Blender's auto save, and the actions on them.

Blender postpones its automatic saving for as long as any modal operator runs, so a session of an
hour would be lost in a crash. The operator therefore ends for a moment every so often, and is
started anew.
"""

import time
from dataclasses import replace

import numpy as np

from .. import bridge, preferences
from ..compat import Context, Event, Menu, Object, Operator, Window, bpy
from ..core.base.errors import DigiclayError
from ..core.engine.simulation import begin
from ..core.scene.assembly import assemble
from ..device import view
from ..device.instant import CLEARANCE, find_ellipsoids
from ..live import beds, follow, handlers, loop, tick
from ..live.beds import active_session
from ..overlay import views
from ..overlay.ready_view import light
from ..panels.display import show_details
from ..press import tool
from ..recorded import takes
from ..roles import bed_of
from ..sessions import running, sculpting
from ..sessions.running import Running
from ..settings import properties
from ..settings.declared import flag, text
from ..strokes.sweep import estimate_time
from ..ui_text import localize
from . import poll_messages as poll
from .action import Action, Modal, Polled, Result, action, become_modal, inform

#: How often Blender gets a moment to save by itself, and how long that is, s. It tries every 10 ms.
EVERY, MOMENT = 20.0, 0.1
#: Message of sessions whose window is gone.
CLOSED = "ended: its window was closed"


class Ticking(Polled):
    """Mixin of the operators that advance sessions."""

    in_any_mode = True

    def advance(self, context: Context, now: float) -> None:
        """Advance all sessions until `now`, s."""
        self.tell(tick.tick(context, now))

    def tell(self, notes: list[tick.Note]) -> None:
        """Report the messages, and keep them for the panel."""
        for note in notes:
            self.report({note.level}, note.message)
            running.set_message(note.message, note.uid)


class LoopMixin(Ticking):
    """Mixin of the modal operators for the sessions of a window."""

    def drive(self, context: Context) -> Result:
        """Begin to drive the loop."""
        loop.LOOP.aside = False
        self.token, self.since = loop.token(), time.perf_counter()
        self.newer = _other_operators(context)
        # Of the window alone: an area that it is started from goes when a view is maximized.
        with context.temp_override(area=None, region=None):
            return become_modal(self, context)

    def modal(self, context: Context, event: Event) -> Result:
        """Tick with the timer; pass every other event on."""
        if self.token != loop.token():
            return {"CANCELLED"}
        if (
            event.type == "ESC"
            and event.value == "PRESS"
            and not self.newer & _other_operators(context)
        ):
            return {"FINISHED"} if _stop(self, context) else {"RUNNING_MODAL"}
        now = time.perf_counter()
        if event.type != "TIMER" or not loop.is_due(context, now):
            return {"PASS_THROUGH"}
        self.advance(context, now)
        loop.redraw_numbers(context, now)
        if loop.LOOP.ending and _stop(self, context):
            return {"FINISHED"}
        if not running.list_sessions():
            handlers.end_all(handlers.STOPPED)
            return {"FINISHED"}
        autosaves = context.preferences.filepaths.use_auto_save_temporary_files
        if now - self.since > EVERY and autosaves and not _other_operators(context):
            _resume_later(self.token, context.window)
            return {"FINISHED", "PASS_THROUGH"}
        return {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        """End with the window the loop was started in, or with Blender."""
        if self.token != loop.token():
            return
        # A window that was closed is listed no more; when Blender quits, all still are.
        if context.window in context.window_manager.windows[:]:
            handlers.end_with_file("ended: Blender quits")
        else:
            handlers.end_all(CLOSED)

    def give_up(self, context: Context, words: str) -> None:
        """End all sessions: nothing drives them any more."""
        handlers.end_all(localize("ended: {}", words))


class GoOn(LoopMixin, Operator):
    """Continue the sessions after Blender's auto save"""

    bl_idname = "digiclay.session_go_on"
    bl_label = "Go On"
    bl_options = {"INTERNAL"}
    needs = (poll.no_undriven,)

    def invoke(self, context: Context, event: Event) -> Result:
        return self.drive(context)


class FinishStrokes(Ticking, Modal, Operator):
    """Finish all press strokes at once, without drawing them meanwhile; Esc lets them go on as before"""

    bl_idname = "digiclay.finish_strokes"
    bl_label = "Finish Strokes"
    needs = (poll.no_stroke,)

    def prepare(self, context: Context, event: Event) -> None:
        self.whole = _estimate_time()

    def borrow(self, context: Context) -> None:
        """Have the loop hurry, beside which this one shows the progress and takes Esc."""
        self.timer, loop.LOOP.in_haste = loop.time_window(context), True
        views.stop()  # its curves would have the views drawn
        context.window_manager.progress_begin(0, 100)

    def modal(self, context: Context, event: Event) -> Result:
        """End with the strokes, or at Esc; the loop has every other event."""
        if event.type == "ESC" and event.value == "PRESS":
            return self._end(context, "CANCELLED")
        if not (loop.LOOP.in_haste and tick.has_strokes()):
            return self._end(context, "FINISHED", "PASS_THROUGH")
        if event.type == "TIMER":
            done = 1.0 - _estimate_time() / self.whole
            context.window_manager.progress_update(int(100.0 * max(0.0, done)))
        return {"PASS_THROUGH"}

    def execute(self, context: Context) -> Result:
        """Finish them before anything else, as a script would have it; not what waits, for a hand say."""
        before: list[int] = []
        while tick.has_strokes() and before != (
            now := [session.state.period for session in running.list_sessions()]
        ):
            before = now
            self.advance(context, time.perf_counter())
        return {"FINISHED"}

    def cancel(self, context: Context) -> None:
        self._end(context)

    def _end(self, context: Context, *result: str) -> Result:
        """Give back the cursor and the timer, and let the loop take its time again; return the result."""
        tick.end_haste(context)
        views.follow()
        context.window_manager.progress_end()
        if self.timer is not None:
            context.window_manager.event_timer_remove(self.timer)
            self.timer = None
        return set(result)


@action(
    "digiclay.session_escape", "Stop Sessions", poll.driven, options=("INTERNAL",), in_any_mode=True
)
def escape(operator: Operator, context: Context) -> None:
    """Stop the sessions while none of their operators receives the key"""
    _stop(operator, context)


def _estimate_time() -> float:
    """Return about how long the strokes of all sessions still take, s of simulated time."""
    return sum(estimate_time(session.strokes) for session in running.list_sessions())


def _stop(operator: Operator, context: Context) -> bool:
    """End all sessions as soon as drawn strokes are formed; return whether they have ended."""
    if not tick.has_strokes():
        handlers.end_all(handlers.STOPPED)
        return True
    if not loop.LOOP.ending:
        inform(operator, "The sessions stop as soon as the drawn strokes are formed")
    loop.LOOP.ending = True
    return False


def _other_operators(context: Context) -> frozenset[int]:
    """Return the modal operators of all windows but those that drive sessions."""
    loops = ("DIGICLAY_OT_session", "DIGICLAY_OT_session_go_on")
    windows = context.window_manager.windows
    every = (operator for window in windows for operator in window.modal_operators)
    return frozenset(operator.as_pointer() for operator in every if operator.bl_idname not in loops)


def _resume_later(token: int, window: Window) -> None:
    """Have the loop driven again in a moment, unless it ended or its window was closed meanwhile."""
    loop.LOOP.aside = True
    handlers.write_recovery()  # in case Blender saves the file in this moment
    pointer = window.as_pointer()

    def go_on() -> None:
        if token != loop.token():
            return
        handlers.clear_recovery()
        windows = bpy.context.window_manager.windows
        same = next((window for window in windows if window.as_pointer() == pointer), None)
        if same is None:
            handlers.end_all(CLOSED)
            return
        with bpy.context.temp_override(window=same):
            bpy.ops.digiclay.session_go_on("INVOKE_DEFAULT")

    bpy.app.timers.register(go_on, first_interval=MOMENT)


def leave_mode(context: Context) -> None:
    """Leave the active object's mode, for instance that of the Sculpting workspace, for Object Mode."""
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


@action(
    "digiclay.leave_mode", "Back to Object Mode", poll.no_bed, poll.in_object_mode, in_any_mode=True
)
def to_object_mode(operator: Operator, context: Context) -> None:
    """Leave this mode for Object Mode, in which beds are sculpted, with the Press tool in hand"""
    leave_mode(context)
    if context.window is not None:
        tool.take_up(context)


def leave_entry(menu: Menu, context: Context) -> None:
    """Offer the way back after the menus of a 3D view's header, as in the Sculpting workspace."""
    if not to_object_mode.poll_message(context):
        menu.layout.operator(to_object_mode.bl_idname, icon="LOOP_BACK")


class Session(LoopMixin, Action, Operator):
    """Start sculpting: the pins follow the fingertip, which any tool can move. Esc stops"""

    bl_idname = "digiclay.session"
    bl_label = "Start Session"
    needs = (
        poll.cannot_form,
        poll.session_runs.reworded("A session runs on this bed already: Esc stops it"),
        poll.baked,
        poll.no_window,
    )

    def invoke(self, context: Context, event: Event) -> Result:
        return self.execute(context)

    def perform(self, context: Context) -> Result | None:
        """Start the session, and the loop unless another session's drives this one as well."""
        bed = bed_of(context)
        if context.mode != "POSE":  # in which an armature moves a presser
            leave_mode(context)
        notes = tick.start(context, bed)
        notes = notes or [
            tick.Note("INFO", localize("The session of {} runs: Esc stops it", bed.name))
        ]
        self.tell([note._replace(uid=bed.session_uid) for note in notes])
        handlers.watch()
        views.follow()
        if preferences.get(context).take_press_tool and context.mode == "OBJECT":
            tool.take_up(context)
        beds.deselect(bed)
        view.show_form(bed)
        light(context)
        show_details(bed.digiclay_display, context)
        # The state stands in the bed by now, so that undoing the first gesture finds it.
        bpy.ops.ed.undo_push(message="Start Session")
        if loop.is_running():
            return None
        loop.begin(context)
        return self.drive(context)


def _session(context: Context) -> tuple[Object, Running]:
    """Return the bed and the session that an action is about, which its poll has found."""
    active = active_session(context)
    assert active is not None
    return active


@action("digiclay.session_pause", "Pause or Resume", poll.no_session, options=(), in_any_mode=True)
def pause_session(operator: Operator, context: Context) -> None:
    """Pause or resume the bed; on resume the fingertip path is straight to its current position"""
    _, session = _session(context)
    running.put(replace(session, paused=not session.paused))
    loop.redraw_status()


@action("digiclay.session_step", "Single Step", poll.no_session, options=(), in_any_mode=True)
def step_session(operator: Operator, context: Context) -> None:
    """Simulate one control period; a running session is paused"""
    running.put(sculpting.request_step(_session(context)[1]))
    loop.redraw_status()


@action(
    "digiclay.session_stop", "Stop Session", poll.no_session, options=("UNDO",), in_any_mode=True
)
def stop_session(operator: Operator, context: Context) -> None:
    """Stop the session of the bed; the bed keeps its state, from which another session continues"""
    handlers.end(handlers.STOPPED, _session(context)[1])


@action(
    "digiclay.session_rewind",
    "Take Back a Gesture",
    poll.session_waits,
    poll.no_gesture,
    options=("UNDO",),
)
def rewind_session(operator: Operator, context: Context) -> None:
    """Undo the last gesture: bed and fingertip return to its start"""
    bed, session = _session(context)
    back = sculpting.rewind(session)
    if session.recording is not None and back.recording is None:
        words = takes.keep_recording(bed, session)
        operator.report(
            {"INFO"}, words or localize("The recording ended: the gesture began before it")
        )
    tick.bring_back(context, bed, back)
    if back.scene.bodies:
        inform(operator, "Pressers stay where they are")


@action(
    "digiclay.session_reset",
    "Reset",
    poll.nothing_to_reset,
    options=("UNDO",),
    running_only=flag(
        "Only While It Runs",
        "Exclude beds without a session, so that the key cannot reset them by accident",
        options={"HIDDEN", "SKIP_SAVE"},
    ),
)
def reset_session(operator: Operator, context: Context) -> Result | None:
    """Return all pins to rest and lift the fingertip off them"""
    active = active_session(context)
    if active is None:
        if operator.running_only:
            return {"PASS_THROUGH"}
        _bring_to_rest(bed_of(context))
        return None
    bed, session = active
    # What a session has done can be taken back: its recording is stored as a take.
    words = takes.keep_recording(bed, session)
    tick.bring_back(context, bed, sculpting.reset(session))
    if words:
        operator.report({"INFO"}, words)
    return None


def _bring_to_rest(bed: Object) -> None:
    """Bring a bed without a session to rest."""
    scene = properties.scene_of(bed)
    system = assemble(scene)
    beds.clear(bed)
    view.show_state(bed, system, begin(system))
    poses = bridge.poses(bed)
    poses[:, 2] = np.maximum(poses[:, 2], scene.actuator.rest_height + CLEARANCE)
    bridge.place_fingertips(bed, poses, find_ellipsoids(scene))


class FollowServer(Action, Operator):
    """Move the fingertip with that of a server, digiclay serve, by OSC; the bed forms as under the hand"""

    bl_idname = "digiclay.follow_server"
    bl_label = "Follow a Server"
    in_any_mode = True
    needs = (poll.no_session,)

    address: text(
        "Address", "Address and port that the server prints for OSC", default="127.0.0.1:8766"
    )
    token: text("Token", "Token that the server prints; no file keeps it", subtype="PASSWORD")

    def invoke(self, context: Context, event: Event) -> Result:
        return set(context.window_manager.invoke_props_dialog(self))

    def perform(self, context: Context) -> None:
        uid = _session(context)[1].uid
        try:
            follow.begin(uid, self.address, self.token, online=bool(bpy.app.online_access))
        except OSError as error:
            words = localize("{} cannot be reached: {}", self.address, error.strerror or error)
            raise DigiclayError(words) from None


@action("digiclay.leave_server", "Stop Following", poll.no_server, options=(), in_any_mode=True)
def leave_server(operator: Operator, context: Context) -> None:
    """Move the fingertip by hand again"""
    follow.end(_session(context)[1].uid)
