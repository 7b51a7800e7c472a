"""Draws while a 3D mouse turns the view, in a quad view and a second window; leaves sculpt mode."""

import subprocess

import bpy
import numpy as np

from tests.window import driver as blender
from tests.window import space_mouse
from tests.window.hand_strokes import (
    HALF,
    act,
    done,
    drag,
    ends,
    focus_window,
    hand,
    note,
    on_the_screen,
    prepare,
    reset,
    to,
)
from tests.window.play_and_look import top_quarter

#: The last button in the header of the Sculpting workspace's 3D view, pixels from its left and top.
LEAVE = (450, 13)
#: A slow turn of the 3D mouse about the vertical axis: full is 350.
TURN = (0, 0, 0, 0, 15, 0)


def script():
    yield from prepare()
    yield from turned()
    yield from reset()
    yield from quarter()
    yield from reset()
    yield from second_window()
    yield from sculpting()


def held_stroke():
    (session,) = blender.sessions()
    return session.strokes[-1] if session.strokes and session.strokes[-1].held else None


def followed():
    yield from blender.until(lambda: held_stroke() is not None and held_stroke().reached > 0)


def let_go(name):
    yield from followed()
    path = [[1e3 * sample.x, 1e3 * sample.y] for sample in held_stroke().samples]
    yield from act("mouseup 1")
    note(name)
    blender.SEEN[name]["path"] = path


def turned():
    looking = blender.view()[0].spaces.active.region_3d
    start, end = ends()
    before, distance = np.array(looking.view_rotation), looking.view_distance
    middle = (start[0] + end[0]) // 2, (start[1] + end[1]) // 2
    # To and fro for as long as it takes to turn the view.
    there, back = drag(start, middle, 1.0, 60), drag(middle, start, 1.0, 60)
    process = hand(to(start), "mousedown 1", *[there, back] * 60)
    yield from followed()

    def is_turned():
        space_mouse.push(TURN)
        return bool(np.abs(np.array(looking.view_rotation) - before).max() > 0.03)

    yield from blender.until(is_turned)
    space_mouse.push((0,) * 6)
    process.terminate()
    yield from done(process)
    seen = {"held": held_stroke() is not None}
    # What a trackpad sends to Blender on X11: two fingers up, to the left and to the right are
    # wheels.
    yield from done(hand("click 4 sleep 0.1 click 6 sleep 0.1 click 7 sleep 0.1"))
    seen["nearer"] = distance / looking.view_distance
    yield from done(hand(drag(middle, on_the_screen(HALF, 0.0), 0.5, 60)))
    yield from let_go("turned")
    blender.SEEN["turned"] |= seen | {
        "turned": np.abs(np.array(looking.view_rotation) - before).max().item()
    }
    blender.shot("elsewhere_turned")


def quarter():
    blender.call(bpy.ops.screen.region_quadview)
    yield from blender.until(lambda: top_quarter() is not None)
    yield from draw_in("quarter", blender.window(), top_quarter(), (0, 0))
    blender.shot("elsewhere_quarter")
    blender.call(bpy.ops.screen.region_quadview)
    yield None


def draw_in(name, window, region, corner):
    """Draw along the middle row in a region of a window whose top left corner is somewhere on the screen."""
    seen = (blender.pixel(blender.world(x, 0.0), region) for x in (-HALF, HALF))
    start, end = ((corner[0] + across, corner[1] + window.height - 1 - up) for across, up in seen)
    yield from done(hand(to(start), "mousedown 1", drag(start, end, 1.0, 60)))
    yield from let_go(name)


def windows_on_screen():

    def told(*words):
        return subprocess.run(
            ["xdotool", *words], check=True, capture_output=True, encoding="utf-8"
        ).stdout.split()

    lines = {
        number: told("getwindowgeometry", "--shell", number)
        for number in told("search", "--onlyvisible", "--class", "blender")
    }
    return {
        one: {k: int(v) for k, v in (text.split("=") for text in found)}
        for one, found in lines.items()
    }


def second_window():
    first = set(windows_on_screen())
    bpy.ops.wm.window_new()
    yield from blender.until(lambda: len(windows_on_screen()) > len(first))
    number, shown = next((one, at) for one, at in windows_on_screen().items() if one not in first)
    window = bpy.context.window_manager.windows[-1]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    looking, seen = region.data, blender.view()[0].spaces.active.region_3d
    looking.view_location, looking.view_distance = seen.view_location, seen.view_distance
    yield from blender.rounds()  # its matrices are those of the last drawing
    yield from done(hand(f"windowfocus --sync {number}"))
    yield from draw_in("second window", window, region, (shown["X"], shown["Y"]))
    blender.SEEN["second window"]["windows"] = len(bpy.context.window_manager.windows)
    blender.shot("elsewhere_window")
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    yield from blender.until(lambda: len(bpy.context.window_manager.windows) == 1)
    yield from focus_window()


def sculpting():
    blender.select(blender.bed())
    home = blender.window().workspace
    blender.window().workspace = bpy.data.workspaces["Sculpting"]
    yield from blender.until(lambda: bpy.context.mode == "SCULPT")
    blender.SEEN["mode before"] = bpy.context.mode
    blender.shot("elsewhere_sculpting")
    area, _ = blender.view()
    at = area.x + LEAVE[0], blender.window().height - (area.y + area.height) + LEAVE[1]
    yield from done(hand(to(at, 0.2), "click 1"))
    yield from blender.until(lambda: bpy.context.mode == "OBJECT")
    blender.shot("elsewhere_back")
    tool = blender.window().workspace.tools.from_space_view3d_mode("OBJECT")
    blender.SEEN["back"] = {"mode": bpy.context.mode, "tool": tool.idname}
    blender.window().workspace = home
    yield None
