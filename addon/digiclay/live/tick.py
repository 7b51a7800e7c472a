"""Tick of the live sessions: Blender's objects in, simulation, beds out.

No reference to Blender's data outlives a tick: undo and loading invalidate them all.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .. import bridge, preferences
from ..compat import Context, Object
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError, DivergenceError, MethodError
from ..core.engine.bodies import find_given
from ..device import pressers, repair, view
from ..device.instant import find_ellipsoids
from ..recorded import takes
from ..recorded.bake import is_baked
from ..roles import fingertips_of
from ..sessions import running, sculpting, stored
from ..sessions.running import Running, suit_scene
from ..sessions.sculpting import drop_strokes
from ..settings import properties
from ..ui_text import localize
from . import beds, follow, loop
from .beds import blocking_reason, find_bed


class Note(NamedTuple):
    """Message to the user: level of Blender's operator reports, text, and uid of the bed it is about."""

    level: str
    message: str
    uid: int = 0


def start(context: Context, bed: Object) -> list[Note]:
    """Begin a session of a bed from its stored state; raise DigiclayError if settings or scale forbid it."""
    if is_baked(bed):
        raise DigiclayError(
            f"{bed.name} plays a baked session: free the bake in the Takes panel first."
        )
    context.view_layer.update()
    obstacle = beds.find_obstacle(context, bed, beds.Use.FORM)
    if obstacle:
        raise DigiclayError(f"The session of {bed.name} cannot start: {obstacle}.")
    settings, scene, notes = (properties.read_stored_settings(bed),), properties.scene_of(bed), []
    if bed.data.users > 1:
        bed.data = bed.data.copy()
        notes.append(localize("{} got pins of its own: it shared them with another bed", bed.name))
    notes.append(repair.give_fingertip(bed, scene))
    context.view_layer.update()
    reason = blocking_reason(context, bed, scene.cells)
    if reason:
        raise DigiclayError(f"The session of {bed.name} cannot start: {reason}.")
    numbers, was, poses = tuple(fingertips_of(bed)), beds.read_numbers(bed), bridge.poses(bed)
    stood, (*_, lines) = beds.read_poses(bed), beds.read_queue(bed)
    base, unfit = beds.read_base(bed), ""
    if base is not None and base.size != scene.cells:
        unfit = localize(
            "The stored base must have the bed's {} pins (got {}): the surface is the base",
            scene.cells,
            base.size,
        )
    if lines and stood is not None:  # the fingertip has come along a stroke, which begins anew
        poses = running.match_poses(stood, was, poses, numbers)
    begun, fault = sculpting.begin_session(
        bed.session_uid,
        bed.name,
        scene,
        poses,
        beds.read_snapshot(bed),
        beds.read_tick(bed),
        numbers,
        was,
        base,
    )
    begun = stored.add_strokes(begun, lines)
    aim = pressers.read_pressers(context, bed)
    pressers.refuse_sunk(bed, begun.system, aim)
    show(bed, replace(begun, settings=settings, aim=aim))
    if lines:
        place_fingers(context, bed, begun)
    damaged = len(lines) - len(begun.strokes)
    words = (
        localize("Stored press strokes that cannot be read ({}) were left out", damaged)
        if damaged
        else ""
    )
    faults = [Note("WARNING", f"{bed.name}: {each}") for each in (fault, words, unfit) if each]
    return [*(Note("INFO", words) for words in notes if words), *faults]


def stop(uid: int) -> str:
    """End a session: its bed keeps the state, and a take of the recording; return words about the take."""
    ended = running.TABLE.sessions.get(uid)
    bed = find_bed(ended) if ended else None
    if ended is not None and bed is not None and ended.stroke_start:
        # The stroke is then kept whole, from its beginning.
        back = sculpting.restore_moment(ended, ended.standing)
        show(bed, replace(back, strokes=ended.strokes, stroke_start=None))
    running.drop(uid)
    follow.end(uid)
    return takes.keep_recording(bed, ended) if ended is not None and bed is not None else ""


def show(bed: Object, session: Running) -> None:
    """Make a value the present one of a session, write it into its bed, and show it if its mesh allows."""
    running.put(session)
    beds.write(bed, session)
    if not bridge.find_fault(bed.data, session.system.grid.count):
        view.show_state(bed, session.system, session.state)


def place_fingers(context: Context, bed: Object, session: Running) -> None:
    """Put the fingertips where a session has them; an animation or constraint of a fingertip prevails."""
    _move_fingers(bed, session, len(session.poses))
    _evaluate(context)


def bring_back(context: Context, bed: Object, session: Running) -> None:
    """Show a session as it was at another moment, its fingertips too."""
    show(bed, session)
    place_fingers(context, bed, session)


def _evaluate(context: Context) -> None:
    """Have Blender evaluate what has changed: only then the world's matrix of a moved fingertip is right."""
    context.view_layer.update()


def _move_fingers(bed: Object, session: Running, count: int = 1) -> None:
    """Put the first fingertips where a session has them, without evaluation."""
    bridge.move_fingertips(bed, session.poses[:count], find_ellipsoids(session.scene))


def form_strokes(context: Context, bed: Object) -> None:
    """Form at once what a bed without a session has stored of strokes, as far as that takes some seconds."""
    start(context, bed)
    session = running.TABLE.sessions[bed.session_uid]
    end = session.state.period + takes.MOST // session.system.grid.count
    while session.strokes and session.state.period < end:
        session = sculpting.follow_finger(
            replace(session, tick=session.tick + 1), session.pose, sculpting.CHUNK
        )
    bring_back(context, bed, session)
    stop(session.uid)


def take_up(context: Context, bed: Object, session: Running) -> Running:
    """Return a session with what undo or redo has put into its bed."""
    poses, was, queue = beds.read_poses(bed), beds.read_numbers(bed), beds.read_queue(bed)
    if poses is None:
        others = session.poses[:1].repeat(len(was), axis=0)
        poses = running.match_poses(session.poses, session.numbers, others, was)
    back = stored.take_up(session, beds.read_snapshot(bed), poses, was, *queue, beds.read_base(bed))
    if queue[-1]:
        place_fingers(context, bed, back)
    return back


def has_strokes() -> bool:
    """Return whether a session has a stroke to finish that the hand has drawn, and is free to do so."""
    free = (
        session
        for session in running.list_sessions()
        if not (session.paused or session.blocking_reason)
    )
    return any(session.strokes and not session.strokes[0].held for session in free)


def end_haste(context: Context) -> None:
    """Let ticks take their time again, and show what has been formed in haste."""
    if loop.LOOP.in_haste:
        loop.LOOP.in_haste = False
        for session in running.list_sessions():
            bed = find_bed(session)
            if bed is not None:
                bring_back(context, bed, session)


def tick(context: Context, now: float) -> list[Note]:
    """Advance every session to the current time of a monotonic clock, s; return the messages."""
    notes: list[Note] = []
    most = preferences.get(context).most_periods
    for session in running.list_sessions():
        bed = find_bed(session)
        if bed is not None:
            notes += _advance_session(context, bed, session, now, most)
            continue
        running.drop(session.uid)
        follow.end(session.uid)
        words = localize("The session of {} ended: its bed was deleted", session.name)
        notes.append(Note("WARNING", words, session.uid))
    return notes


def _advance_session(
    context: Context, bed: Object, session: Running, now: float, most: int
) -> Iterator[Note]:
    """Advance one session; yield its messages."""
    if session.stale > 1:
        # What undo has put back has no place in the world until Blender has evaluated it, which it
        # does before the next tick.
        running.put(replace(session, stale=session.stale - 1))
        return
    before = session
    followed, server_news = follow.follow(session.uid, now)
    reason, session, changes = _read_changes(context, bed, session)
    news = filter(None, (changes, server_news))
    yield from (Note("WARNING", f"{bed.name}: {words}", session.uid) for words in news)
    session = replace(session, blocking_reason=reason, name=bed.name)
    if reason:
        waiting = replace(session, clock=session.clock.stopped(), tick=session.tick + 1)
        running.put(waiting)
        beds.write(bed, waiting, session)
        if reason != before.blocking_reason:
            yield Note(
                "WARNING", localize("The session of {} waits: {}", bed.name, reason), session.uid
            )
        return
    if before.blocking_reason:
        yield Note("INFO", localize("The session of {} goes on", bed.name), session.uid)
    seen = _visible_rows(session)
    try:
        # The fingertip of a stroke is where the session has put it.
        poses = session.poses if session.strokes else bridge.poses(bed)
        if followed is not None and not session.strokes:
            poses = follow.place(session.uid, poses)
        moment = find_moment(context) if followed is None else None
        later = sculpting.advance(
            session, poses, now, most, view.picked_pins(bed), loop.find_interval(context), moment
        )
    except (DivergenceError, MethodError) as error:
        back = sculpting.restore_moment(session, session.standing)
        later = replace(drop_strokes(back), paused=True)
        yield Note(
            "ERROR", localize("The session of {} is paused: {}", bed.name, error), session.uid
        )
    running.put(later)
    # Whatever is written into the bed, Blender draws.
    if loop.LOOP.in_haste and later.finished_strokes == session.finished_strokes:
        return
    following = follow.find(session.uid)
    moved = bool(session.strokes) or followed is not None
    if moved:
        _move_fingers(bed, later, max(1, len(following.seats) if following else 0))
    beds.write(bed, later, before)
    # Drawing costs most: where nothing has changed, nothing is redrawn.
    if (
        before.stale
        or before.blocking_reason
        or changes
        or not np.array_equal(seen, _visible_rows(later))
    ):
        view.show_state(bed, later.system, later.state)
    if moved:  # One evaluation of pins and fingertip takes less time than one of each.
        _evaluate(context)


def find_moment(context: Context) -> float | None:
    """Return the time of the scene's frame, s, while an animation plays; None: none does."""
    scene, screen = context.scene, context.screen
    if screen is None or not screen.is_animation_playing:
        return None
    return float(
        (scene.frame_current + scene.frame_subframe) * scene.render.fps_base / scene.render.fps
    )


def _visible_rows(session: Running) -> Floats:
    """Return all that can be seen of a session's cells, shape (4, n)."""
    state, force = session.state, session.system.rows.force
    return np.array([state.row(0), state.row(force), state.mode(), state.waiting()])


def _read_changes(context: Context, bed: Object, session: Running) -> tuple[str, Running, str]:
    """Detect changes of settings and undo; return the reason to wait, the session, and the messages."""
    reason, words = blocking_reason(context, bed, session.system.grid.count), ""
    if reason:
        return reason, session, words
    bridge.keep_sizes(bed)
    try:
        settings = _read_settings(bed, session)
        changed = settings != session.settings or properties.find_layout_mismatch(
            bed, session.scene.layout
        )
        if session.stale or session.blocking_reason or changed:
            session, words = _take_settings(bed, session)
            session = replace(session, settings=settings)
        if session.stale:
            back = take_up(context, bed, session)
            if session.recording is not None and back.recording is None:
                words = localize("The recording ended: undo or redo left what was recorded")
            session = back
        aim, given = pressers.read_pressers(context, bed, session.aim), find_given(session.system)
        if aim and given:
            # Not in the time of the periods, by which the clock limits their number.
            given.measure(aim)
        if aim and (session.reached is None or len(session.reached) != len(aim)):
            pressers.refuse_sunk(bed, session.system, aim)
        session = replace(session, aim=aim)
    except DigiclayError as error:
        return str(error), session, words
    return "", session, words


def _read_settings(bed: Object, session: Running) -> tuple[Any, ...]:
    """Return what the scene of a session is made of: its bed's settings, and the size of its stroke."""
    sizes = [(stroke.finger, stroke.blister) for stroke in session.strokes[:1]]
    return properties.read_stored_settings(bed), *sizes


def _take_settings(bed: Object, session: Running) -> tuple[Running, str]:
    """Return the session with the scene of its bed's settings, and words about what that ended."""
    scene, tips, poses = properties.scene_of(bed), fingertips_of(bed), bridge.poses(bed)
    for stroke in session.strokes[:1]:
        scene = suit_scene(scene, stroke)
    fingers, numbers = find_ellipsoids(scene), tuple(tips)
    if fingers != tuple(map(bridge.finger_of, tips.values())):
        for tip, finger in zip(tips.values(), fingers, strict=True):
            bridge.resize_fingertip(tip, finger)
        bridge.move_fingertips(bed, poses, fingers)
    if scene == session.scene and numbers == session.numbers:
        return session, ""
    changed, words = sculpting.change_scene(session, scene, numbers, poses)
    # A take is of one scene: what was recorded under the former one is not lost.
    ended = len(session.strokes) - len(changed.strokes)
    dropped = (
        localize("Press strokes ended unfinished ({}): their fingertip is gone", ended)
        if ended
        else ""
    )
    words = ". ".join(filter(None, (words or dropped, takes.keep_recording(bed, session))))
    return changed, words
