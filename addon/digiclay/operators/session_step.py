"""Let a paused session do one control period."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import loop, running, sculpting
from .reasons import allowed, no_session
from .session_context import session_of

__all__ = ["StepSession"]


class StepSession(bpy.types.Operator):  # type: ignore[misc]
    """Let the bed do one control period and stand still; a session that runs is paused"""

    bl_idname = "digiclay.session_step"
    bl_label = "Single Step"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session is needed."""
        return allowed(cls, no_session(context))

    def execute(self, context: Any) -> set[str]:
        """Ask for one more; the next tick does it."""
        _, session = session_of(context)
        running.put(sculpting.stepped(session))
        loop.status_changed()
        return {"FINISHED"}
