"""Handlers of live sessions: undo, redo, save, load, removal of the extension, recovery of a recording.

The handlers are there only while a session runs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..compat import bpy
from ..overlay import views
from ..recorded import takes
from ..ui_text import localize
from . import loop, running, selection, tick
from .running import Running
from .stroke_queue import drop_strokes
from .waiting import find_bed

#: Takes that stand in beds for the moment of saving: uid and name of the bed, number of the take.
_WRITTEN: list[tuple[int, str, str]] = []


def write_recovery() -> None:
    """Put what is being recorded into the beds, as takes: the file is about to be saved."""
    clear_recovery()
    for session in running.list_sessions():
        bed, take = find_bed(session.uid, session.name), takes.read_recording(session)
        if bed is not None and take is not None:
            _WRITTEN.append((session.uid, session.name, takes.add(bed, take).number))


def clear_recovery(path: str = "") -> None:
    """Take it out of the beds again, since the recordings go on.

    `path`: the file that has been saved; empty when that has failed, or is not known.
    """
    while _WRITTEN:
        uid, name, number = _WRITTEN.pop()
        bed = find_bed(uid, name)
        if bed is None or number not in [entry.number for entry in takes.list_takes(bed)]:
            continue  # undone in the meantime
        takes.remove(bed, number)
        session = running.find(bed)
        # A copy saved elsewhere is not the file Blender asks about before it closes it.
        if session and session.recording and path and path == bpy.data.filepath:
            keep = replace(session.recording, saved=session.recording.count)
            running.put(replace(session, recording=keep))


def has_unsaved() -> bool:
    """Return whether something was recorded that the file does not have."""
    return any(
        session.recording is not None and session.recording.unsaved for session in running.list_sessions()
    )


def file_path() -> Path:
    """Return the file that is left; the next one replaces it."""
    return Path(bpy.app.tempdir).parent / "digiclay_recording.blend"


def save_copy() -> str:
    """Leave the open file, as it is now, for recovery; return words about it."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(file_path()), copy=True, check_existing=False)
    except RuntimeError as error:
        return localize("It could not be left for recovery: {}", str(error).removeprefix("Error: ").strip())
    return localize("It can be had back with File > Recover > Auto Save: {}", file_path().name)


#: Ticks until the state undo has put into a bed is taken up, that one included.
STALE = 2
#: What is told of a session the user has ended.
STOPPED = "was stopped; the bed keeps its state"
#: Blender's keymaps: their names and the editors they are of.
VIEW, WINDOW = ("3D View", "VIEW_3D"), ("Window", "EMPTY")
#: The keymap in which Alt S clears the scale: its keys precede those of the view.
OBJECT = ("Object Mode", "EMPTY")
#: Keymap, operator, key, and what else is held. Without a session, or a bed, the operators decline, and the
#: key does what it always does.
KEYS: tuple[tuple[tuple[str, str], str, str, dict[str, bool]], ...] = (
    (VIEW, "digiclay.session_pause", "P", {}),
    (VIEW, "digiclay.session_step", "P", {"shift": True}),
    (VIEW, "digiclay.session_rewind", "BACK_SPACE", {}),
    (VIEW, "digiclay.session_reset", "BACK_SPACE", {"shift": True}),
    (WINDOW, "digiclay.session_escape", "ESC", {"any": True}),
    (OBJECT, "digiclay.skin_toggle", "S", {"alt": True}),
)
_ADDED: list[tuple[Any, Any]] = []


@bpy.app.handlers.persistent
def reload_states(*_: Any) -> None:
    """Have every session take up, two ticks later, what undo or redo has put into its bed."""
    for session in running.list_sessions():
        running.put(replace(drop_strokes(session), stale=STALE))


@bpy.app.handlers.persistent
def write_recordings(*_: Any) -> None:
    """Have the file that is about to be saved hold what is being recorded."""
    write_recovery()


@bpy.app.handlers.persistent
def finish_saving(path: str, *_: Any) -> None:
    """Go on recording after the file was saved. `path`: of the file; `_`: what else Blender hands over."""
    clear_recovery(path)


@bpy.app.handlers.persistent
def cancel_saving(*_: Any) -> None:
    """Go on recording after the file could not be saved."""
    clear_recovery()


@bpy.app.handlers.persistent
def end_for_loading(*_: Any) -> None:
    """End all sessions: the file they are of is about to be closed."""
    end_with_file("ended: another file was loaded")


def watch() -> None:
    """Have the handlers called from now on."""
    for handler, function in _handler_pairs():
        if function not in handler:
            handler.append(function)


def end(how: str, *sessions: Running) -> None:
    """End sessions at once; their beds keep the states of the last tick, and takes of what was recorded.

    `how`: what is told of them, after their names; `sessions`: all that run if none is given. The last one
    takes loop and handlers along.
    """
    clear_recovery()
    sessions = sessions or running.list_sessions()
    words = [localize("The session of {} {}", ", ".join(session.name for session in sessions), localize(how))]
    try:
        words += filter(None, [tick.stop(session.uid) for session in sessions])
    finally:  # whatever cannot be kept, none of them stays listed without a loop
        for session in sessions:
            running.drop(session.uid)
        if sessions:
            running.set_message(". ".join(words), *(session.uid for session in sessions))
        if not running.list_sessions():
            loop.end()
            unwatch()
        views.follow()
    selection.select_active(frozenset(session.uid for session in sessions))


def end_all(how: str) -> None:
    """End all sessions; one undo step holds what they came to."""
    some = bool(running.list_sessions())
    end(how)
    if some:
        bpy.ops.ed.undo_push(message="Stop Session")


def end_with_file(how: str) -> None:
    """End all sessions since their file goes away; what it does not have of a recording can be recovered."""
    unsaved = has_unsaved()
    end(how)
    if unsaved:
        running.set_message(f"{running.last_message()}. {save_copy()}")


def unwatch() -> None:
    """Take the handlers back."""
    for handler, function in _handler_pairs():
        if function in handler:
            handler.remove(function)


def _handler_pairs() -> list[tuple[Any, Any]]:
    """Return Blender's lists of handlers with what belongs into them."""
    lists = bpy.app.handlers
    return [
        (lists.undo_post, reload_states),
        (lists.redo_post, reload_states),
        (lists.save_pre, write_recordings),
        (lists.save_post, finish_saving),
        (lists.save_post_fail, cancel_saving),
        (lists.load_pre, end_for_loading),
    ]


def _add_keys() -> None:
    """Add the keys; without a window there is no keymap to add them to."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:
        return
    for (name, space), operator, key, held in KEYS:
        keymap = configuration.keymaps.new(name=name, space_type=space)
        item = keymap.keymap_items.new(operator, key, "PRESS", head=True, **held)
        if operator == "digiclay.session_reset":
            item.properties.running_only = True
        _ADDED.append((keymap, item))


def _remove_keys() -> None:
    """Take the keys away."""
    for keymap, item in _ADDED:
        keymap.keymap_items.remove(item)
    _ADDED.clear()


def register() -> None:
    """Add the keys; handlers follow with the first session."""
    _add_keys()


def unregister() -> None:
    """End what runs, and take back all that was registered."""
    end_all("ended: the extension was disabled")
    _remove_keys()
