"""Loop of all live sessions: its timer, and its text in the status bar."""

from __future__ import annotations

import time
from typing import Any

from .. import preferences
from ..compat import bpy
from . import running

#: A loop that has not ticked for so long is gone, s: its window was closed in a way nobody told.
GONE = 5.0
#: Ticks may come this much early, as a share of the time between two: timers are not exact.
EARLY = 0.2
#: How often the numbers in the sidebar are drawn anew, s.
NUMBERS = 0.25

#: The loop that runs: its timer and window, a number of its own, times of the last tick and drawn numbers.
_LOOP: dict[str, Any] = {}
_COUNT = [0]


def token() -> int:
    """Return the number of the loop that runs; 0 when none does."""
    return int(_LOOP["token"]) if _LOOP else 0


def is_running() -> bool:
    """Return whether there is a loop, and it ticks."""
    return bool(_LOOP) and time.perf_counter() - float(_LOOP["ticked"]) < GONE


def begin(context: Any) -> int:
    """Begin a loop with a timer in the window of the context; return its token."""
    end()
    _COUNT[0] += 1
    timer = context.window_manager.event_timer_add(
        1.0 / preferences.get(context).redraw_rate, window=context.window
    )
    window, now = context.window.as_pointer(), time.perf_counter()
    _LOOP.update(timer=timer, window=window, token=_COUNT[0], ticked=now, numbers=0.0)
    bpy.types.STATUSBAR_HT_header.prepend(draw)
    redraw_status()
    return _COUNT[0]


def time_window(context: Any) -> Any | None:
    """Return a timer for the window of the context, to be removed; None where the loop has one.

    A timer's events come to the operators of its window alone.
    """
    if _LOOP and _LOOP["window"] == context.window.as_pointer():
        return None
    rate = preferences.get(context).redraw_rate
    return context.window_manager.event_timer_add(1.0 / rate, window=context.window)


def step_aside() -> None:
    """Note that for the moment no operator drives the loop, nor takes the keys."""
    _LOOP["aside"] = True


def take_over() -> None:
    """Note that an operator drives the loop."""
    _LOOP.pop("aside", None)


def is_aside() -> bool:
    """Return whether there is a loop that no operator drives for the moment."""
    return "aside" in _LOOP


def end() -> None:
    """End the loop that runs, if one does."""
    if not _LOOP:
        return
    bpy.context.window_manager.event_timer_remove(_LOOP["timer"])
    _LOOP.clear()
    bpy.types.STATUSBAR_HT_header.remove(draw)
    redraw_status()


def is_due(context: Any, now: float) -> bool:
    """Return whether to tick now: no more often than preferred, though other timers may run as well.

    `context` bpy.types.Context; `now`: monotonic time, s.
    """
    wanted = (1.0 - EARLY) / preferences.get(context).redraw_rate
    if now - float(_LOOP["ticked"]) < wanted:
        return False
    _LOOP["ticked"] = now
    return True


def redraw_numbers(context: Any, now: float) -> None:
    """Have the sidebars drawn anew, now and then: numbers that change too quickly cannot be read.

    `context` bpy.types.Context; `now`: monotonic time, s.
    """
    if now - float(_LOOP["numbers"]) < NUMBERS:
        return
    _LOOP["numbers"] = now
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def redraw_status() -> None:
    """Have the status bar drawn anew."""
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set_internal(None)


def draw(header: Any, context: Any) -> None:
    """Draw the keys of a running session in the status bar.

    `header` bpy.types.Header; `context` bpy.types.Context.
    """
    sessions = running.list_sessions()
    row = header.layout.row()
    paused = all(session.paused for session in sessions)
    row.label(text="Digital Clay paused" if paused else "Digital Clay", icon="PAUSE" if paused else "PLAY")
    row.label(text=" Stop", icon="EVENT_ESC")
    row.label(text="Resume" if paused else "Pause", icon="EVENT_P")
    step = row.row(align=True)
    step.label(text="", icon="EVENT_SHIFT")
    step.label(text="Single Step", icon="EVENT_P")
    row.label(text="Backspace: Take Back a Gesture")
    row.label(text="Shift Backspace: Reset")
    row.separator(factor=2.0)
