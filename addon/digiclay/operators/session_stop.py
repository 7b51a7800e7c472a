"""Stop the session of one bed."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import handlers
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
        """Stop it."""
        _, session = session_of(context)
        handlers.ended(handlers.STOPPED, session)
        return {"FINISHED"}
