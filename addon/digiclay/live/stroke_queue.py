"""Queue of unfinished press strokes of a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..device.instant import find_ellipsoid
from .running import Gesture, Running
from .stroke import SYMMETRIES, Brush, Mirror, Stroke, start
from .stroke_motion import follow
from .tracking import find_tracking

__all__ = ["change_stroke", "drop_strokes", "find_stroke", "last_place", "queue_stroke", "take_path"]

Floats = NDArray[np.float64]


def queue_stroke(
    running: Running, x: float, y: float, depth: float, mirrors: tuple[Mirror, ...] = SYMMETRIES["NONE"],
    brush: Brush = Brush.LOWER, share: float = 1.0,
) -> tuple[Running, int]:  # fmt: skip
    """Queue the stroke of a mouse that goes down at a place, m; return its number as well.

    Parameters
    ----------
    running : Running
    x, y, depth, share : float
        See `stroke.Sample`.
    mirrors : tuple of (float, float), optional
        See `stroke.SYMMETRIES`.
    brush : Brush, optional
    """
    number = 1 + (running.strokes[-1].number if running.strokes else running.finished_strokes)
    return replace(
        running, strokes=(*running.strokes, start(number, x, y, depth, mirrors, brush, share))
    ), number


def find_stroke(running: Running, number: int) -> Stroke | None:
    """Return the stroke of a number, or None when it is finished or was taken back.

    Parameters
    ----------
    running : Running
    number : int
    """
    return next((stroke for stroke in running.strokes if stroke.number == number), None)


def last_place(running: Running) -> tuple[float, float] | None:
    """Return where the last stroke ends, x and y, m; None before the first."""
    if not running.strokes:
        return running.last_place
    end = running.strokes[-1].samples[-1]
    return end.x, end.y


def change_stroke(running: Running, number: int, change: Callable[[Stroke], Stroke]) -> Running:
    """Return the session with one of its strokes changed, if it still has it.

    Parameters
    ----------
    running : Running
    number : int
        Of the stroke.
    change : callable
        Returns a stroke in place of another.
    """
    strokes = tuple(change(one) if one.number == number else one for one in running.strokes)
    return replace(running, strokes=strokes)


def drop_strokes(running: Running) -> Running:
    """Return the session without what the finger has not finished; it stays where it is."""
    return replace(running, strokes=(), stroke_start=None)


def take_path(running: Running, count: int) -> tuple[Running, Floats]:
    """Take from the first stroke where the finger goes in the next control periods.

    Parameters
    ----------
    running : Running
        With a stroke at least.
    count : int
        Most control periods.

    Returns
    -------
    running : Running
        Without the stroke when that ends here. Where it began is where a gesture began.
    path : ndarray (k + 1, 7)
        Poses between the periods, k at most `count`.
    """
    system, first = running.system, running.strokes[0]
    tracking = first.tracking
    if first.height is None:
        tracking = find_tracking(running.scene, system)
        begun = Gesture(running.state.period, running.snapshot, running.pose)
        running = replace(running, next_gesture=begun, stroke_start=begun)
    finger = find_ellipsoid(running.scene)
    height = running.state.row(0)
    now = running.clock.seen or first.began
    stroke, path = follow(
        first, system.grid, height, finger, running.pose, count, system.period, now, tracking
    )
    left = (stroke, *running.strokes[1:])
    running = replace(running, strokes=left)
    if stroke.done:
        end = stroke.samples[-1]
        running = replace(
            running, strokes=left[1:], stroke_start=None, finished_strokes=running.finished_strokes + 1,
            last_place=(end.x, end.y),
        )  # fmt: skip
    return running, path
