"""Start a session: the bed follows its fingertip, however that is moved, until Esc is pressed."""

# No postponed annotations here, as in the other operators.
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..device.view import bed_of
from ..live import handlers, loop, tick
from ..overlay import views
from .reasons import allowed, baked, edited, linked, no_bed, session_runs
from .session_loop import Looping

__all__ = ["Session"]


class Session(Looping, bpy.types.Operator):  # type: ignore[misc]
    """Start to sculpt: the pins follow the fingertip while you move it by any means. Esc stops"""

    bl_idname = "digiclay.session"
    bl_label = "Start Session"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed in object mode is needed, with no session yet, and a window."""
        in_window = not bpy.app.background and context.window is not None
        why = (
            no_bed(context)
            or session_runs(context, "A session runs on this bed already: Esc stops it")
            or edited(context)
            or linked(context)
            or baked(context)
            or ("" if in_window else "A live session needs a window; takes can be baked without")
        )
        return allowed(cls, why)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start as `execute` does."""
        return self.execute(context)

    def execute(self, context: Any) -> set[str]:
        """Start the session, and the loop unless another session's drives this one as well."""
        bed = bed_of(context)
        try:
            notes = tick.start(context, bed)
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.tell(notes or [tick.Note("INFO", f"The session of {bed.name} runs: Esc stops it")])
        handlers.watch()
        views.follow()
        # The state stands in the bed by now, so that undoing the first gesture finds it.
        bpy.ops.ed.undo_push(message="Start Session")
        if loop.runs():
            return {"FINISHED"}
        loop.begin(context)
        return self.begun(context)
