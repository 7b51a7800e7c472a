"""Start a session: the bed follows its fingertip, however that is moved, until Esc is pressed."""

# No postponed annotations here, as in the other operators.
from typing import Any

from ..compat import bpy
from ..core.errors import DigiclayError
from ..device.view import bed_of
from ..live import handlers, loop, running, tick
from ..overlay import views
from ..recorded.bake import is_baked
from .session_loop import Looping

__all__ = ["Session"]


class Session(Looping, bpy.types.Operator):  # type: ignore[misc]
    """Start to sculpt: the pins follow the fingertip while you move it by any means. Esc stops"""

    bl_idname = "digiclay.session"
    bl_label = "Start Session"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed in object mode is needed, with no session yet, and a window."""
        bed = bed_of(context)
        if bed is None:
            why = "Select a bed or its fingertip first"
        elif running.of(bed) is not None:
            why = "A session runs on this bed already: Esc stops it"
        elif context.mode != "OBJECT":
            why = "Go back to Object Mode first"
        elif bed.library is not None or bed.data.library is not None:
            why = "The bed is linked from another file: make it local first (Object > Relations)"
        elif is_baked(bed):
            why = "The bed plays a baked session: free the bake in the Takes panel first"
        elif bpy.app.background or context.window is None:
            why = "A live session needs a window; takes can be baked without"
        else:
            return True
        cls.poll_message_set(why)
        return False

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
