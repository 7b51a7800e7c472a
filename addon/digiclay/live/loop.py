"""Loop of all live sessions: its timer, and its text in the status bar."""

import time
from dataclasses import dataclass

from .. import preferences
from ..compat import Context, Header, Timer, Window, bpy
from ..sessions import running

#: A loop that has not ticked for so long is gone, s: its window was closed without a notice.
GONE = 5.0
#: Ticks may come this much early, as a share of the time between two: timers are not exact.
EARLY = 0.2
#: Time between ticks in haste, s: after so long the progress moves, and Esc is seen.
HASTE = 0.3
#: How often the numbers in the sidebar are drawn anew, s.
NUMBERS = 0.25


@dataclass
class Loop:
    """Loop that runs: Blender's timer and the address of its window; without a timer there is none."""

    timer: Timer | None = None
    window: int = 0
    #: Number of the loop: how many were begun.
    token: int = 0
    #: Times of the last tick and of the last redraw of numbers, s.
    ticked: float = 0.0
    numbers: float = 0.0
    #: Whether for the moment no operator drives it, nor takes the keys.
    aside: bool = False
    #: Whether strokes are being finished: ticks are long, and draw nothing until one is finished.
    in_haste: bool = False
    #: Whether the sessions end as soon as their strokes are formed.
    ending: bool = False


LOOP = Loop()


def token() -> int:
    """Return the number of the loop that runs; 0 when none does."""
    return 0 if LOOP.timer is None else LOOP.token


def is_running() -> bool:
    """Return whether there is a loop, and it ticks."""
    return LOOP.timer is not None and time.perf_counter() - LOOP.ticked < GONE


def begin(context: Context) -> None:
    """Begin a loop with a timer in the window of the context."""
    end()
    LOOP.timer = _add_timer(context)
    LOOP.window, LOOP.token = context.window.as_pointer(), LOOP.token + 1
    LOOP.ticked, LOOP.numbers = time.perf_counter(), 0.0
    bpy.types.STATUSBAR_HT_header.prepend(draw)
    redraw_status()


def _add_timer(context: Context) -> Timer:
    """Add a timer at the preferred rate; its events come to the operators of the context's window alone."""
    rate = preferences.get(context).redraw_rate
    return context.window_manager.event_timer_add(1.0 / rate, window=context.window)


def time_window(context: Context) -> Window | None:
    """Return a timer for the window of the context, to be removed; None where the loop has one."""
    has_loop = LOOP.timer is not None and LOOP.window == context.window.as_pointer()
    return None if has_loop else _add_timer(context)


def is_aside() -> bool:
    """Return whether there is a loop that no operator drives for the moment."""
    return LOOP.timer is not None and LOOP.aside


def end() -> None:
    """End the loop that runs, if one does."""
    if LOOP.timer is None:
        return
    bpy.context.window_manager.event_timer_remove(LOOP.timer)
    LOOP.timer, LOOP.aside, LOOP.in_haste, LOOP.ending = None, False, False, False
    bpy.types.STATUSBAR_HT_header.remove(draw)
    redraw_status()


def find_interval(context: Context) -> float:
    """Return the time between two ticks, s."""
    return HASTE if LOOP.in_haste else 1.0 / float(preferences.get(context).redraw_rate)


def is_due(context: Context, now: float) -> bool:
    """Return whether to tick at a monotonic time, s: no more often than preferred, whatever timers run."""
    if now - LOOP.ticked < (1.0 - EARLY) / preferences.get(context).redraw_rate:
        return False
    LOOP.ticked = now
    return True


def redraw_numbers(context: Context, now: float) -> None:
    """Redraw the sidebars now and then: numbers that change too quickly cannot be read. `now`, s."""
    if now - LOOP.numbers < NUMBERS:
        return
    LOOP.numbers = now
    areas = (area for window in context.window_manager.windows for area in window.screen.areas)
    for region in (region for area in areas if area.type == "VIEW_3D" for region in area.regions):
        if region.type == "UI":
            region.tag_redraw()


def redraw_status() -> None:
    """Redraw the status bar."""
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set_internal(None)


#: Beginning of the names of operators that tell their keys themselves.
TOLD = "DIGICLAY_OT_press"


def draw(header: Header, context: Context) -> None:
    """Draw the keys of a running session in the status bar, unless the Press tool tells its own there."""
    if any(each.bl_idname.startswith(TOLD) for each in context.window.modal_operators):
        return
    row = header.layout.row()
    paused = all(session.paused for session in running.list_sessions())
    row.label(
        text="Digital Clay paused" if paused else "Digital Clay", icon="PAUSE" if paused else "PLAY"
    )
    row.label(text=" Stop", icon="EVENT_ESC")
    row.label(text="Resume" if paused else "Pause", icon="EVENT_P")
    step = row.row(align=True)
    step.label(text="", icon="EVENT_SHIFT")
    step.label(text="Single Step", icon="EVENT_P")
    if any(session.strokes for session in running.list_sessions()):
        row.label(text="Finish Strokes", icon="EVENT_RETURN")
    row.label(text="Backspace: Take Back a Gesture")
    row.label(text="Shift Backspace: Reset")
    row.separator(factor=2.0)
