"""Record the fingertip's path in a running session, and keep it as a take."""

# No postponed annotations here: Blender reads an operator's properties from them.
from typing import Any

from ..compat import bpy
from ..device.view import bed_of
from ..live import recovery, running, sculpting
from ..recorded import takes
from .reasons import allowed

__all__ = ["KeepTake", "RecordTake"]


class RecordTake(bpy.types.Operator):  # type: ignore[misc]
    """Record the fingertip's path from now on, to replay, bake or export it"""

    bl_idname = "digiclay.take_record"
    bl_label = "Record Take"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A running session that does not record yet is needed."""
        session = running.of(bed_of(context))
        if session is None:
            return allowed(cls, "Start a session first")
        return allowed(cls, "A take is being recorded already" if session.recording is not None else "")

    def execute(self, context: Any) -> set[str]:
        """Begin to record."""
        running.put(sculpting.recording(running.of(bed_of(context)), True))
        return {"FINISHED"}


class KeepTake(bpy.types.Operator):  # type: ignore[misc]
    """Stop recording and keep the take in this file"""

    bl_idname = "digiclay.take_keep"
    bl_label = "Keep Take"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    name: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Name", description="Name of the take; empty: its number", maxlen=60
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A session that records is needed."""
        session = running.of(bed_of(context))
        records = session is not None and session.recording is not None
        return allowed(cls, "" if records else "Record a take first")

    def execute(self, context: Any) -> set[str]:
        """Keep it."""
        recovery.take_back()
        bed = bed_of(context)
        session = running.of(bed)
        take = takes.recorded(session)
        running.put(sculpting.recording(session, False))
        if take is None:
            self.report({"WARNING"}, "Nothing was recorded: the session stood still")
            return {"CANCELLED"}
        entry = takes.keep(bed, take, self.name)
        self.report({"INFO"}, f"{entry.name}: {entry.seconds:.1f} s kept")
        return {"FINISHED"}
