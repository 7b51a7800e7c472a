"""Take back the last gesture of a session."""

from __future__ import annotations

from typing import Any

from ..compat import bpy
from ..live import sculpting, tick
from ..recorded import takes
from .reasons import allowed, session_waits
from .session_context import session_of

__all__ = ["RewindSession"]


class RewindSession(bpy.types.Operator):  # type: ignore[misc]
    """Take back the last gesture: bed and fingertip are as they were when it began"""

    bl_idname = "digiclay.session_rewind"
    bl_label = "Take Back a Gesture"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session with a gesture is needed."""
        return allowed(cls, session_waits(context) or _no_gesture(context))

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


def _no_gesture(context: Any) -> str:
    """The fingertip has formed nothing yet."""
    _, session = session_of(context)
    said = "There is no gesture to take back: the fingertip has not touched since"
    return "" if session.gestures or session.strokes else said
