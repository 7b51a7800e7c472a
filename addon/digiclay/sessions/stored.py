"""Sessions and what their beds store: taken up after undo, redo and loading. No Blender."""

from dataclasses import replace

from ..core.base.arrays import Floats
from ..core.session.live_session import Moment
from ..strokes import drawn
from .restored_states import Numbers
from .running import Gesture, Running, name_fingers
from .sculpting import drop_strokes, queue_stroke, restore


def take_up(
    running: Running,
    stored: bytes | None,
    poses: Floats,
    was: Numbers,
    tick: int,
    ticks: list[int],
    lines: list[str],
    base: Floats | None,
) -> Running:
    """Return the session with what undo or redo has put into its bed, as `restore`.

    `ticks`: of its gestures. `lines`: strokes to be formed from there, by `strokes.drawn`. Those
    that the session has formed so stand at once, and the one that it is forming goes on.
    """
    gestures = {gesture.tick: gesture for gesture in (*running.undone, *running.gestures)}
    formed: dict[tuple[str, bytes | None], tuple[Gesture, Moment]] = {
        (gesture.stroke, gesture.snapshot): (gesture, gesture.end)
        for gesture in gestures.values()
        if gesture.end
    }
    while lines and (lines[0], stored) in formed:
        gesture, end = formed[lines[0], stored]
        stored, poses, tick, base = end.snapshot, end.poses, end.tick, end.base
        ticks, lines = [*ticks, gesture.tick], lines[1:]
        was = name_fingers(running.numbers, len(poses))
    start = running.stroke_start
    if start and lines and start.snapshot == stored and drawn.dump(running.strokes[0]) == lines[0]:
        back, ticks = replace(running, strokes=running.strokes[:1], stale=0), [*ticks, start.tick]
        lines = lines[1:]
    else:
        back = restore(drop_strokes(running), stored, poses, tick, was, base)
    done = tuple(gestures.pop(tick) for tick in ticks if tick in gestures)
    return add_strokes(replace(back, gestures=done, undone=tuple(gestures.values())), lines)


def add_strokes(running: Running, lines: list[str]) -> Running:
    """Return the session with strokes of `drawn` queued, without those that are none."""
    for line in lines:
        stroke = drawn.load(line)
        if stroke is not None:
            running, _ = queue_stroke(running, stroke)
    return running
