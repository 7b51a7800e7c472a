"""Stop the session of one bed."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import handlers, running, tick
from ..overlay import views
from .reasons import allowed, no_session
from .session_context import session_of

__all__ = ["StopSession"]


class StopSession(bpy.types.Operator):  # type: ignore[misc]
    """Stop the session of the bed; it keeps its state, and another session goes on from it"""

    bl_idname = "digiclay.session_stop"
    bl_label = "Stop Session"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session is needed."""
        return allowed(cls, no_session(context))

    def execute(self, context: Any) -> set[str]:
        """Stop it; the last one takes the loop along."""
        _, session = session_of(context)
        tick.stop(session.uid)
        running.say(f"The session of {session.name} was stopped; the bed keeps its state")
        if running.all():
            views.follow()
        else:
            handlers.ended("")
        return {"FINISHED"}
