"""Pause a session, and let it go on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..compat import bpy
from ..live import loop, running
from .reasons import allowed, no_session
from .session_context import session_of

__all__ = ["PauseSession"]


class PauseSession(bpy.types.Operator):  # type: ignore[misc]
    """Let the bed stand still, or go on: it then takes the straight way to where the fingertip is"""

    bl_idname = "digiclay.session_pause"
    bl_label = "Pause or Resume"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session is needed."""
        return allowed(cls, no_session(context))

    def execute(self, context: Any) -> set[str]:
        """Turn it over."""
        _, session = session_of(context)
        running.put(replace(session, paused=not session.paused))
        loop.status_changed()
        return {"FINISHED"}
