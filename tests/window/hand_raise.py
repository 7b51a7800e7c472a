"""Raises and levels clay with the Press tool as a hand does: X events from outside, in continuous motion."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.window.hand_strokes import (
    add_bed,
    drag,
    finish,
    focus_window,
    hand,
    note,
    on_the_screen,
    reset,
    take_tool,
    to,
)

#: Half the length of a stroke, mm; how long the hand takes for it, s, and moves a second.
HALF, DURATION, RATE = 30.0, 0.5, 125


def line(blender: Any, y: float, hold: str = "") -> Iterator[float | None]:
    """Draw a line along x in one quick motion, with a key held down."""
    start, end = (on_the_screen(blender, x, y) for x in (-HALF, HALF))
    down, up = (f"keydown {hold}", f"keyup {hold}") if hold else ("", "")
    way = drag(start, end, DURATION, RATE)
    process = hand(to(start), down, "sleep 0.1 mousedown 1", way, "mouseup 1", up)
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot(f"raise_{hold or 'tool'}_{y:g}_under_way")
    yield from finish(blender, process)


def script(blender: Any) -> Iterator[float | None]:
    """Raise by the header's brush, by Ctrl, level the middle of what was raised, and lower by Ctrl."""
    add_bed(blender)
    take_tool(blender)
    yield from focus_window()
    settings = blender.part("press.brush").tool_settings(bpy.context)
    settings.brush = "RAISE"
    yield from line(blender, 0.0)
    note(blender, "raised")
    blender.shot("raise_ridge")
    yield from reset(blender)
    settings.brush = "LOWER"
    yield from line(blender, -21.0, "ctrl")
    note(blender, "inverted")
    yield from finish(blender, hand("key ctrl+z"))
    note(blender, "undone")
    yield from reset(blender)
    settings.brush = "RAISE"
    yield from line(blender, 0.0, "ctrl")
    note(blender, "lowered")
    settings.brush = "LEVEL"
    start, end = (on_the_screen(blender, *at) for at in ((0.0, -24.0), (0.0, 24.0)))
    way = drag(start, end, DURATION, RATE)
    yield from finish(blender, hand(to(start), "mousedown 1", way, "mouseup 1"))
    note(blender, "leveled")
    blender.shot("raise_level")
