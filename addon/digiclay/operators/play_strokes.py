"""Play Strokes: recorded strokes of the Press tool, formed on a bed at once, also without a window."""

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..device.view import bed_of
from ..live import running, tick
from ..live.recorded_strokes import play_strokes, read_strokes
from ..ui_text import localize
from .action import FileAction
from .poll_messages import baked, linked, no_bed, session_runs


class PlayStrokes(FileAction, bpy.types.Operator):
    """Form recorded strokes of the Press tool on the bed, from a file, as fast as they can be simulated"""

    bl_idname = "digiclay.play_strokes"
    bl_label = "Play Strokes"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed that a session could begin on."""
        return no_bed(context) or session_runs(context) or linked(context) or baked(context)

    def perform(self, context: Any) -> None:
        """Play them in a session of their own; when one of them fails, the bed stays as it was."""
        recorded = read_strokes(Path(bpy.path.abspath(self.filepath)))
        bed = bed_of(context)
        for note in tick.start(context, bed):
            self.report({note.level}, note.message)
        try:
            session = running.find(bed)
            assert session is not None  # it has just been started
            *_, session = play_strokes(session, recorded.strokes)
            tick.show(bed, session)
            tick.place_finger(context, bed, session)
        finally:
            tick.stop(bed.session_uid)
        self.report({"INFO"}, localize("{}: {} strokes", recorded.name, len(recorded.strokes)))
