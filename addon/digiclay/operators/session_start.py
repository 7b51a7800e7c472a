"""Start of a live session: the bed follows its fingertip until Esc."""

from typing import Any

from ..compat import bpy
from ..device.view import bed_of
from ..live import handlers, loop, tick
from ..overlay import views
from .action import Action
from .poll_messages import baked, edited, linked, no_bed, session_runs
from .session_loop import LoopMixin

__all__ = ["Session"]


class Session(LoopMixin, Action, bpy.types.Operator):
    """Start sculpting: the pins follow the fingertip, which any tool can move. Esc stops"""

    bl_idname = "digiclay.session"
    bl_label = "Start Session"

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed in object mode is needed, with no session yet, and a window."""
        in_window = not bpy.app.background and context.window is not None
        return (
            no_bed(context)
            or session_runs(context, "A session runs on this bed already: Esc stops it")
            or edited(context)
            or linked(context)
            or baked(context)
            or ("" if in_window else "A live session needs a window; takes can be baked without")
        )

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start as `execute` does."""
        return self.execute(context)

    def perform(self, context: Any) -> set[str] | None:
        """Start the session, and the loop unless another session's drives this one as well."""
        bed = bed_of(context)
        notes = tick.start(context, bed)
        self.tell(notes or [tick.Note("INFO", f"The session of {bed.name} runs: Esc stops it")])
        handlers.watch()
        views.follow()
        # The state stands in the bed by now, so that undoing the first gesture finds it.
        bpy.ops.ed.undo_push(message="Start Session")
        if loop.is_running():
            return None
        loop.begin(context)
        return self.drive(context)
