"""Beds of sessions: look-up, reason to wait, selection; session data as properties of their objects."""

import json
from enum import Enum

import numpy as np

from .. import bridge
from ..compat import Context, Object, bpy
from ..core.base.arrays import Floats
from ..device import pressers
from ..roles import BED, FINGERS, ROLE, bed_of, fingertips_of, is_local
from ..sessions import running
from ..sessions.running import TABLE, Running, name_fingers
from ..strokes import drawn
from ..ui_text import localize


def deselect(bed: Object) -> None:
    """Take a bed out of the selection of the view layer in use; it stays active."""
    if bed.name in bpy.context.view_layer.objects and bed.select_get():
        TABLE.selected.add(bed.session_uid)
        bed.select_set(False)


def select_active(uids: frozenset[int]) -> None:
    """Select the active object again if it was until one of these sessions, and nothing else is."""
    layer = bpy.context.view_layer
    active = layer.objects.active if layer is not None else None
    selected = uids & TABLE.selected
    TABLE.selected -= uids
    if active is None or active.session_uid not in selected:
        return
    if not any(thing.select_get() for thing in layer.objects):
        active.select_set(True)


def find_bed(session: Running) -> Object | None:
    """Return the object of a session, its last name looked up first; None when it was deleted."""
    bed = bpy.data.objects.get(session.name)
    if bed is None or bed.session_uid != session.uid:
        bed = find_object(session.uid)
    if bed is None or bed.get(ROLE) != BED:  # one that was converted can come back by undo
        return None
    # Blender looks through all objects of all scenes for `users_scene`: only a bed not shown is
    # worth that.
    return bed if _is_shown(bpy.context, bed) or bed.users_scene else None


def find_object(uid: int) -> Object | None:
    """Return the object of a `session_uid`; None when it was deleted."""
    return next((thing for thing in bpy.data.objects if thing.session_uid == uid), None)


def _is_shown(context: Context, thing: Object) -> bool:
    """Return whether some window shows a scene the object stands in."""
    layers = (window.view_layer for window in context.window_manager.windows)
    return any(layer.objects.get(thing.name) == thing for layer in layers)


def blocking_reason(context: Context, bed: Object, pins: int | None = None) -> str:
    """Return why the session of a bed, of so many pins, cannot continue now, or an empty text."""
    if bpy.app.is_job_running("RENDER"):
        return localize("a render is under way")
    if not _is_shown(context, bed):
        return localize(
            "no window shows its scene, or its collection is left out: show it to go on"
        )
    # A mesh can also be edited through another object that shares it.
    if bed.mode != "OBJECT":
        return localize("the bed is being edited: go back to Object Mode to go on")
    fault = bridge.find_fault(bed.data, pins)
    if fault:
        return fault
    tips = fingertips_of(bed).values()
    if not tips:
        return localize(
            "its fingertip is deleted: undo that, or stop the session and start it again to get another one"
        )
    fault = bridge.find_scale_fault(bed)
    if fault:
        return fault
    for tip in tips:
        matrix = np.array(tip.matrix_world)
        if not _is_shown(context, tip):
            return localize("{} is in no visible scene: link it to a collection to go on", tip.name)
        if not np.isfinite(matrix).all():
            return localize(
                "{} has no finite location: clear its location, or undo that, to go on", tip.name
            )
        if abs(np.linalg.det(matrix[:3, :3])) < 1e-12 * bridge.uniform(bed) ** 3:
            return localize("{} is scaled to nothing: clear its scale to go on", tip.name)
    return pressers.find_fault(context, bed)


class Use(Enum):
    """What an operator does with a bed: measures its pins, changes its settings and parts, or forms it."""

    MEASURE, CHANGE, FORM = range(3)


def find_obstacle(context: Context, bed: Object, use: Use) -> str:
    """Return why the state of a bed does not allow a use of it, or an empty text."""
    if context.view_layer.objects.get(bed.name) != bed:
        return localize("The bed is not in this view layer: show its scene or collection first")
    if use is not Use.MEASURE and not (is_local(bed) and is_local(bed.data)):
        return localize(
            "The bed is linked from another file: make it local first (Object > Relations)"
        )
    if use is not Use.MEASURE and _is_replayed(context):
        return localize("A take is being replayed: Esc stops it")
    if use is Use.CHANGE or bed.mode != "OBJECT":
        return ""
    layout = bed.digiclay.layout
    fault = bridge.find_fault(bed.data, layout.rows * layout.columns)
    if fault:
        return localize("{}, or press Rebuild in Laboratory > Device", fault)
    return bridge.find_scale_fault(bed)


def _is_replayed(context: Context) -> bool:
    """Return whether a take is being replayed, which writes its end into its bed."""
    windows = context.window_manager.windows
    every = (operator for window in windows for operator in window.modal_operators)
    return any(operator.bl_idname == "DIGICLAY_OT_take_replay" for operator in every)


def active_session(context: Context) -> tuple[Object, Running] | None:
    """Return the bed that is active, or the only one with a session, and its session; None without."""
    bed, sessions = bed_of(context), running.list_sessions()
    if bed is None and len(sessions) == 1:
        bed = find_bed(sessions[0])
    session = running.find(bed)
    return None if session is None else (bed, session)


#: The state by `core.session.snapshot`, poses and numbers of the fingertips at it, the last tick;
#: and in JSON the tick in which the stroke began that is being formed, or 0, those of the gestures
#: before, and the strokes that are to be formed from that state, by `strokes.drawn`; the heights
#: that strokes count from.
STATE = "digiclay_state"
POSE = "digiclay_pose"
NUMBERS = "digiclay_fingers"
TICK = "digiclay_moment"
QUEUE = "digiclay_strokes"
BASE = "digiclay_base"


def write(bed: Object, running: Running, before: Running | None = None) -> None:
    """Write a session into its bed's properties, except what has not changed since `before` was written.

    No stroke stands there half-formed: it is there as drawn, with the state it begins from.
    """
    # The tick counts on even while nothing moves: undo reads anew only what is other bytes in a
    # step.
    bed[TICK] = running.tick
    if before is not None and _identify(running) == _identify(before):
        return
    bed.data[TICK] = running.tick
    now, started = running.standing, running.stroke_start.tick if running.stroke_start else 0
    ticks = [gesture.tick for gesture in running.gestures if gesture.tick < now.tick]
    queue = json.dumps([started, ticks, list(map(drawn.dump, running.drawn))])
    names = bytes(name_fingers(running.numbers, len(now.poses)))
    stored = now.snapshot, now.poses.tobytes(), names, queue, running.base.tobytes()
    for name, data in zip((STATE, POSE, NUMBERS, QUEUE, BASE), stored, strict=True):
        # Blender takes bytes that are assigned over others for a text: it stops at the first 0,
        # and corrupts its memory where the lengths differ.
        bed.pop(name, None)
        bed[name] = data


def _identify(running: Running) -> tuple[object, ...]:
    """Return what tells apart what is written of sessions."""
    return (
        running.standing.snapshot,
        running.stroke_start,
        *(stroke.number for stroke in running.drawn),
    )


def put(running: Running) -> None:
    """Make a value the present one of its bed's session, and write its strokes: an undo step is to come."""
    TABLE.sessions[running.uid] = running
    bed = find_bed(running)
    if bed is not None and not running.stale:
        write(bed, running)


def clear(bed: Object) -> None:
    """Remove all session data: the bed is at rest."""
    for name in (STATE, POSE, NUMBERS, TICK, QUEUE, BASE):
        bed.pop(name, None)


def read_snapshot(bed: Object) -> bytes | None:
    """Return the stored state, or None for a bed at rest; it may be anything a file can hold."""
    value = bed.get(STATE)
    return value if value is None or isinstance(value, bytes) else b""


def read_poses(bed: Object) -> Floats | None:
    """Return the fingertips' poses (f, 7) at the stored state, or None where there are no usable ones."""
    value = bed.get(POSE)
    if not isinstance(value, bytes) or len(value) != len(read_numbers(bed)) * 7 * 8:
        return None
    poses = np.frombuffer(value, np.float64).reshape(-1, 7).copy()
    lengths = np.linalg.norm(poses[:, 3:], axis=1)
    return poses if np.isfinite(poses).all() and (abs(lengths - 1.0) < 1e-6).all() else None


def read_numbers(bed: Object) -> tuple[int, ...]:
    """Return the numbers of the fingertips at the stored state; 1 for older files and unusable ones."""
    value = bed.get(NUMBERS)
    numbers = tuple(value) if isinstance(value, bytes) else ()
    valid = 0 < len(numbers) == len(set(numbers)) <= len(FINGERS) and min(numbers) > 0
    return numbers if valid else (1,)


def read_base(bed: Object) -> Floats | None:
    """Return the stored base (k,), m, None without one; it is empty where it is unusable."""
    value = bed.get(BASE)
    if value is None:
        return None
    usable = isinstance(value, bytes) and len(value) % 8 == 0
    base = np.frombuffer(value if usable else b"", np.float64).copy()
    return base if np.isfinite(base).all() else base[:0]


def read_tick(bed: Object) -> int:
    """Return the tick that was written last; 0 where none is stored."""
    value = bed.get(TICK)
    return value if isinstance(value, int) and value > 0 else 0


def read_queue(bed: Object) -> tuple[int, list[int], list[str]]:
    """Return the tick that the stored state is of, those in which its gestures began, and strokes to form."""
    try:
        started, ticks, lines = json.loads(bed[QUEUE])
        return int(started) or read_tick(bed), list(map(int, ticks)), list(map(str, lines))
    except (KeyError, ValueError, TypeError, OverflowError, RecursionError):
        return read_tick(bed), [], []
