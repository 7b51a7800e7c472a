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
from ..live import beds, follow, handlers, loop, tick
from ..live.beds import active_session
from ..recorded import takes
from ..roles import bed_of, fingertip_of
from ..sessions import running, sculpting
from ..sessions.running import Running
from ..settings import properties
from ..settings.declared import flag, text
from ..ui_text import localize
from .action import Action, action
from .poll_messages import no_gesture, no_server, no_session, nothing_to_reset, session_waits


def _session(context: Any) -> tuple[Any, Running]:
    """Return the bed and the session that an action is about, which its poll has found."""
    active = active_session(context)
    assert active is not None
    return active


@action("digiclay.session_pause", "Pause or Resume", no_session, options=(), in_any_mode=True)
def pause_session(operator: Any, context: Any) -> None:
    """Pause or resume the bed; on resume the fingertip path is straight to its current position"""
    _, session = _session(context)
    running.put(replace(session, paused=not session.paused))
    loop.redraw_status()


@action("digiclay.session_step", "Single Step", no_session, options=(), in_any_mode=True)
def step_session(operator: Any, context: Any) -> None:
    """Simulate one control period; a running session is paused"""
    running.put(sculpting.request_step(_session(context)[1]))
    loop.redraw_status()


@action("digiclay.session_stop", "Stop Session", no_session, options=("UNDO",), in_any_mode=True)
def stop_session(operator: Any, context: Any) -> None:
    """Stop the session of the bed; the bed keeps its state, from which another session continues"""
    handlers.end(handlers.STOPPED, _session(context)[1])


@action("digiclay.session_rewind", "Take Back a Gesture", session_waits, no_gesture, options=("UNDO",))
def rewind_session(operator: Any, context: Any) -> None:
    """Undo the last gesture: bed and fingertip return to its start"""
    bed, session = _session(context)
    back = sculpting.rewind(session)
    if session.recording is not None and back.recording is None:
        words = takes.keep_recording(bed, session)
        operator.report({"INFO"}, words or localize("The recording ended: the gesture began before it"))
    tick.show(bed, back)
    tick.place_finger(context, bed, back)


@action(
    "digiclay.session_reset", "Reset", nothing_to_reset, options=("UNDO",),
    running_only=flag(
        "Only While It Runs", "Exclude beds without a session, so that the key cannot reset them by accident",
        options={"HIDDEN", "SKIP_SAVE"},
    ),
)  # fmt: skip
def reset_session(operator: Any, context: Any) -> set[str] | None:
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
    back = sculpting.reset(session)
    tick.show(bed, back)
    tick.place_finger(context, bed, back)
    if words:
        operator.report({"INFO"}, words)
    return None


def _bring_to_rest(bed: Any) -> None:
    """Bring a bed without a session to rest."""
    scene = properties.scene_of(bed)
    system = assemble(scene)
    beds.clear(bed)
    view.show_state(bed, system, begin(system))
    tip = fingertip_of(bed)
    if tip is not None:
        pose = bridge.pose(tip)
        pose[2] = max(pose[2], scene.actuator.rest_height + CLEARANCE)
        bridge.place_fingertip(tip, pose, find_ellipsoid(scene))


class FollowServer(Action, bpy.types.Operator):
    """Move the fingertip with that of a server, digiclay serve, by OSC; the bed forms as under the hand"""

    bl_idname = "digiclay.follow_server"
    bl_label = "Follow a Server"
    in_any_mode = True
    needs = (no_session,)

    address: text("Address", "Address and port that the server prints for OSC", default="127.0.0.1:8766")
    token: text("Token", "Token that the server prints; no file keeps it", subtype="PASSWORD")

    def invoke(self, context: Any, event: Any) -> set[str]:
        return set(context.window_manager.invoke_props_dialog(self))

    def perform(self, context: Any) -> None:
        uid = _session(context)[1].uid
        try:
            follow.begin(uid, self.address, self.token, online=bool(bpy.app.online_access))
        except OSError as error:
            words = localize("{} cannot be reached: {}", self.address, error.strerror or error)
            raise DigiclayError(words) from None


@action("digiclay.leave_server", "Stop Following", no_server, options=(), in_any_mode=True)
def leave_server(operator: Any, context: Any) -> None:
    """Move the fingertip by hand again"""
    follow.end(_session(context)[1].uid)
