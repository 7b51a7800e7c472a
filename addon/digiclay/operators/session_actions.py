"""Actions on a live session: pause, step, stop, rewind, reset, follow a server; on a bed at rest: reset."""

from dataclasses import replace
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..core.engine.simulation import begin
from ..core.scene.assembly import assemble
from ..device import view
from ..device.instant import CLEARANCE, find_ellipsoid
from ..live import bed_state, follow, handlers, loop, tick
from ..live.beds import active_session
from ..recorded import takes
from ..roles import bed_of, fingertip_of
from ..sessions import running, sculpting
from ..sessions.running import Running
from ..settings import properties
from ..ui_text import localize
from .action import Action, Needs
from .poll_messages import no_gesture, no_server, no_session, nothing_to_reset, session_waits


class OfSession(Action):
    """Mixin of an action on the session that `active_session` finds."""

    needs: Needs = (no_session,)

    def perform(self, context: Any) -> set[str] | None:
        active = active_session(context)
        assert active is not None  # by the poll
        self.change(context, *active)
        return None

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Change the session of a bed."""
        raise NotImplementedError


class PauseSession(OfSession, bpy.types.Operator):
    """Pause or resume the bed; on resume the fingertip path is straight to its current position"""

    bl_idname = "digiclay.session_pause"
    bl_label = "Pause or Resume"
    in_any_mode = True

    def change(self, context: Any, bed: Any, session: Running) -> None:
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
        handlers.end(handlers.STOPPED, session)


class RewindSession(OfSession, bpy.types.Operator):
    """Undo the last gesture: bed and fingertip return to its start"""

    bl_idname = "digiclay.session_rewind"
    bl_label = "Take Back a Gesture"
    bl_options = {"UNDO"}
    needs = session_waits, no_gesture

    def change(self, context: Any, bed: Any, session: Running) -> None:
        back = sculpting.rewind(session)
        if session.recording is not None and back.recording is None:
            words = takes.keep_recording(bed, session)
            self.report({"INFO"}, words or localize("The recording ended: the gesture began before it"))
        tick.show(bed, back)
        tick.place_finger(context, bed, back)


class ResetSession(OfSession, bpy.types.Operator):
    """Return all pins to rest and lift the fingertip off them"""

    bl_idname = "digiclay.session_reset"
    bl_label = "Reset"
    bl_options = {"UNDO"}
    needs = (nothing_to_reset,)

    running_only: bpy.props.BoolProperty(
        name="Only While It Runs",
        description="Exclude beds without a session, so that the key cannot reset them by accident",
        options={"HIDDEN", "SKIP_SAVE"},
    )

    def perform(self, context: Any) -> set[str] | None:
        """Begin anew; what a session has done can be taken back."""
        if active_session(context) is not None:
            return super().perform(context)
        if self.running_only:
            return {"PASS_THROUGH"}
        _bring_to_rest(bed_of(context))
        return None

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Begin anew, the recording stored as a take."""
        words = takes.keep_recording(bed, session)
        back = sculpting.reset(session)
        tick.show(bed, back)
        tick.place_finger(context, bed, back)
        if words:
            self.report({"INFO"}, words)


def _bring_to_rest(bed: Any) -> None:
    """Bring a bed without a session to rest."""
    scene = properties.scene_of(bed)
    system = assemble(scene)
    bed_state.clear(bed)
    view.show_state(bed, system, begin(system))
    tip = fingertip_of(bed)
    if tip is not None:
        pose = bridge.pose(tip)
        pose[2] = max(pose[2], scene.actuator.rest_height + CLEARANCE)
        bridge.place_fingertip(tip, pose, find_ellipsoid(scene))


class FollowServer(OfSession, bpy.types.Operator):
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

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for address and token."""
        result: set[str] = context.window_manager.invoke_props_dialog(self)
        return result

    def change(self, context: Any, bed: Any, session: Running) -> None:
        try:
            follow.begin(session.uid, self.address, self.token, online=bool(bpy.app.online_access))
        except OSError as error:
            words = localize("{} cannot be reached: {}", self.address, error.strerror or error)
            raise DigiclayError(words) from None


class LeaveServer(OfSession, bpy.types.Operator):
    """Move the fingertip by hand again"""

    bl_idname = "digiclay.leave_server"
    bl_label = "Stop Following"
    in_any_mode = True
    needs = (no_server,)

    def change(self, context: Any, bed: Any, session: Running) -> None:
        """Follow no more; the fingertip stays."""
        follow.end(session.uid)
