"""Recovery of recordings: stored with the file, or for recovery when the file is closed.

A recording under way is a value of this Blender, not of the file, until it ends: then it is a take. So a
file that is saved meanwhile, also by Blender itself, has it as a take for the moment of saving. And a file
that is closed with a recording it does not have is left, whole, in the folder in which *File > Recover >
Auto Save* looks, as Blender does with what would be lost.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..compat import bpy
from ..recorded import takes
from ..ui_text import localize
from . import running
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
