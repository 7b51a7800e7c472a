"""Take back the last gesture of a session."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import sculpting, tick
from ..recorded import takes
from .session_context import decline_while_waiting, session_of

__all__ = ["RewindSession"]


class RewindSession(bpy.types.Operator):  # type: ignore[misc]
    """Take back the last gesture: bed and fingertip are as they were when it began"""

    bl_idname = "digiclay.session_rewind"
    bl_label = "Take Back a Gesture"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session with a gesture is needed."""
        if not decline_while_waiting(cls, context):
            return False
        if session_of(context)[1].gestures:
            return True
        cls.poll_message_set("There is no gesture to take back: the fingertip has not touched since")
        return False

    def execute(self, context: Any) -> set[str]:
        """Go back, the fingertip along with the bed."""
        bed, session = session_of(context)
        back = sculpting.rewound(session)
        if session.recording is not None and back.recording is None:
            said = takes.keep_recorded(bed, session) or "The recording ended: the gesture began before it"
            self.report({"INFO"}, said)
        tick.show(bed, back)
        tick.place(context, bed, back)
        return {"FINISHED"}
