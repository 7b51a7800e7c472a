"""Bed of a session, and the reason for which a session waits."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import bridge
from ..compat import bpy
from ..device import view
from ..ui_text import localize
from . import running
from .running import Running


def find_bed(uid: int, name: str) -> Any | None:
    """Return the object of a `session_uid`, or None when it was deleted: it stands in no scene any more.

    `name`: its name when last seen: looked up first.
    """
    bed = bpy.data.objects.get(name)
    if bed is None or bed.session_uid != uid:
        bed = next((thing for thing in bpy.data.objects if thing.session_uid == uid), None)
    if bed is None or bed.get(view.ROLE) != view.BED:  # one that was converted can come back by undo
        return None
    # Blender looks through all objects of all scenes for `users_scene`: only a bed not shown is worth that.
    return bed if _is_shown(bpy.context, bed) or bed.users_scene else None


def _is_shown(context: Any, thing: Any) -> bool:
    """Return whether some window shows a scene the object stands in."""
    layers = (window.view_layer for window in context.window_manager.windows)
    return any(layer.objects.get(thing.name) == thing for layer in layers)


def blocking_reason(context: Any, bed: Any, pins: int | None = None) -> str:
    """Return the reason why the session of a bed cannot continue now, or an empty text.

    `context` bpy.types.Context; `bed` bpy.types.Object; `pins`: how many the session simulates; as many as
    there are when left out.
    """
    if bpy.app.is_job_running("RENDER"):
        return localize("a render is under way")
    if not _is_shown(context, bed):
        return localize("no window shows its scene, or its collection is left out: show it to go on")
    # A mesh can also be edited through another object that shares it.
    if bed.mode != "OBJECT":
        return localize("the bed is being edited: go back to Object Mode to go on")
    fault = bridge.find_fault(bed.data, pins)
    if fault:
        return fault
    tip = view.fingertip_of(bed)
    if tip is None:
        return localize(
            "its fingertip is deleted: undo that, or stop the session and start it again to get another one"
        )
    if not _is_shown(context, tip):
        return localize("its fingertip stands in no scene shown: link it to a collection to go on")
    fault = bridge.find_scale_fault(bed)
    if fault:
        return fault
    matrix = np.array(tip.matrix_world)
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        return localize("its fingertip is scaled to nothing: clear its scale to go on")
    return ""


def active_session(context: Any) -> tuple[Any, Running] | None:
    """Return the bed that is active, or the only one that runs, and its session; None without."""
    bed = view.bed_of(context)
    session = running.find(bed)
    if session is None and bed is None and len(running.list_sessions()) == 1:
        (session,) = running.list_sessions()
        bed = find_bed(session.uid, session.name)
    return (bed, session) if bed is not None and session is not None else None
