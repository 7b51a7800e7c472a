"""Follows the first page of the guide by real events: adds a bed, takes hold of the ball, starts, draws."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from hand_strokes import drag, finish, focus_window, hand, note, on_the_screen, to

#: Places in the sidebar, pixels from its upper right corner at a resolution scale of 1: the tab, and in it
#: the first button.
TAB, START = (-10, 178), (-130, 45)


def in_the_sidebar(blender: Any, place: tuple[int, int]) -> tuple[int, int]:
    """Return where a place in the sidebar is on the screen."""
    area, _ = blender.view()
    bar = next(region for region in area.regions if region.type == "UI")
    return bar.x + bar.width + place[0], blender.window().height - (bar.y + bar.height) + place[1]


def middle(blender: Any) -> tuple[int, int]:
    """Return the middle of the 3D view on the screen."""
    x, y = blender.middle()
    return x, blender.window().height - 1 - y


def done(blender: Any, *words: str) -> Iterator[float | None]:
    """Have a hand do something, and wait until Blender has drawn it."""
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield 1.0


def script(blender: Any) -> Iterator[float | None]:
    """Do what the page says."""
    area, _ = blender.view()
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.call(bpy.ops.object.delete)
    yield from focus_window()
    typed = " ".join(f"key {letter} sleep 0.05" for letter in "digital")
    began = time.perf_counter()
    yield from done(blender, to(middle(blender)), "key shift+a sleep 0.5", typed, "sleep 0.5 key Return")
    blender.shot("first_added")
    blender.SEEN["added"] = len(blender.beds())
    blender.SEEN["distance"] = area.spaces.active.region_3d.view_distance
    yield from done(blender, "key n")
    yield from done(blender, to(in_the_sidebar(blender, TAB)), "click 1")
    blender.shot("first_tab")
    bar = next(region for region in area.regions if region.type == "UI")
    blender.SEEN["tab"] = bar.active_panel_category
    yield from done(blender, to(in_the_sidebar(blender, START)), "click 1")
    blender.shot("first_started")
    blender.SEEN["started"] = len(blender.part("live.running").list_sessions())
    blender.SEEN["tool"] = blender.window().workspace.tools.from_space_view3d_mode("OBJECT").idname
    start, end = on_the_screen(blender, -27.0, 0.0), on_the_screen(blender, 27.0, 0.0)
    process = hand(to(start), "mousedown 1", drag(start, end, 2.0, 60), "mouseup 1")
    yield from finish(blender, process)
    blender.SEEN["took"] = time.perf_counter() - began
    note(blender, "drawn")
    blender.shot("first_drawn")
    yield from done(blender, "key Escape")
    blender.call(bpy.ops.wm.tool_set_by_id, name="builtin.select_box")
    tip = blender.fingertip()
    before = list(tip.matrix_world.translation)
    ball = tip["digiclay_ellipsoid"].matrix_world.translation
    x, y = blender.pixel(ball)
    at = x, blender.window().height - 1 - y
    yield from done(blender, to(at), "click 1")
    blender.SEEN["taken hold of"] = bpy.context.view_layer.objects.active == blender.fingertip()
    yield from done(blender, "key g", "sleep 0.3", to((at[0] + 60, at[1])), "sleep 0.3 click 1")
    after = list(blender.fingertip().matrix_world.translation)
    blender.SEEN["moved"] = [b - a for a, b in zip(before, after, strict=True)]
    blender.shot("first_ball")
