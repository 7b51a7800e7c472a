"""Raises, levels and smooths clay with the Press tool as a hand does: X events from outside."""

import bpy
import numpy as np

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    brush,
    done,
    finish,
    line,
    note,
    on_the_screen,
    prepare,
    reset,
    stroke,
    to,
)

#: Half the length of a stroke that raises, and of one that smooths, mm.
LONG, HALF = 30.0, 15.0
#: How long the hand takes for a stroke, s, and moves a second.
QUICK, SLOWER = (0.5, 125), (0.6, 125)
#: How far the pins stand out that are smoothed, m, and where, mm.
SPIKE, SPIKES = 12e-3, ((0.0, 0.0), (0.0, 18.0))
#: Height of a ridge along y, m, and its width, mm.
RIDGE, WIDTH = 15e-3, 8.0


def put_up(rise):
    """Have pins stand out at rest, by what is found from the grid, m."""
    session = blender.session()
    system = session.system
    state = blender.part("core.engine.simulation").begin(system)
    rises = rise(system.grid)
    for row in (0, system.rows.target):
        state.rows[row] += rises
    state.modes[rises > 0.0] = 1
    kept = blender.part("core.session.snapshot").dump(
        system, state._replace(peak=float(state.rows[0].max()))
    )
    pose = session.pose.copy()
    pose[2] = 0.08
    back = blender.part("sessions.sculpting").restore(session, kept, pose)
    blender.part("live.tick").show(blender.bed(), back)
    blender.part("live.tick").place_fingers(bpy.context, blender.bed(), back)
    blender.call(bpy.ops.ed.undo_push, message="Pins that stand out")


def spikes(grid):
    rise = np.zeros(grid.count)
    rise[grid.at(*(1e-3 * np.array(SPIKES)).T)] = SPIKE
    return rise


def ridge(grid):
    return RIDGE * np.exp(-((1e3 * grid.x / WIDTH) ** 2))


def script():
    yield from prepare()
    yield from raise_and_level()
    yield from reset()
    yield from smooth()
    yield from reset()
    yield from across_a_ridge()


def across_a_ridge():
    """Draw a line of Lower that is straight in perspective across a ridge, projected either way."""
    settings = brush()
    for project in ("SURFACE", "PLANE"):
        put_up(ridge)
        yield from blender.settle(5)
        settings.project = project
        process = line((-LONG, -HALF), (LONG, HALF), *QUICK)
        yield from done(process)
        blender.shot(f"ridge_{project.lower()}")
        (stroke,) = blender.session().strokes
        path = [[1e3 * sample.x, 1e3 * sample.y] for sample in stroke.samples]
        yield from act("key ctrl+z")
        note(project)
        blender.SEEN[project]["path"] = path


def raise_and_level():
    """Raise by the header's brush, by Ctrl, and lower by Ctrl; level the middle of what was lowered."""
    settings = brush()
    for name, kind, y, key in (
        ("raised", "RAISE", 0.0, ""),
        ("inverted", "LOWER", -21.0, "ctrl"),
        ("lowered", "RAISE", 0.0, "ctrl"),
    ):
        settings.brush, picture = kind, f"raise_{name}_under_way"
        yield from stroke(name, (-LONG, y), (LONG, y), *QUICK, key=key, picture=picture)
        if name == "raised":
            blender.shot("raise_ridge")
        if name == "inverted":
            yield from act("key ctrl+z")
            note("raising undone")
        if name != "lowered":
            yield from reset()
    settings.brush = "LEVEL"
    yield from stroke("leveled", (0.0, -24.0), (0.0, 24.0), *QUICK)
    blender.shot("raise_level")
    settings.brush = "LOWER"


def smooth():
    """Smooth by Shift and by the header's brush, undo, cancel, and form a line by Shift and a click."""
    yield from act(to(on_the_screen(-27.0, -27.0)), "click 1")
    put_up(spikes)
    yield from blender.settle(5)
    note("before")
    first = []

    def started():
        strokes = blender.session().strokes
        if strokes:
            first.append([1e3 * strokes[-1].samples[0].x, 1e3 * strokes[-1].samples[0].y])
        return bool(strokes)

    process = line((-HALF, 0.0), (HALF, 0.0), *SLOWER, key="shift")
    yield from blender.until(started)
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot("smooth_shift_under_way")
    yield from finish(process)
    note("smoothed")
    blender.SEEN["smoothed"]["first"] = first[-1]
    blender.shot("smooth_shift")
    yield from act(to(on_the_screen(0.0, -30.0)), "key ctrl+z")
    note("undone")
    yield from by_brush()
    yield from click()


def by_brush():
    """Smooth with the brush of the header; then once more, and take that back by Esc."""
    settings = brush()
    settings.brush = "SMOOTH"
    process = line((-HALF, 18.0), (HALF, 18.0), *SLOWER, last="")
    yield from blender.until(lambda: process.poll() is not None)
    blender.shot("smooth_brush_under_way")
    yield from act("mouseup 1")
    note("by brush")
    blender.shot("smooth_brush")
    process = line((-HALF, 0.0), (HALF, 0.0), *SLOWER, last="sleep 2")
    yield from blender.until(lambda: any(one.samples[3:] for one in blender.session().strokes))
    yield from act("key Escape sleep 0.2 mouseup 1")
    yield from finish(process)
    note("escaped")
    settings.brush = "LOWER"


def click():
    """Press once, then click with Shift: the line between the two."""
    ends = [on_the_screen(x, -24.0) for x in (-27.0, 27.0)]
    yield from act(to(ends[0]), "click 1")
    yield from act(to(ends[1]), "keydown shift sleep 0.2 click 1 sleep 0.2 keyup shift")
    note("line")
