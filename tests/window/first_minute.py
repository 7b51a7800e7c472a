"""Follows the first page of the guide by real events, step by step, and takes its pictures."""

import os
import time
from pathlib import Path

import bpy

from tests.window.hand_strokes import catch_up, drag, finish, focus_window, hand, note, on_the_screen, to

#: The guide's pictures show the pins as a user sees them.
FINE_PINS = "DIGICLAY_SCREENSHOTS" in os.environ
#: Places in the sidebar, pixels from its upper right corner at a resolution scale of 1: the tab, and in it
#: the first button.
TAB, START = (-10, 178), (-130, 45)

#: Half the length of the line, mm.
HALF = 24.0


def in_the_sidebar(blender, place):
    area, _ = blender.view()
    bar = next(region for region in area.regions if region.type == "UI")
    return bar.x + bar.width + place[0], blender.window().height - (bar.y + bar.height) + place[1]


def middle(blender):
    x, y = blender.middle()
    return x, blender.window().height - 1 - y


def done(blender, *words):
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield 1.0


def add(blender):
    typed = " ".join(f"key {letter} sleep 0.05" for letter in "dig")
    yield from done(blender, to(middle(blender)), "key shift+a sleep 0.5", typed, "sleep 0.5 key Return")
    blender.SEEN["added"] = len(blender.beds())
    blender.SEEN["things"] = [thing.name for thing in blender.window().scene.objects]
    blender.SEEN["selected"] = [thing.name for thing in bpy.context.selected_objects]
    blender.SEEN["distance"] = blender.view()[0].spaces.active.region_3d.view_distance


def open_tab(blender):
    yield from done(blender, "key n")
    yield from done(blender, to(in_the_sidebar(blender, TAB)), "click 1")
    bar = next(region for region in blender.view()[0].regions if region.type == "UI")
    blender.SEEN["tab"] = bar.active_panel_category


def start(blender):
    yield from done(blender, to(in_the_sidebar(blender, START)), "click 1")
    blender.SEEN["started"] = len(blender.sessions())
    blender.SEEN["tool"] = blender.window().workspace.tools.from_space_view3d_mode("OBJECT").idname


def draw(blender):
    """Draw a line over the middle with Ctrl held; look at the finger on its way."""
    first, last = on_the_screen(blender, -HALF, 0.0), on_the_screen(blender, HALF, 0.0)
    words = to(first), "keydown ctrl mousedown 1", drag(first, last, 2.0, 60), "mouseup 1 keyup ctrl"
    process = hand(*words)
    yield from blender.until(lambda: along(blender) > 0.0)
    blender.shot("guide_ridge")
    yield from finish(blender, process)
    note(blender, "drawn")


def stop(blender):
    yield from done(blender, "key Escape")
    blender.SEEN["left"] = len(blender.sessions())


#: Steps of the guide's first page: the first sentence of each, and what a hand does.
STEPS = (
    ("Press **Shift A** over the 3D view, type `dig` and press Enter.", add),
    ("Press **N** and select the tab *Digital Clay*.", open_tab),
    ("Press **Start Sculpting** in the panel *Session*.", start),
    ("Hold **Ctrl** and drag across the pins.", draw),
    ("Press **Esc**.", stop),
)


def waiting():
    """Return how long Blender has waited for the processor, s; 0 where that is not counted."""
    counts = Path("/proc/self/schedstat")
    return 1e-9 * int(counts.read_text().split()[1]) if counts.is_file() else 0.0


def along(blender):
    """Return where the finger is along its line, mm; before the line where it begins."""
    (session,) = blender.sessions()
    dragging = blender.part("strokes.stroke").DRAGGING
    on_the_way = session.strokes and session.strokes[0].phase == dragging
    return 1e3 * float(session.pose[0]) if on_the_way else -HALF


def script(blender):
    """Do what the page says, in the file that Blender starts with; then take hold of the ball."""
    catch_up(blender)
    yield from focus_window()
    began, waited = time.perf_counter(), waiting()
    for words, step in STEPS:
        yield from step(blender)
        if step is draw:
            blender.SEEN["took"] = time.perf_counter() - began
            blender.SEEN["waited"] = waiting() - waited
            yield from point(blender)
        blender.SEEN.setdefault("steps", []).append(words)
    yield from ball(blender)


def point(blender):
    """Point at the pins with the sidebar closed: a picture of the guide."""
    yield from done(blender, "key n", "sleep 0.5", to(on_the_screen(blender, -16.0, -22.0)))
    blender.shot("guide_press")


def ball(blender):
    blender.call(bpy.ops.wm.tool_set_by_id, name="builtin.select_box")
    tip = blender.fingertip()
    before = list(tip.matrix_world.translation)
    x, y = blender.pixel(tip["digiclay_ellipsoid"].matrix_world.translation)
    at = x, blender.window().height - 1 - y
    yield from done(blender, to(at), "click 1")
    blender.SEEN["taken hold of"] = bpy.context.view_layer.objects.active == blender.fingertip()
    yield from done(blender, "key g", "sleep 0.3", to((at[0] + 60, at[1])), "sleep 0.3 click 1")
    after = list(blender.fingertip().matrix_world.translation)
    blender.SEEN["moved"] = [b - a for a, b in zip(before, after, strict=True)]
