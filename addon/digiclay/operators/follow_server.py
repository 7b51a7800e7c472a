"""Operators that have a session follow `digiclay serve`, and follow it no more."""

from typing import Any

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..live import follow
from ..live.waiting import active_session
from ..ui_text import localize
from .action import Action
from .poll_messages import no_session


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
