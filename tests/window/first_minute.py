"""Follows the tutorial of a first relief by real events, step by step; takes its pictures and its film."""

import os
import time
from itertools import pairwise
from math import cos, pi, sin
from pathlib import Path

import bpy

from tests.window import driver as blender
from tests.window.hand_strokes import (
    catch_up,
    focus_window,
    hand,
    note,
    on_the_screen,
    rest,
    to,
)

#: Pictures show the pins as a user sees them; a film has a frame for each step of the hand.
FINE_PINS = PICTURED = "DIGICLAY_SCREENSHOTS" in os.environ
#: Pixels from the upper right corner of the sidebar to the tab, and in it to the first button; from
#: the corners of other windows to the menu File, the arrow of *Get Extensions*, the button
#: *Export*.
TAB, START, FILE, ARROW, EXPORT = (-10, 178), (-130, 45), (46, 13), (-20, 19), (-60, -22)
#: How far the middle mouse button drags the view, pixels: down, to look more from above.
TILT = 95
#: Steps in which it goes from one place to the next.
TURNS = 11
#: What the curves of the two hearts are multiplied by, mm; steps along each; and their turn, rad:
#: upright in the view of the start-up file.
OUTER, INNER, TURN = (3.7, 108), (1.6, 48), 0.815
#: Depth of the inner one that is typed, mm.
DEPTH = 8
#: The fingertip comes below this place along x of the bed, mm, on the left side of the outer one
#: alone.
LEFT = -30.0


def lay_heart(size, steps):
    """Return the places of a heart, mm, from its notch back to its notch."""
    places = []
    for angle in (2.0 * pi * step / steps for step in range(steps + 1)):
        x = size * 16.0 * sin(angle) ** 3
        y = size * (
            13.0 * cos(angle) - 5.0 * cos(2 * angle) - 2.0 * cos(3 * angle) - cos(4 * angle) + 2.0
        )
        places.append((cos(TURN) * x - sin(TURN) * y, sin(TURN) * x + cos(TURN) * y))
    return places


def in_the_sidebar(place):
    area, _ = blender.view()
    bar = next(region for region in area.regions if region.type == "UI")
    return bar.x + bar.width + place[0], blender.window().height - (bar.y + bar.height) + place[1]


def middle():
    x, y = blender.middle()
    return x, blender.window().height - 1 - y


def done(*words):
    process = hand(*words)
    yield from blender.until(lambda: process.poll() is not None)
    yield 1.0


def go(way, duration, first, last, picture=""):
    """Have a hand go along a way on the screen, for a time, s, between words; wait for the fingertip.

    For a film it goes step by step. `picture`: taken when the fingertip is on the left side.
    """
    words = [f"{to(way[0], 0.3)} {first}", *(to(pixel, duration / len(way)) for pixel in way), last]
    words = words if PICTURED else [" ".join(words)]
    while words or any(one.strokes for one in blender.sessions()):
        if words:
            process = hand(words.pop(0))
            yield from blender.until(lambda process=process: process.poll() is not None, every=0.02)
        yield 0.02
        if PICTURED:
            blender.take_frame(f"film_{len(list(blender.OUT.glob('film_*'))):04d}")
            if picture and 1e3 * blender.session().pose[0] < LEFT:
                blender.shot(picture)
                picture = ""


def turn(*offsets):
    """Turn the view by the middle mouse button, through offsets from the middle, pixels, a step each."""
    x, y = middle()
    corners = [(x + right, y + below) for right, below in ((0, 0), *offsets)]
    way = [
        (round(a[0] + share * (b[0] - a[0])), round(a[1] + share * (b[1] - a[1])))
        for a, b in pairwise(corners)
        for share in (step / TURNS for step in range(TURNS + 1))
    ]
    yield from go(way, 0.5, "mousedown 2", "mouseup 2")


def newest():
    window = bpy.context.window_manager.windows[-1]
    return window, (window.x, blender.window().height - window.y - window.height)


def install():
    """Open the menu with *Install from Disk*: the driver has installed what the zip contains."""
    blender.call(bpy.ops.screen.userpref_show, "INVOKE_DEFAULT", section="EXTENSIONS")
    yield 2.0
    shown, (x, y) = newest()
    yield from done(to((x + shown.width + ARROW[0], y + ARROW[1])), "click 1")
    blender.shot("relief_install")
    yield from done("key Escape")
    with bpy.context.temp_override(window=shown):
        bpy.ops.wm.window_close()
    yield from focus_window()


def add():
    yield from done(to(middle()), "key x sleep 0.5 key Return")
    typed = " ".join(f"key {letter} sleep 0.05" for letter in "dig")
    yield from done("key shift+a sleep 0.5", typed, "sleep 0.5 key Return")
    blender.SEEN["added"] = len(blender.beds())
    blender.SEEN["things"] = [thing.name for thing in blender.window().scene.objects]
    blender.SEEN["selected"] = [thing.name for thing in bpy.context.selected_objects]
    blender.SEEN["distance"] = blender.view()[0].spaces.active.region_3d.view_distance


def start():
    yield from done("key n")
    yield from done(to(in_the_sidebar(TAB)), "click 1")
    bar = next(region for region in blender.view()[0].regions if region.type == "UI")
    blender.SEEN["tab"] = bar.active_panel_category
    yield from done(to(in_the_sidebar(START)), "click 1")
    blender.SEEN["started"] = len(blender.sessions())
    blender.SEEN["tool"] = blender.window().workspace.tools.from_space_view3d_mode("OBJECT").idname
    blender.shot("relief_start")


def look():
    """Close the sidebar, and look more from above."""
    if PICTURED:  # speed and remaining time are not those of a computer with a graphics card
        blender.bed().digiclay_display.overlay = False
        bpy.context.preferences.addons[blender.EXTENSION].preferences.show_cursor_text = False
        blender.view()[0].spaces.active.overlay.show_text = False
    yield from done("key n")
    yield from turn((0, TILT))
    yield 1.0


def trace(name, places, *how):
    """Have a hand draw through places over the bed, mm; write down what it has left."""
    blender.SEEN[f"{name} drawn"] = places
    yield from go([on_the_screen(*place) for place in places], *how)
    yield from rest()
    note(name)


def ridge():
    ctrl = "keydown ctrl sleep 0.2 mousedown 1", "mouseup 1 keyup ctrl"
    yield from trace("ridge", lay_heart(*OUTER), 3.0, *ctrl, "relief_ridge")


def valley():
    yield from done(to(on_the_screen(0.0, 0.0)), "key ctrl+f sleep 0.5", f"key {DEPTH}")
    blender.shot("relief_depth")
    yield from done("key Return")
    yield from trace("valley", lay_heart(*INNER), 1.5, "mousedown 1", "mouseup 1")


def stop():
    """Turn the view there and back; then stop."""
    yield from turn((120, -30), (-90, -30), (0, 0))
    yield from done("key Escape")
    blender.SEEN["left"] = len(blender.sessions())
    blender.shot("relief_done")


def export():
    """Write the second entry of the menu into the folder of the results."""
    for words in (f"{to(FILE)} click 1", "key e", "key d", "key Down"):
        yield from done(words)
    blender.shot("relief_export")
    yield from done("key Return")
    yield from blender.until(lambda: len(bpy.context.window_manager.windows) > 1)
    yield 1.0
    shown, (x, y) = newest()
    browser = next(area for area in shown.screen.areas if area.type == "FILE_BROWSER")
    browser.spaces.active.params.directory = bytes(blender.OUT)
    yield 1.0
    yield from done(to((x + shown.width + EXPORT[0], y + shown.height + EXPORT[1])), "click 1")
    yield from blender.until(lambda: any(blender.OUT.glob("*.stl")))


#: Steps of the tutorial: the first sentence of each, and what a hand does.
STEPS = (
    ("Install the zip.", install),
    ("Add a bed.", add),
    ("Start a session.", start),
    ("Look from above.", look),
    ("Raise a ridge.", ridge),
    ("Press a valley.", valley),
    ("Stop.", stop),
    ("Export the relief.", export),
)


def waiting():
    """Return how long Blender has waited for the processor, s; 0 where that is not counted."""
    counts = Path("/proc/self/schedstat")
    return 1e-9 * int(counts.read_text().split()[1]) if counts.is_file() else 0.0


def script():
    """Do what the page says, in the file that Blender starts with; then take hold of the ball."""
    catch_up()
    blender.SEEN["pictured"] = PICTURED
    yield from focus_window()
    for words, step in STEPS:
        began, waited = time.perf_counter(), waiting()
        yield from step()
        blender.SEEN.setdefault("steps", []).append(words)
        blender.SEEN.setdefault("took", []).append(
            [time.perf_counter() - began, waiting() - waited]
        )
    yield from ball()


def ball():
    blender.choose_tool("builtin.select_box")
    tip = blender.fingertip()
    before = list(tip.matrix_world.translation)
    x, y = blender.pixel(tip["digiclay_ellipsoid"].matrix_world.translation)
    at = x, blender.window().height - 1 - y
    yield from done(to(at), "click 1")
    blender.SEEN["taken hold of"] = bpy.context.view_layer.objects.active == blender.fingertip()
    yield from done("key g", "sleep 0.3", to((at[0] + 60, at[1])), "sleep 0.3 click 1")
    after = list(blender.fingertip().matrix_world.translation)
    blender.SEEN["moved"] = [b - a for a, b in zip(before, after, strict=True)]
