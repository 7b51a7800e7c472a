"""Actions on takes: record, keep, export as a scene file, remove; recorded strokes are played."""

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.base.errors import DigiclayError
from ..core.files.run_folder import write_whole
from ..core.scene.toml_table import format_scene
from ..core.session.take import to_scene
from ..live import handlers, tick
from ..recorded import takes
from ..recorded.pointer_strokes import play_strokes, read_strokes
from ..roles import bed_of
from ..sessions import running, sculpting
from ..settings.declared import text
from ..ui_text import localize
from .action import FileAction, action
from .poll_messages import baked, cannot_record, linked, no_bed, no_recording, no_take, session_runs

TAKE = text("Take", "Number of the take; empty: the last one")


class ChosenTake:
    """Mixin of an operator on one take of the active bed."""

    take: TAKE


@action("digiclay.take_record", "Record Take", cannot_record)
def record_take(operator: Any, context: Any) -> None:
    """Record the fingertip's path from now on, to replay, bake or export it"""
    session = running.find(bed_of(context))
    assert session is not None  # by the poll
    running.put(sculpting.set_recording(session, True))


@action(
    "digiclay.take_keep", "Keep Take", no_recording,
    name=text("Name", "Name of the take; empty: its number", maxlen=60),
)  # fmt: skip
def keep_take(operator: Any, context: Any) -> set[str] | None:
    """Stop recording and keep the take in this file"""
    handlers.clear_recovery()
    bed = bed_of(context)
    session = running.find(bed)
    assert session is not None  # by the poll
    take = takes.read_recording(session)
    running.put(sculpting.set_recording(session, False))
    if take is None:
        operator.report({"WARNING"}, localize("Nothing was recorded: the session was paused"))
        return {"CANCELLED"}
    entry = takes.add(bed, take, operator.name)
    operator.report({"INFO"}, localize("{}: {:.1f} s kept", entry.name, entry.seconds))
    return None


class ExportTake(ChosenTake, FileAction, bpy.types.Operator):
    """Write a take as a scene file for `digiclay run`"""

    bl_idname = "digiclay.take_export"
    bl_label = "Export Take"
    bl_options = {"REGISTER"}
    needs = no_bed, no_take

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser, with the name of the take."""
        try:
            name = takes.find(bed_of(context), self.take).name
        except DigiclayError:
            name = "take"
        self.filepath = bpy.path.clean_name(name) + ".toml"
        return super().invoke(context, event)

    def perform(self, context: Any) -> None:
        entry = takes.find(bed_of(context), self.take)
        take = takes.read(bed_of(context), entry.number)
        # A point in the name is not where an ending begins: "ridge 1.5" is no "ridge 1".
        file = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".toml"))
        write_whole(file, format_scene(to_scene(take, entry.name)).encode())
        self.report({"INFO"}, localize("{} written to {}", entry.name, file))


@action("digiclay.take_remove", "Remove Take", no_bed, no_take, take=TAKE)
def remove_take(operator: Any, context: Any) -> None:
    """Remove a take"""
    takes.remove(bed_of(context), takes.find(bed_of(context), operator.take).number)


class PlayStrokes(FileAction, bpy.types.Operator):
    """Form recorded strokes of the Press tool on the bed, from a file, as fast as they can be simulated"""

    bl_idname = "digiclay.play_strokes"
    bl_label = "Play Strokes"
    bl_options = {"REGISTER", "UNDO"}
    needs = no_bed, session_runs, linked, baked

    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

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
