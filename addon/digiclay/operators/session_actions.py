"""Actions on a live session: pause, step, stop, rewind, reset; on a bed at rest: reset."""

from dataclasses import replace
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..core.engine.simulation import begin
from ..core.scene.assembly import assemble
from ..device import view
from ..device.instant import CLEARANCE, find_ellipsoid
from ..device.view import bed_of
from ..live import bed_state, follow, gestures, handlers, loop, running, sculpting, tick
from ..live.running import Running
from ..live.waiting import active_session
from ..recorded import takes
from ..settings import properties
from ..ui_text import localize
from .action import Action
from .poll_messages import no_bed, no_session, session_waits


class OfSession(Action):
    """Mixin of an action on the session that `active_session` finds."""

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A session is needed."""
        return no_session(context)

    def perform(self, context: Any) -> set[str] | None:
        """Change the session."""
        active = active_session(context)
        assert active is not None  # so says the poll
        self.change(context, *active)
        return None

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Change a session. `context` bpy.types.Context; `bed` bpy.types.Object."""
        raise NotImplementedError


class PauseSession(OfSession, bpy.types.Operator):
    """Pause or resume the bed; on resume the fingertip path is straight to its current position"""

    bl_idname = "digiclay.session_pause"
    bl_label = "Pause or Resume"
    in_any_mode = True

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Turn it over."""
        running.put(replace(session, paused=not session.paused))
        loop.redraw_status()


class StepSession(OfSession, bpy.types.Operator):
    """Simulate one control period; a running session is paused"""

    bl_idname = "digiclay.session_step"
    bl_label = "Single Step"
    in_any_mode = True

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Request one more; the next tick simulates it."""
        running.put(sculpting.request_step(session))
        loop.redraw_status()


class StopSession(OfSession, bpy.types.Operator):
    """Stop the session of the bed; the bed keeps its state, from which another session continues"""

    bl_idname = "digiclay.session_stop"
    bl_label = "Stop Session"
    bl_options = {"UNDO"}
    in_any_mode = True

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Stop it."""
        handlers.end(handlers.STOPPED, session)


class RewindSession(OfSession, bpy.types.Operator):
    """Undo the last gesture: bed and fingertip return to its start"""

    bl_idname = "digiclay.session_rewind"
    bl_label = "Take Back a Gesture"
    bl_options = {"UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A session with a gesture is needed."""
        return session_waits(context) or _no_gesture(context)

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Go back, the fingertip along with the bed."""
        back = gestures.rewind(session)
        if session.recording is not None and back.recording is None:
            kept = takes.keep_recording(bed, session)
            self.report({"INFO"}, kept or localize("The recording ended: the gesture began before it"))
        tick.show(bed, back)
        tick.place_finger(context, bed, back)


class ResetSession(OfSession, bpy.types.Operator):
    """Return all pins to rest and lift the fingertip off them"""

    bl_idname = "digiclay.session_reset"
    bl_label = "Reset"
    bl_options = {"UNDO"}

    running_only: bpy.props.BoolProperty(
        name="Only While It Runs",
        description="Exclude beds without a session, so that the key cannot reset them by accident",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed that has left its rest is needed."""
        if active_session(context) is not None:
            return session_waits(context)
        return no_bed(context) or _at_rest(context)

    def perform(self, context: Any) -> set[str] | None:
        """Begin anew; what a session has done can be taken back."""
        if active_session(context) is not None:
            super().perform(context)
        elif self.running_only:
            return {"PASS_THROUGH"}
        else:
            _bring_to_rest(bed_of(context))
        return None

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Begin anew, the recording kept as a take."""
        kept = takes.keep_recording(bed, session)
        back = gestures.reset(session)
        tick.show(bed, back)
        tick.place_finger(context, bed, back)
        if kept:
            self.report({"INFO"}, kept)


def _no_gesture(context: Any) -> str:
    """The fingertip has formed nothing yet."""
    active = active_session(context)
    formed = active is not None and (active[1].gestures or active[1].strokes)
    return "" if formed else "There is no gesture to take back: the fingertip has not touched since"


def _at_rest(context: Any) -> str:
    """There is nothing to bring back."""
    return "The bed is at rest already" if bed_state.read_snapshot(bed_of(context)) is None else ""


def _bring_to_rest(bed: Any) -> None:
    """Bring a bed without a session to rest."""
    scene = properties.scene_of(bed)
    system = assemble(scene)
    bed_state.clear(bed)
    view.show_state(bed, system, begin(system))
    tip = view.fingertip_of(bed)
    if tip is not None:
        pose = bridge.pose(tip)
        pose[2] = max(pose[2], scene.actuator.rest_height + CLEARANCE)
        bridge.place_fingertip(tip, pose, find_ellipsoid(scene))


class FollowServer(Action, bpy.types.Operator):
    """Move the fingertip with that of a server, digiclay serve, by OSC; the bed forms as under the hand"""

    bl_idname = "digiclay.follow_server"
    bl_label = "Follow a Server"
    in_any_mode = True

    address: bpy.props.StringProperty(
        name="Address",
        description="Address and port that the server prints for OSC",
        default="127.0.0.1:8766",
    )
    token: bpy.props.StringProperty(
        name="Token", description="Token that the server prints; no file keeps it", subtype="PASSWORD"
    )

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A session is needed."""
        return no_session(context)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for address and token."""
        result: set[str] = context.window_manager.invoke_props_dialog(self)
        return result

    def perform(self, context: Any) -> set[str] | None:
        """Begin to follow."""
        active = active_session(context)
        assert active is not None  # so says the poll
        online = bool(bpy.app.online_access)
        try:
            follow.begin(active[1].uid, self.address, self.token, online=online)
        except OSError as error:
            words = localize("{} cannot be reached: {}", self.address, error.strerror or error)
            raise DigiclayError(words) from None
        return None


class LeaveServer(Action, bpy.types.Operator):
    """Move the fingertip by hand again"""

    bl_idname = "digiclay.leave_server"
    bl_label = "Stop Following"
    in_any_mode = True

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A session that follows a server is needed."""
        active = active_session(context)
        follows = active is not None and follow.find(active[1].uid) is not None
        return "" if follows else "The session follows no server"

    def perform(self, context: Any) -> set[str] | None:
        """Follow no more; the fingertip stays."""
        active = active_session(context)
        assert active is not None  # so says the poll
        follow.end(active[1].uid)
        return None
