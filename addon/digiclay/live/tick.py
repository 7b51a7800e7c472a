"""Tick of the live sessions: Blender's objects in, simulation, beds out.

No reference to Blender's data outlives a tick: undo and loading invalidate them all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .. import bridge, preferences
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError, DivergenceError, MethodError
from ..device import unit, view
from ..device.instant import find_ellipsoid
from ..recorded import takes
from ..recorded.bake import is_baked
from ..settings import properties
from ..ui_text import localize
from . import bed_state, follow, gestures, running, sculpting
from .running import Running
from .stroke_queue import drop_strokes
from .waiting import blocking_reason, find_bed


class Note(NamedTuple):
    """Message to the user: level of Blender's operator reports, text, and uid of the bed it is about."""

    level: str
    message: str
    uid: int = 0


def start(context: Any, bed: Any) -> list[Note]:
    """Begin a session of a bed, from what the bed keeps; what was missing for it is made.

    `context` bpy.types.Context; `bed` bpy.types.Object. Raises DigiclayError when the bed's settings, its
    scale or a bake do not allow it.
    """
    if is_baked(bed):
        raise DigiclayError(f"{bed.name} plays a baked session: free the bake in the Takes panel first.")
    settings, scene, notes = properties.read_stored_settings(bed), properties.scene_of(bed), []
    if bed.data.users > 1:
        bed.data = bed.data.copy()
        notes.append(
            Note("INFO", localize("{} got pins of its own: it shared them with another bed", bed.name))
        )
    got = unit.give_fingertip(bed, scene)
    if got:
        notes.append(Note("INFO", got))
    context.view_layer.update()
    why = blocking_reason(context, bed, scene.cells)
    if why:
        raise DigiclayError(f"The session of {bed.name} cannot start: {why}.")
    begun, said = sculpting.begin_session(
        bed.session_uid, bed.name, scene, bridge.pose(view.fingertip_of(bed)),
        bed_state.read_snapshot(bed), bed_state.read_tick(bed),
    )  # fmt: skip
    show(bed, replace(begun, settings=settings))
    return [*notes, Note("WARNING", f"{bed.name}: {said}")] if said else notes


def stop(uid: int) -> str:
    """End a session: its bed keeps the state, and what was recorded as a take; return words about that."""
    ended = running.drop(uid)
    follow.end(uid)
    bed = find_bed(uid, ended.name) if ended else None
    return takes.keep_recording(bed, ended) if ended is not None and bed is not None else ""


def show(bed: Any, session: Running) -> None:
    """Make a value the present one of a session, kept by its bed, and shown as soon as its mesh can be.

    `bed` bpy.types.Object.
    """
    running.put(session)
    bed_state.write(bed, session)
    if not bridge.find_fault(bed.data, session.system.grid.count):
        view.show_state(bed, session.system, session.state)


def place_finger(context: Any, bed: Any, session: Running) -> None:
    """Put the fingertip where a session has it; one that is animated or constrained goes its own way.

    `context` bpy.types.Context; `bed` bpy.types.Object.
    """
    if _move_finger(bed, session):
        _evaluate(context)


def _move_finger(bed: Any, session: Running) -> bool:
    """Put the fingertip where a session has it, without evaluation; return whether there is one."""
    tip = view.fingertip_of(bed)
    if tip is not None:
        bridge.move_fingertip(tip, session.pose, find_ellipsoid(session.scene))
    return tip is not None


def withdraw_strokes(context: Any, uid: int | None = None) -> bool:
    """Take back the last unfinished stroke of one session, or of each; return whether there was one.

    `context` bpy.types.Context; `uid`: of one session's bed; by default all.
    """
    busy = [session for session in running.list_sessions() if session.strokes and uid in (None, session.uid)]
    for session in busy:
        bed = find_bed(session.uid, session.name)
        if bed is not None:
            back = gestures.withdraw_stroke(session)
            show(bed, back)
            place_finger(context, bed, back)
    return bool(busy)


def tick(context: Any, now: float) -> list[Note]:
    """Advance every session to the current time of a monotonic clock, s; return the messages.

    `context` bpy.types.Context; `now`, s.
    """
    notes: list[Note] = []
    most = preferences.get(context).most_periods
    for session in running.list_sessions():
        bed = find_bed(session.uid, session.name)
        if bed is None:
            running.drop(session.uid)
            follow.end(session.uid)
            words = localize("The session of {} ended: its bed was deleted", session.name)
            notes.append(Note("WARNING", words, session.uid))
            continue
        advanced = _advance_session(context, bed, session, now, most)
        notes += [note._replace(uid=session.uid) for note in advanced]
    return notes


def _advance_session(context: Any, bed: Any, session: Running, now: float, most: int) -> list[Note]:
    """Advance one session."""
    if session.stale > 1:
        # What undo has put back has no place in the world until Blender has evaluated it, which it
        # does before the next tick.
        running.put(replace(session, stale=session.stale - 1))
        return []
    before = session
    followed, heard = follow.follow(session.uid, now)
    why, session, said = _read_changes(context, bed, session)
    notes = [Note("WARNING", f"{bed.name}: {words}") for words in (said, heard) if words]
    if why:
        waiting = replace(session, blocking_reason=why, clock=session.clock.stopped(), name=bed.name)
        running.put(replace(waiting, tick=waiting.tick + 1))
        bed_state.write(bed, running.find(bed) or waiting, session)
        told = why == before.blocking_reason
        return (
            notes
            if told
            else [*notes, Note("WARNING", localize("The session of {} waits: {}", bed.name, why))]
        )
    if before.blocking_reason:
        notes.append(Note("INFO", localize("The session of {} goes on", bed.name)))
    session = replace(session, blocking_reason="", name=bed.name)
    seen = _visible_rows(session)
    try:
        # The finger of a stroke is where the session has put it.
        pose = session.pose if session.strokes else followed
        pose = bridge.pose(view.fingertip_of(bed)) if pose is None else pose
        later = sculpting.advance(session, pose, now, most, view.picked_pins(bed))
    except (DivergenceError, MethodError) as error:
        back = sculpting.restore(session, session.snapshot, session.pose)
        later = replace(drop_strokes(back), paused=True)
        notes.append(Note("ERROR", localize("The session of {} is paused: {}", bed.name, error)))
    running.put(later)
    moved = (bool(session.strokes) or followed is not None) and _move_finger(bed, later)
    bed_state.write(bed, later, before)
    # Drawing is what costs most: where nothing has changed, nothing is drawn anew.
    if before.stale or before.blocking_reason or said or not np.array_equal(seen, _visible_rows(later)):
        view.show_state(bed, later.system, later.state)
    if moved:  # One evaluation of pins and fingertip takes less time than one of each.
        _evaluate(context)
    return notes


def _evaluate(context: Any) -> None:
    """Have Blender evaluate what has changed: only then the world's matrix of a moved fingertip is right."""
    context.view_layer.update()


def _has_changed(bed: Any, session: Running, settings: properties.StoredSettings) -> bool:
    """Return whether the scene of a bed's settings may differ from that of its session, or from its pins."""
    mismatch = properties.find_layout_mismatch(bed, session.scene.layout)
    return settings != session.settings or bool(mismatch)


def _visible_rows(session: Running) -> Floats:
    """Return all that can be seen of a session's cells, shape (3, n)."""
    state = session.state
    return np.array([state.row(0), state.row(session.system.rows.force), state.mode()])


def _read_changes(context: Any, bed: Any, session: Running) -> tuple[str, Running, str]:
    """Detect changes of settings and undo; return the reason to wait, the session, and the messages."""
    why, said = blocking_reason(context, bed, session.system.grid.count), ""
    if why:
        return why, session, said
    try:
        settings = properties.read_stored_settings(bed)
        if session.stale or session.blocking_reason or _has_changed(bed, session, settings):
            scene = properties.scene_of(bed)
            if scene != session.scene:
                before = session
                session, said = sculpting.change_scene(before, scene)
                # A take is of one scene: what was recorded under the former one is not lost.
                said = ". ".join(filter(None, (said, takes.keep_recording(bed, before))))
                bridge.resize_fingertip(view.fingertip_of(bed), find_ellipsoid(scene))
            session = replace(session, settings=settings)
        if session.stale:
            pose, tick_read = bed_state.read_pose(bed), bed_state.read_tick(bed)
            pose = session.pose if pose is None else pose
            recorded = session.recording is not None
            session = sculpting.restore(session, bed_state.read_snapshot(bed), pose, tick_read)
            if recorded and session.recording is None:
                said = localize(
                    "The recording ended: undo went back to before it, or redo to what it did not lead to"
                )
    except DigiclayError as error:
        return str(error), session, said
    return "", session, said
