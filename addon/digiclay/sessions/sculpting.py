"""Start, advance and return of a live session, and its queue of press strokes; no Blender."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.base.arrays import Floats
from ..core.control.orders import Orders
from ..core.engine.state import State
from ..core.model.fingers import MOST_FINGERS
from ..core.scene.assembly import assemble
from ..core.scene.schema import Scene
from ..core.session import accuracy, live_session, recent_trace, snapshot
from ..core.session.live_session import Moment
from ..device.instant import CLEARANCE
from ..strokes import drawn
from ..strokes.locks import AT_ONCE, await_locks, order_at_once
from ..strokes.motion import begin as begin_stroke
from ..strokes.motion import follow, follow_images
from ..strokes.pose import turn_image
from ..strokes.stroke import FINISHING, RETURNING, Brush, Stroke
from ..strokes.sweep import SWEEPS, finish, sweep
from ..strokes.tracking import find_tracking
from .restored_states import Numbers, change_fingers, restore_state
from .running import (
    Gesture,
    Running,
    find_device,
    find_stroke,
    is_resized,
    list_pressing,
    match_poses,
    name_fingers,
    suit_scene,
)

#: How many gestures can be taken back, and the most memory their states may take, bytes.
GESTURES, GESTURE_BYTES = 20, 200_000_000
#: A fingertip that moves on after resting so long makes another gesture, s.
REST = 0.5
#: Control periods of a queue that are simulated at a time, and between two estimates of the error:
#: so many go by in a second that one as often as under a hand takes a quarter of the time.
CHUNK, PAUSE = 16, 10 * accuracy.PAUSE
#: Time between two ticks, s, unless told.
INTERVAL = 1.0 / 30.0
#: A finger that is read this near to where it was has not moved, m and parts of a quaternion: one
#: that is put to a pose comes back from Blender's 32 bits, on a bed 100 units from the origin, by
#: 1e-6 m beside it.
STILL = 2e-6


def begin_session(
    uid: int,
    name: str,
    scene: Scene,
    pose: Floats,
    stored: bytes | None = None,
    tick: int = 0,
    numbers: Numbers | None = None,
    was: Numbers | None = None,
    base: Floats | None = None,
) -> tuple[Running, str]:
    """Begin a session from a snapshot, at rest without one; return it, and what of the snapshot was lost.

    `numbers`: of the fingertips, behind those of the scene others like its first one; `was`: of
    those that the snapshot has. `base`: (n,) heights that strokes count from, m; None: the surface.
    """
    fingers = len(scene.fingers)
    numbers = numbers or tuple(range(1, fingers + 1))
    whole = scene.with_fingers(len(numbers))
    system = assemble(whole)
    state, now, base, lost = restore_state(scene, system, stored, was or numbers, numbers, base)
    poses = live_session.clamp_pose(pose.reshape(-1, 7), system.cell.actuator.stroke)
    running = Running(
        scene=scene,
        system=system,
        state=state,
        poses=poses,
        uid=uid,
        name=name,
        snapshot=now,
        tick=tick + 1,
        base=base,
        numbers=numbers[:fingers],
        clock=live_session.Clock(),
        monitor=accuracy.start(whole),
        trace=recent_trace.start(system.period, fingers=fingers),
        next_gesture=Moment(state.period, now, poses, tick, base),
    )
    return running, lost


def advance(
    running: Running,
    pose: Floats,
    now: float,
    most: int,
    pins: Sequence[int] | None = None,
    interval: float = INTERVAL,
    moment: float | None = None,
) -> Running:
    """Let a session follow the fingertip to a pose (7,) until `now`, s, monotonic; uses `running` up.

    Strokes do not wait for the clock: they take a share of the `interval` between two ticks, s.
    """
    if pins is not None:
        running = replace(
            running, trace=recent_trace.pick(running.trace, pins, running.system.grid.count)
        )
    running = replace(running, tick=running.tick + 1)
    if running.strokes and not running.paused:
        held = running.strokes[-1].held
        spare = live_session.find_spare(running.clock, now, interval, held)
        return _work_off(running, now, spare)
    if running.paused:
        count, clock = running.steps, running.clock.stopped()
    else:
        count, clock = live_session.periods_due(
            running.clock, now, running.system.period, most, moment
        )
    running = replace(running, clock=clock, steps=0)
    return follow_finger(running, pose, count) if count else running


def _work_off(running: Running, now: float, spare: float) -> Running:
    """Simulate strokes for a wall time, s, until one is finished or waits for the hand."""
    finished = running.finished_strokes
    first = running.state.period
    started = time.perf_counter()
    spent = 0.0
    while running.finished_strokes == finished:
        count = live_session.count_fitting(running.clock, spare - spent, CHUNK)
        before = running.state.period
        running = _follow_stroke(running, count)
        spent = time.perf_counter() - started
        if spent >= spare or running.state.period == before:
            break
    done = (running.state.period - first) * running.system.period
    return replace(running, clock=live_session.count_queue(running.clock, now, done, spent))


def request_step(running: Running) -> Running:
    """Request one more control period of a paused session; pause one that is not."""
    return replace(running, paused=True, steps=running.steps + 1)


def follow_finger(running: Running, pose: Floats, count: int) -> Running:
    """Simulate control periods while fingertips move along strokes, or else to poses (f, 7) or one (7,)."""
    if running.strokes:
        return pack(_follow_stroke(running, count))
    poses = live_session.clamp_pose(pose.reshape(-1, 7), running.system.cell.actuator.stroke)
    running = _mark_gesture_start(running, poses, count)
    path = live_session.interpolate_path(running.poses, poses, count)
    return pack(_follow(running, path, None, accuracy.PAUSE))


def _follow_stroke(running: Running, count: int) -> Running:
    """Simulate at most so many control periods of the first stroke; none where it waits for the hand."""
    stroke = running.strokes[0]
    running, path, orders = take_path(running, count)
    if len(path) > 1:
        # The other fingers stay where they are.
        paths = np.repeat(running.poses[None], len(path), axis=0)
        paths[:, list_pressing(running)[: path.shape[1]]] = path
        running = _follow(running, paths, orders, PAUSE)
    return running if find_stroke(running, stroke.number) else _end_stroke(running, stroke)


def _end_stroke(running: Running, stroke: Stroke) -> Running:
    """Note where a stroke has ended, so that redo brings it back as it stands."""
    running, start = pack(replace(running, stroke_start=None)), running.stroke_start
    *earlier, last = running.gestures or (None,)
    if last is None or start is None or last.snapshot is not start.snapshot:
        # It has touched nothing.
        return running
    return replace(
        running, gestures=(*earlier, replace(last, stroke=drawn.dump(stroke), end=running.standing))
    )


def _give_fingers(running: Running, count: int) -> Running:
    """Return the session with so many fingertips for a stroke, new ones where the first one's images are."""
    fingers = len(running.numbers)
    total = fingers + min(max(count, 1), MOST_FINGERS - fingers + 1) - 1
    had = len(running.poses)
    if total == had or running.system.cell.touch is None:
        return running
    scene = running.scene.with_fingers(total)
    system = assemble(scene)
    places = snapshot.place_fingers(had, total, len(scene.bodies))
    state = snapshot.change_fingers(running.system, system, running.state, places)
    poses = np.concatenate([running.poses, np.empty((max(0, total - had), 7))])[:total]
    (x, y, z), above = poses[0, :3].tolist(), float(running.state.row(0).max()) + CLEARANCE
    images = running.strokes[0].images[1:] if total > had else ()
    for finger, image in zip(range(had, total), images, strict=False):
        poses[finger] = *image.place(x, y), max(z, above), *turn_image(poses[0, 3:], image)
    recording = running.recording and running.recording.let_in(poses)
    monitor = accuracy.restart(running.monitor, scene)
    return pack(
        replace(
            running, system=system, state=state, poses=poses, recording=recording, monitor=monitor
        )
    )


def pack(running: Running) -> Running:
    """Return the session with the snapshot of its state; while a stroke is formed it has an earlier one."""
    return replace(running, snapshot=snapshot.dump(running.system, running.state))


def _follow(running: Running, path: Floats, orders: Orders | None, pause: int) -> Running:
    """Simulate control periods of a path (k + 1, f, 7), `pause` of them between two error estimates."""
    system, rows, trace = running.system, [], running.trace
    started = time.perf_counter()

    def watch(state: State) -> None:
        if state.period % trace.every == 0:
            row = recent_trace.sample(system, state, running.scene.set_point, trace.pins)
            rows.append(row[: trace.rows.shape[1]])

    gone = live_session.follow_path(running, path, orders, running.tick, watch, pause)
    clock = live_session.update_cost(running.clock, len(path) - 1, time.perf_counter() - started)
    gone = replace(gone, clock=clock, trace=recent_trace.extend(trace, rows))
    return _count_gesture(gone, ordered=orders is not None and orders.given)


def _mark_gesture_start(running: Running, poses: Floats, count: int) -> Running:
    """Mark where a gesture begins: when the fingertip moves after a rest, or does not touch."""
    moved = float(np.abs(poses - running.poses).max()) > STILL
    rest_time = 0.0 if moved else running.rest_time + count * running.system.period
    next_gesture = running.next_gesture
    free = (
        next_gesture is None
        and recent_trace.measure_total_force(running.system, running.state) == 0.0
    )
    if free or (moved and running.rest_time >= REST):
        next_gesture = running.present
    return replace(running, rest_time=rest_time, next_gesture=next_gesture)


def _count_gesture(running: Running, *, ordered: bool) -> Running:
    """Count a gesture that has touched, or has been one of the valves, among the last ones."""
    touched = ordered or recent_trace.measure_total_force(running.system, running.state) > 0.0
    if running.next_gesture is None or not touched:
        return running
    room = max(1, min(GESTURES, GESTURE_BYTES // len(running.snapshot)))
    gesture = Gesture(**vars(running.next_gesture))
    return replace(
        running, gestures=(*running.gestures, gesture)[-room:], undone=(), next_gesture=None
    )


def restore(
    running: Running,
    stored: bytes | None,
    poses: Floats,
    tick: int | None = None,
    was: Numbers | None = None,
    base: Floats | None = None,
) -> Running:
    """Return the session with another snapshot, None: at rest; a recording is cut at `tick`, or ends.

    `was`: numbers of the fingertips of the snapshot, unless they are those of the session. `base`:
    as `begin_session`.
    """
    poses = poses.reshape(-1, 7)
    # A stroke that is taken back takes its fingertips along.
    if len(running.poses) > len(running.numbers):
        system = assemble(running.scene)
        monitor = running.monitor and accuracy.start(running.scene)
        session_poses = running.poses[: len(running.numbers)]
        running = replace(running, system=system, monitor=monitor, poses=session_poses)
    was = was or name_fingers(running.numbers, len(poses))
    if was != running.numbers:
        poses = match_poses(poses, was, running.poses, running.numbers)
    state, now, base, _ = restore_state(
        running.scene, running.system, stored, was, running.numbers, base
    )
    tick = running.tick if tick is None else tick
    recording = running.recording and running.recording.cut_at_tick(tick, state.period)
    gestures = tuple(gesture for gesture in running.gestures if gesture.period < state.period)
    free = recent_trace.measure_total_force(running.system, state) == 0.0
    return replace(
        running,
        state=state,
        snapshot=now,
        clock=running.clock.stopped(),
        stale=0,
        poses=live_session.clamp_pose(poses.reshape(-1, 7), running.system.cell.actuator.stroke),
        monitor=running.monitor and accuracy.reset(running.monitor),
        errors=None,
        recording=recording,
        gestures=gestures,
        tick=running.tick + 1,
        base=base,
        correction=None,
        reached=None,
        rest_time=0.0,
        next_gesture=Moment(state.period, now, poses, running.tick, base) if free else None,
    )


def change_scene(
    running: Running, scene: Scene, numbers: Numbers | None = None, poses: Floats | None = None
) -> tuple[Running, str]:
    """Continue with other parameters, or fingertips, new ones at poses (f, 7); as `begin_session`."""
    numbers = numbers or running.numbers
    if scene == running.scene and numbers == running.numbers:
        return running, ""
    if numbers[0] != running.numbers[0]:  # another fingertip has no part in its strokes
        running = drop_strokes(running)
    running = pack(running) if running.stroke_start else running
    was, others = running.numbers, running.poses if poses is None else poses
    images = running.names[len(was) :]
    matched = match_poses(running.poses, running.names, others, numbers)
    other, lost = begin_session(
        running.uid,
        running.name,
        scene,
        np.concatenate([matched, running.poses[len(was) :]]),
        running.snapshot,
        running.tick,
        (*numbers, *images),
        running.names,
        running.base,
    )

    def carry(moment: Any) -> Any:
        if numbers == was:
            return moment
        had = name_fingers(was, len(moment.poses))
        stored = change_fingers(scene, plain, moment.snapshot, had, numbers)
        assert stored is not None
        return replace(
            moment, snapshot=stored, poses=match_poses(moment.poses, had, others, numbers)
        )

    plain = assemble(scene) if images else other.system
    # The end of a stroke that was formed with other parameters cannot be restored.
    line: dict[str, Any] = {} if is_resized(running.scene, scene) else {"stroke": ""}
    gestures, undone = (
        tuple(carry(replace(gesture, **line)) for gesture in gestures)
        for gestures in (running.gestures, running.undone)
    )
    start = running.stroke_start and carry(running.stroke_start)
    running = replace(running, gestures=gestures, undone=undone, stroke_start=start)
    names = ["clock", "paused", "blocking_reason", "stale", "reached", "aim"]
    names += ["begun_strokes", "finished_strokes", "last_place", "correction"]
    if lost:
        other = _give_fingers(other, 1)
    else:
        names += ["gestures", "undone", "strokes", "stroke_start"]
    trace = recent_trace.pick(other.trace, running.trace.pins, other.system.grid.count)
    return replace(other, trace=trace, **{name: getattr(running, name) for name in names}), lost


def set_recording(running: Running, on: bool) -> Running:
    """Begin to record the fingertip's path, or stop recording it."""
    if not on:
        return replace(running, recording=None)
    return live_session.start_recording(running, pack(running).snapshot, running.tick)


def rewind(running: Running) -> Running:
    """Take back the last gesture, or the last stroke: state and fingertip are where it began."""
    if running.strokes:
        return withdraw_stroke(running)
    if not running.gestures:
        return running
    *earlier, last = running.gestures
    return restore_gesture(
        replace(running, gestures=tuple(earlier), undone=(*running.undone, last)), last
    )


def withdraw_stroke(running: Running) -> Running:
    """Take back the last stroke: state and finger are where it began, or it never begins."""
    *earlier, last = running.strokes
    if last.height is None:
        return replace(running, strokes=tuple(earlier))
    assert running.stroke_start is not None
    return drop_strokes(restore_gesture(running, running.stroke_start))


def restore_moment(running: Running, moment: Moment) -> Running:
    """Return the session as it was at one of its moments, without its strokes' progress; see `restore`."""
    return restore(running, moment.snapshot, moment.poses, base=moment.base)


def restore_gesture(running: Running, gesture: Moment) -> Running:
    """Bring state, fingertip and recording back to where a gesture of the session began."""
    back = restore_moment(replace(running, recording=None), gesture)
    # The gesture a reset leaves behind has periods of another count.
    recording = running.recording if gesture.period == back.state.period else None
    recording = recording and recording.cut_at_period(gesture.period)
    # A fingertip that touched there already has to move on before it makes another gesture: it
    # would be counted at once, and hide those before it for ever.
    next_gesture = gesture if back.next_gesture is not None else None
    return replace(back, next_gesture=next_gesture, rest_time=REST, recording=recording)


def reset(running: Running) -> Running:
    """Bring the bed back to rest and lift the fingertip off it; this can be rewound like a gesture."""
    running = drop_strokes(running)
    # Before period 0, at which the first gesture after the reset may begin.
    before = Gesture(-1, running.snapshot, running.poses, running.tick, running.base)
    undone = (*running.undone, *running.gestures)[-GESTURES:]
    poses = running.poses.copy()
    poses[:, 2] = np.maximum(poses[:, 2], running.system.cell.actuator.rest_height + CLEARANCE)
    back = restore(replace(running, gestures=(), undone=undone), None, poses, tick=-1)
    return replace(
        back, gestures=(before,), trace=replace(back.trace, rows=back.trace.rows[:0]), errors=None
    )


def queue_stroke(running: Running, stroke: Stroke) -> tuple[Running, int]:
    """Queue a stroke under the next number; return that as well."""
    number = running.begun_strokes + 1
    strokes = (*running.strokes, replace(stroke, number=number))
    return replace(running, strokes=strokes, begun_strokes=number), number


def change_stroke(running: Running, number: int, change: Callable[[Stroke], Stroke]) -> Running:
    """Return the session with one of its strokes changed, if it still has it."""
    strokes = tuple(
        change(stroke) if stroke.number == number else stroke for stroke in running.strokes
    )
    return replace(running, strokes=strokes)


def drop_strokes(running: Running) -> Running:
    """Return the session without unfinished strokes; the fingertip stays there, upright."""
    turn = running.strokes[0].turn if running.strokes else None
    running = pack(_give_fingers(running, 1)) if running.stroke_start else running
    poses = running.poses.copy()
    if turn is not None:
        poses[0, 3:] = turn
    return replace(running, strokes=(), stroke_start=None, poses=poses)


def take_path(running: Running, count: int) -> tuple[Running, Floats, Orders | None]:
    """Return the session, and paths (k + 1, m, 7), k <= count, and orders of its first stroke.

    The paths are of the first fingertips of `list_pressing`. They end where the stroke waits for
    the hand: the clay stands still meanwhile.
    """
    stroke = running.strokes[0]
    if stroke.height is None:
        running, _ = change_scene(running, suit_scene(running.scene, stroke))
        running = replace(running, next_gesture=running.present, stroke_start=running.present)
        if stroke.brush not in AT_ONCE:
            tracking = (
                None if stroke.brush in SWEEPS else find_tracking(running.scene, running.system)
            )
            stroke = begin_stroke(stroke, running.state.row(0), running.pose[3:], tracking)
    running = _give_fingers(running, len(stroke.parts))
    stroke, path, orders = _advance(running, stroke, count)
    path = path.reshape(len(path), -1, 7)
    if stroke.done:
        stroke = await_locks(stroke, find_device(running))
    running = replace(running, strokes=(stroke, *running.strokes[1:]))
    if stroke.done:
        end = stroke.samples[-1]
        running = replace(
            running,
            strokes=running.strokes[1:],
            finished_strokes=running.finished_strokes + 1,
            last_place=(end.x, end.y),
            correction=stroke.correction,
        )
        if stroke.brush is Brush.SET_BASE:
            running = replace(running, base=running.state.row(0))
    return running, path, orders


def _advance(running: Running, stroke: Stroke, count: int) -> tuple[Stroke, Floats, Orders | None]:
    """Advance fingertips along a stroke; return it, the paths (k + 1, 7) or (k + 1, m, 7), and the orders."""
    state, pose, period = running.state, running.pose, running.system.period
    device = find_device(running)
    if stroke.brush in AT_ONCE:
        return order_at_once(stroke, device, state.row(0), pose)
    arrived = stroke.phase in (FINISHING, RETURNING) and live_session.has_arrived(state)
    if stroke.brush in SWEEPS and not stroke.placed and stroke.phase != RETURNING:
        return sweep(stroke, device, SWEEPS[stroke.brush], pose, count, period, arrived=arrived)
    if stroke.phase in (FINISHING, RETURNING):
        return finish(stroke, device, state.row(0), pose, count, period, arrived=arrived)
    if stroke.parts:
        pressing = list_pressing(running)
        poses, forces = running.poses[pressing], state.finger_forces()[pressing]
        return *follow_images(stroke, device, state.row(0), poses, count, period, forces), None
    force = recent_trace.measure_total_force(running.system, state)
    return *follow(stroke, device, state.row(0), pose, count, period, force), None
