"""Smooths pins with the Press tool as a hand does: X events from outside, in continuous motion."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.window.hand_strokes import (
    add_bed,
    drag,
    finish,
    focus_window,
    hand,
    note,
    on_the_screen,
    take_tool,
    to,
)

#: Half the length of a stroke, mm; how long the hand takes for it, s, and moves a second.
HALF, DURATION, RATE = 15.0, 0.6, 125
#: How far the pins stand out that are smoothed, m, and where, mm.
SPIKE, SPIKES = 12e-3, ((0.0, 0.0), (0.0, 18.0))


def find_session(blender: Any) -> Any:
    """Return the session of the bed."""
    return blender.part("sessions.running").find(blender.beds()[0])


def put_spikes(blender: Any) -> None:
    """Let single pins of the session's bed stand out."""
    session = find_session(blender)
    system = session.system
    state = blender.part("core.engine.simulation").begin(system)
    cells = system.grid.at(*(1e-3 * np.array(SPIKES)).T)
    for row in (0, system.rows.target):
        state.rows[row, cells] += SPIKE
    state.modes[cells] = 1
    kept = blender.part("core.session.snapshot").dump(system, state._replace(peak=float(state.rows[0].max())))
    pose = session.pose.copy()
    pose[2] = 0.08
    back = blender.part("sessions.sculpting").restore(session, kept, pose)
    blender.part("live.tick").show(blender.beds()[0], back)
    blender.part("live.tick").place_finger(bpy.context, blender.beds()[0], back)
    blender.call(bpy.ops.ed.undo_push, message="Spikes")


def way(blender: Any, y: float) -> tuple[str, str]:
    """Return what moves the hand to the start of a stroke along x, and along it."""
    start, end = (on_the_screen(blender, x, y) for x in (-HALF, HALF))
    return to(start), drag(start, end, DURATION, RATE)


def script(blender: Any) -> Iterator[float | None]:
    """Smooth by Shift and by the header's brush, undo, cancel, and form a line by Shift and a click."""
    add_bed(blender)
    take_tool(blender)
    yield from focus_window()
    corner = on_the_screen(blender, -27.0, -27.0)
    yield from finish(blender, hand(to(corner), "click 1"))
    put_spikes(blender)
    yield from blender.settle(5)
    note(blender, "before")
    start, along = way(blender, 0.0)
    first: list[list[float]] = []

    def started() -> bool:
        strokes = find_session(blender).strokes
        if strokes:
            first.append([1e3 * strokes[-1].samples[0].x, 1e3 * strokes[-1].samples[0].y])
        return bool(strokes)

    process = hand(start, "keydown shift sleep 0.2 mousedown 1", along, "mouseup 1 keyup shift")
    yield from blender.until(started)
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot("smooth_shift_under_way")
    yield from finish(blender, process)
    note(blender, "smoothed")
    blender.SEEN["smoothed"]["first"] = first[-1]
    blender.shot("smooth_shift")
    yield from finish(blender, hand(to(on_the_screen(blender, 0.0, -30.0)), "key ctrl+z"))
    note(blender, "undone")
    yield from by_brush(blender)
    yield from click(blender)


def by_brush(blender: Any) -> Iterator[float | None]:
    """Smooth with the brush of the header; then once more, and take that back by Esc."""
    settings = blender.part("press.brush").tool_settings(bpy.context)
    settings.brush = "SMOOTH"
    start, along = way(blender, 18.0)
    process = hand(start, "mousedown 1", along)
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot("smooth_brush_under_way")
    yield from finish(blender, hand("mouseup 1"))
    note(blender, "by brush")
    blender.shot("smooth_brush")
    start, along = way(blender, 0.0)
    process = hand(start, "mousedown 1", along, "sleep 2")
    yield from blender.until(lambda: any(one.reached for one in find_session(blender).strokes))
    yield from finish(blender, hand("key Escape sleep 0.2 mouseup 1"))
    yield from finish(blender, process)
    note(blender, "escaped")
    settings.brush = "LOWER"


def click(blender: Any) -> Iterator[float | None]:
    """Press once, then click with Shift: the line between the two."""
    ends = [on_the_screen(blender, x, -24.0) for x in (-27.0, 27.0)]
    yield from finish(blender, hand(to(ends[0]), "click 1"))
    yield from finish(blender, hand(to(ends[1]), "keydown shift sleep 0.2 click 1 sleep 0.2 keyup shift"))
    note(blender, "line")
