"""Return of a live session to before a gesture or a press stroke, and to rest; no Blender."""

from __future__ import annotations

from dataclasses import replace

from ..device.instant import CLEARANCE
from .running import Moment, Running
from .sculpting import REST, restore
from .stroke_queue import drop_strokes


def rewind(running: Running) -> Running:
    """Take back the last gesture: state and finger are where it began; nothing changes if there is none."""
    if running.strokes:
        return withdraw_stroke(running)
    if not running.gestures:
        return running
    *earlier, last = running.gestures
    return restore_gesture(replace(running, gestures=tuple(earlier)), last)


def withdraw_stroke(running: Running) -> Running:
    """Take back the last stroke: state and finger are where it began, or it never begins."""
    *earlier, last = running.strokes
    if last.height is None:
        return replace(running, strokes=tuple(earlier))
    assert running.stroke_start is not None
    return drop_strokes(restore_gesture(running, running.stroke_start))


def restore_gesture(running: Running, gesture: Moment) -> Running:
    """Bring state and finger back to where a gesture began; a recording that began before goes back too.

    A finger that touched there already has to move on before it makes another gesture: else it counted at
    once, and could be taken back for ever without a way to those before it.

    `gesture`: one of the session.
    """
    back = restore(replace(running, recording=None), gesture.snapshot, gesture.pose)
    keep = running.recording
    # The gesture a reset leaves behind has periods of another count.
    if keep is not None:
        keep = keep.cut_at_period(gesture.period) if gesture.period == back.state.period else None
    next_gesture = gesture if back.next_gesture is not None else None
    return replace(back, next_gesture=next_gesture, rest_time=REST, recording=keep)


def reset(running: Running) -> Running:
    """Bring the bed back to rest and lift the finger off it; this can be rewound like a gesture."""
    # Before period 0, at which the first gesture after the reset may begin.
    before = Moment(-1, running.snapshot, running.pose)
    pose = running.pose.copy()
    pose[2] = max(pose[2], running.system.cell.actuator.rest_height + CLEARANCE)
    back = restore(replace(drop_strokes(running), gestures=()), None, pose, tick=-1)
    return replace(back, gestures=(before,), trace=replace(back.trace, rows=back.trace.rows[:0]), errors=None)
