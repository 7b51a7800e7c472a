"""Start of a live session: the bed follows its fingertip until Esc."""

from typing import Any

from .. import preferences
from ..compat import bpy
from ..device.view import bed_of
from ..live import handlers, loop, selection, tick
from ..overlay import views
from ..press import tool
from ..ui_text import localize
from .action import Action
from .poll_messages import baked, linked, no_bed, session_runs
from .session_loop import LoopMixin


def leave_mode(context: Any) -> None:
    """Leave the active object's mode, for instance that of the Sculpting workspace, for Object Mode."""
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


class LeaveMode(Action, bpy.types.Operator):
    """Leave this mode for Object Mode, in which beds are sculpted, with the Press tool in hand"""

    bl_idname = "digiclay.leave_mode"
    bl_label = "Back to Object Mode"
    bl_options = {"REGISTER", "UNDO"}
    in_any_mode = True

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed, in another mode."""
        return no_bed(context) or ("" if context.mode != "OBJECT" else "This is Object Mode already")

    def perform(self, context: Any) -> None:
        """Leave it."""
        leave_mode(context)
        if context.window is not None:
            tool.take_up(context)


def leave_entry(menu: Any, context: Any) -> None:
    """Offer the way back after the menus of a 3D view's header, as in the Sculpting workspace.

    `menu` bpy.types.Menu; `context` bpy.types.Context.
    """
    if not LeaveMode.poll_message(context):
        menu.layout.operator(LeaveMode.bl_idname, icon="LOOP_BACK")


class Session(LoopMixin, Action, bpy.types.Operator):
    """Start sculpting: the pins follow the fingertip, which any tool can move. Esc stops"""

    bl_idname = "digiclay.session"
    bl_label = "Start Session"

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed, with no session yet, and a window; the mode is left for Object Mode."""
        in_window = not bpy.app.background and context.window is not None
        return (
            no_bed(context)
            or session_runs(context, "A session runs on this bed already: Esc stops it")
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
        leave_mode(context)
        notes = tick.start(context, bed)
        notes = notes or [tick.Note("INFO", localize("The session of {} runs: Esc stops it", bed.name))]
        self.tell([note._replace(uid=bed.session_uid) for note in notes])
        handlers.watch()
        views.follow()
        if preferences.get(context).take_press_tool:
            tool.take_up(context)
        selection.deselect(bed)
        # The state stands in the bed by now, so that undoing the first gesture finds it.
        bpy.ops.ed.undo_push(message="Start Session")
        if loop.is_running():
            return None
        loop.begin(context)
        return self.drive(context)
