"""Handlers of live sessions: undo, redo, save, load, removal of the extension, recovery of a recording.

The handlers are there only while a session runs.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..compat import bpy, connect, disconnect
from ..core.base.errors import DigiclayError
from ..overlay import views
from ..recorded import takes
from ..sessions import running
from ..sessions.running import Running
from ..ui_text import localize
from . import beds, loop, tick
from .beds import find_bed

#: Ticks until the state that undo has put into a bed is taken up, that one included.
STALE = 2
#: Words about a session that the user has ended.
STOPPED = "was stopped; the bed keeps its state"
#: Blender's keymaps: their names and the editors they are of.
VIEW, WINDOW = ("3D View", "VIEW_3D"), ("Window", "EMPTY")
#: Keymap, operator, key, and modifier keys. Without a session, or a bed, the operators decline, and
#: the key has its usual effect.
KEYS: tuple[tuple[tuple[str, str], str, str, dict[str, bool]], ...] = (
    (VIEW, "digiclay.session_pause", "P", {}),
    (VIEW, "digiclay.session_step", "P", {"shift": True}),
    (VIEW, "digiclay.finish_strokes", "RET", {}),
    (VIEW, "digiclay.session_rewind", "BACK_SPACE", {}),
    (VIEW, "digiclay.session_reset", "BACK_SPACE", {"shift": True}),
    (WINDOW, "digiclay.session_escape", "ESC", {"any": True}),
)


@bpy.app.handlers.persistent
def write_recovery(*_: object) -> None:
    """Write each recording into its bed, as a take: the file is about to be saved."""
    clear_recovery()
    for session in running.list_sessions():
        bed, take = find_bed(session), takes.read_recording(session)
        if bed is not None and take is not None:
            running.put(replace(session, saved_take=takes.add(bed, take, session=session).number))


@bpy.app.handlers.persistent
def clear_recovery(path: str = "", *_: object) -> None:
    """Remove these takes, since the recordings continue; `path` of the saved file, empty if that failed."""
    for session in running.list_sessions():
        number, later = session.saved_take, replace(session, saved_take="")
        if not number:
            continue
        bed = find_bed(session)
        if bed is not None and number in [entry.number for entry in takes.list_takes(bed)]:
            # Undo does not bring the take back.
            takes.remove(bed, number)
            # A copy saved elsewhere is not the file Blender asks about before it closes it.
            if session.recording and path and path == bpy.data.filepath:
                later = replace(
                    later, recording=replace(session.recording, saved=session.recording.count)
                )
        running.put(later)


def has_unsaved() -> bool:
    """Return whether something was recorded that the file does not have."""
    recordings = [session.recording for session in running.list_sessions()]
    return any(recording is not None and recording.unsaved for recording in recordings)


def file_path() -> Path:
    """Return the file for recovery; the next one replaces it."""
    return Path(bpy.app.tempdir).parent / "digiclay_recording.blend"


def save_copy() -> str:
    """Save a copy of the open file, as it is now, for recovery; return words about it."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(file_path()), copy=True, check_existing=False)
    except RuntimeError as error:
        return localize(
            "It could not be saved for recovery: {}", str(error).removeprefix("Error: ").strip()
        )
    return localize("Restore it with File > Recover > Auto Save: {}", file_path().name)


@bpy.app.handlers.persistent
def reload_states(*_: object) -> None:
    """Have every session take up, two ticks later, what undo or redo has put into its bed."""
    for session in running.list_sessions():
        running.put(replace(session, stale=STALE))


def form_left() -> None:
    """Form what beds without a session have stored of strokes: the file, or the step, is of mid-stroke."""
    for bed in [thing for thing in bpy.context.scene.objects if beds.read_queue(thing)[-1]]:
        if running.find(bed) is None and not bed.library:
            try:
                tick.form_strokes(bpy.context, bed)
            except DigiclayError as error:
                running.set_message(str(error), bed.session_uid)


@bpy.app.handlers.persistent
def form_soon(*_: object) -> None:
    """Form what is left of strokes when Blender has evaluated what it has loaded."""
    if not (bpy.app.background or bpy.app.timers.is_registered(form_left)):
        bpy.app.timers.register(form_left)


#: Handlers of a running session, by the names of Blender's lists.
HANDLERS = {
    "undo_post": reload_states,
    "redo_post": reload_states,
    "save_pre": write_recovery,
    "save_post": clear_recovery,
    "save_post_fail": bpy.app.handlers.persistent(lambda *_: clear_recovery()),
    "load_pre": bpy.app.handlers.persistent(
        lambda *_: end_with_file("ended: another file was loaded")
    ),
}


#: Handlers for beds without a session.
LEFT = dict.fromkeys(("load_post", "undo_post", "redo_post"), form_soon)


def watch() -> None:
    """Add the handlers."""
    connect(HANDLERS)


def end(how: str, *sessions: Running) -> None:
    """End sessions, by default all, with words on how; their beds keep states, and takes of recordings."""
    clear_recovery()
    sessions = sessions or running.list_sessions()
    words = [
        localize(
            "The session of {} {}", ", ".join(session.name for session in sessions), localize(how)
        )
    ]
    try:
        words += filter(None, [tick.stop(session.uid) for session in sessions])
    finally:  # whatever cannot be stored, none of them stays listed without a loop
        for session in sessions:
            running.drop(session.uid)
        if sessions:
            running.set_message(". ".join(words), *(session.uid for session in sessions))
        if not running.list_sessions():
            loop.end()
            disconnect(HANDLERS)
        views.follow()
    form_soon()
    beds.select_active(frozenset(session.uid for session in sessions))


def end_all(how: str) -> None:
    """End all sessions; one undo step holds their states."""
    some = bool(running.list_sessions())
    end(how)
    if some:
        bpy.ops.ed.undo_push(message="Stop Session")


def end_with_file(how: str) -> None:
    """End all sessions since their file is closed; a copy of it has what it lacks of a recording."""
    unsaved = has_unsaved()
    end(how)
    if unsaved:
        running.set_message(f"{running.last_message()}. {save_copy()}")


def _open_keymaps() -> Iterator[tuple[Any, str, str, dict[str, bool]]]:
    """Give the items of the keymap of each key, with its operator, key and modifier keys."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    for (name, space), *key in KEYS if configuration else ():
        yield configuration.keymaps.new(name=name, space_type=space).keymap_items, *key


def register() -> None:
    """Add the keys; handlers follow with the first session. Without a window there are no keymaps."""
    if not bpy.app.background:
        connect(LEFT)
    for items, operator, key, modifiers in _open_keymaps():
        item = items.new(operator, key, "PRESS", head=True, **modifiers)
        if operator == "digiclay.session_reset":
            item.properties.running_only = True


def unregister() -> None:
    """End what runs, and remove the keys."""
    end_all("ended: the extension was disabled")
    disconnect(LEFT)
    if bpy.app.timers.is_registered(form_left):
        bpy.app.timers.unregister(form_left)
    for items, operator, *_ in _open_keymaps():
        for item in [item for item in items if item.idname == operator]:
            items.remove(item)
