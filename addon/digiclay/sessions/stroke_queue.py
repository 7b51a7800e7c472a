"""Queue of unfinished press strokes of a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..core.base.arrays import Floats
from ..core.base.modes import Mode
from ..core.session.live_session import Moment
from ..device.instant import find_ellipsoid
from ..strokes.motion import follow
from ..strokes.stroke import LEAVING, SETTLING, SYMMETRIES, Brush, Mirror, Stroke, start
from ..strokes.sweep import begin_settling, find_radius, settle, sweep
from ..strokes.tracking import find_tracking
from .running import Running


def queue_stroke(
    running: Running, x: float, y: float, depth: float, mirrors: tuple[Mirror, ...] = SYMMETRIES["NONE"],
    brush: Brush = Brush.LOWER, share: float = 1.0, lean: tuple[float, float] = (0.0, 0.0),
) -> tuple[Running, int]:  # fmt: skip
    """Queue the stroke of a mouse that goes down at a place; return its number as well; see `Sample`."""
    number = 1 + (running.strokes[-1].number if running.strokes else running.finished_strokes)
    return replace(
        running, strokes=(*running.strokes, start(number, x, y, depth, mirrors, brush, share, lean))
    ), number


def find_stroke(running: Running, number: int) -> Stroke | None:
    """Return the stroke of a number, or None when it is finished or was taken back."""
    return next((stroke for stroke in running.strokes if stroke.number == number), None)


def last_place(running: Running) -> tuple[float, float] | None:
    """Return where the last stroke ends, x and y, m; None before the first."""
    if not running.strokes:
        return running.last_place
    end = running.strokes[-1].samples[-1]
    return end.x, end.y


def change_stroke(running: Running, number: int, change: Callable[[Stroke], Stroke]) -> Running:
    """Return the session with one of its strokes changed, if it still has it."""
    strokes = tuple(change(stroke) if stroke.number == number else stroke for stroke in running.strokes)
    return replace(running, strokes=strokes)


def drop_strokes(running: Running) -> Running:
    """Return the session without unfinished strokes; the fingertip stays there, upright."""
    pose, turn = running.pose, running.strokes[0].turn if running.strokes else None
    pose = pose if turn is None else np.concatenate([pose[:3], turn])
    return replace(running, strokes=(), stroke_start=None, pose=pose)


def take_path(running: Running, count: int) -> tuple[Running, Floats, Floats | None]:
    """Return the session, and path (k + 1, 7) and smoothing orders (k, 4) of its first stroke, k <= count."""
    first = running.strokes[0]
    if first.height is None:
        begun = Moment(running.state.period, running.snapshot, running.pose)
        running = replace(running, next_gesture=begun, stroke_start=begun)
    stroke, path, smoothing = _advance(running, first, count)
    left = (stroke, *running.strokes[1:])
    running = replace(running, strokes=left)
    if stroke.done:
        end = stroke.samples[-1]
        running = replace(
            running, strokes=left[1:], stroke_start=None, finished_strokes=running.finished_strokes + 1,
            last_place=(end.x, end.y),
        )  # fmt: skip
    return running, path, smoothing


def _advance(running: Running, stroke: Stroke, count: int) -> tuple[Stroke, Floats, Floats | None]:
    """Advance the fingertip along a stroke; return it, the path, and the smoothing orders."""
    system, pose = running.system, running.pose
    finger, height = find_ellipsoid(running.scene), running.state.row(0)
    now, period = running.clock.seen or stroke.began, system.period
    arrived = not bool((running.state.mode() == Mode.BLISTER).any())
    if stroke.phase == SETTLING:
        target, blister = running.state.row(system.rows.target), running.scene.blister
        assert blister is not None  # a stroke that is tracked has one
        return settle(stroke, system.grid, target, finger, blister, pose, count, period, arrived=arrived)
    if stroke.brush is Brush.SMOOTH:
        radius = find_radius(finger, system.grid.layout)
        arrived = arrived and stroke.phase == LEAVING
        height = np.maximum(height, running.state.row(system.rows.target))
        return sweep(stroke, height, radius, pose, count, period, now, arrived=arrived)
    tracking = find_tracking(running.scene, system) if stroke.height is None else stroke.tracking
    stroke, path = follow(stroke, system.grid, height, finger, pose, count, period, now, tracking)
    return begin_settling(stroke) if stroke.done else stroke, path, None
