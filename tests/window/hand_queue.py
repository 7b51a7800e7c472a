"""Draws faster than strokes are formed, from outside Blender: a queue, its end at once, Esc, undo, load."""

import time
from itertools import pairwise

import bpy

from tests.window.hand_strokes import (
    act,
    brush,
    done,
    drag,
    hand,
    note,
    on_the_screen,
    prepare,
    reset,
    to,
)

#: Ends of three quick strokes, mm, drawn one after the other in so many moves, within so long each,
#: s.
LINES = (
    ((-27.0, 20.0), (27.0, 20.0)),
    ((-27.0, 0.0), (27.0, 0.0)),
    ((-27.0, -20.0), (27.0, -20.0)),
)
DURATION, RATE = 0.25, 120
#: Wave of a single stroke, drawn under different loads, mm.
WAVE = ((-27.0, -9.0), (-9.0, 12.0), (9.0, -12.0), (27.0, 9.0))
#: Redraws a second, and how long something else takes between two, s.
LOADS = {"alone": (30, 0.0), "few redraws": (4, 0.0), "a load": (30, 0.15)}


def draw(blender, *paths, then=""):
    words = []
    for path in paths:
        places = [on_the_screen(blender, *place) for place in path]
        words += [to(places[0], 0.02), "mousedown 1"]
        words += [
            drag(start, end, DURATION / (len(places) - 1), RATE) for start, end in pairwise(places)
        ]
        words += ["mouseup 1"]
    return hand(*words, then)


def drawn(blender, *paths):
    yield from done(blender, draw(blender, *paths))


def script(blender):
    yield from prepare(blender, "TOP", bed="paper")
    yield from act(blender, to(on_the_screen(blender, 0.0, 0.0)), "click 1")  # the session begins
    yield from reset(blender)
    yield from taken_back(blender)
    # Ridges take the device of this bed much longer.
    brush(blender).brush, brush(blender).height = "RAISE", 8.0
    yield from queue(blender)
    yield from haste(blender)
    brush(blender).brush = "LOWER"
    for name, (rate, load) in LOADS.items():
        yield from under_load(blender, name, rate, load)


def queue(blender):
    # So few are for a finger that is moved by hand.
    preferences, usual = blender.preferences(), blender.preferences().most_periods
    preferences.most_periods = 1
    process = draw(blender, *LINES)
    while process.poll() is None:
        yield 0.02
    ended, simulated = time.perf_counter(), blender.session().state.period
    blender.shot("queue_ghost")
    blender.SEEN["left"] = len(blender.session().strokes)
    while blender.session().strokes:
        yield 0.02
    spent = time.perf_counter() - ended
    preferences.most_periods = usual
    simulated = (blender.session().state.period - simulated) * blender.session().system.period
    blender.SEEN["time"] = {"after the hand": spent, "simulated": simulated}
    yield from blender.settle()
    note(blender, "formed")
    for count in (1, 2):
        yield from act(blender, to(on_the_screen(blender, 0.0, -33.0)), "key ctrl+z sleep 0.2")
        note(blender, f"undone {count}")
    for count in (1, 2):
        yield from act(blender, "key ctrl+shift+z sleep 0.2")
        note(blender, f"redone {count}")
    yield from act(blender, "key BackSpace sleep 0.2")
    note(blender, "backspace")
    yield from reset(blender)


def haste(blender):
    loop = blender.part("live.loop").LOOP
    for name, keys in (
        ("finished", "key Return"),
        ("let go on", "key Return sleep 0.05 key Escape"),
    ):
        yield from done(blender, draw(blender, *LINES, then=keys))
        yield from blender.until(lambda: not loop.in_haste)
        note(blender, name)
        blender.SEEN[name]["left"] = len(blender.session().strokes)
        yield from blender.until(lambda: not blender.session().strokes)
        yield from blender.settle()
        note(blender, f"{name}, formed")
        yield from act(blender, to(on_the_screen(blender, 0.0, -33.0)), "key ctrl+z sleep 0.2")
        note(blender, f"{name}, undone")
        yield from reset(blender)


def taken_back(blender):
    """Take back queued strokes, redo them; save a queue, and press Esc three times while it is formed."""
    away = to(on_the_screen(blender, 0.0, -33.0))
    yield from drawn(blender, *LINES)
    yield from act(blender, away, "key ctrl+z sleep 0.2 key ctrl+z sleep 0.2")
    note(blender, "two taken back")
    yield from act(blender, "key ctrl+shift+z sleep 0.2 key ctrl+shift+z sleep 0.2")
    note(blender, "two redone")
    yield from reset(blender)
    # A ridge takes longer than the keys after it.
    brush(blender).brush = "RAISE"
    yield from drawn(blender, *LINES)
    file = str(blender.OUT / "queue.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    yield from done(blender, hand("key Escape sleep 0.05 key Escape sleep 0.05 key Escape"))
    blender.SEEN["after Esc"] = len(blender.sessions())
    yield from blender.until(lambda: not blender.sessions())
    note(blender, "stopped")
    bpy.ops.wm.open_mainfile(filepath=file)
    yield from blender.until(
        lambda: not blender.part("live.beds").read_queue(blender.beds()[0])[-1]
    )
    yield from blender.rounds()
    note(blender, "opened")
    brush(blender).brush = "LOWER"
    yield from act(blender, to(on_the_screen(blender, 0.0, -33.0)), "click 1")
    yield from reset(blender)


def under_load(blender, name, rate, load):
    preferences = blender.preferences()
    preferences.redraw_rate = rate

    def burn():
        until = time.perf_counter() + load
        while time.perf_counter() < until:
            pass
        return None if not preferences.redraw_rate else 0.01

    if load:
        bpy.app.timers.register(burn)
    process, path = draw(blender, WAVE), []

    def formed():
        strokes = blender.session().strokes
        path[:] = [(sample.x, sample.y) for sample in strokes[0].samples] if strokes else path
        return bool(path) and not strokes and process.poll() is not None

    # A quick machine forms it in a quarter of a second.
    yield from blender.until(formed, 0.02)
    yield from blender.rounds()
    if load:
        bpy.app.timers.unregister(burn)
    yield from blender.settle()
    note(blender, name)
    blender.SEEN[name] |= {"path": path, "exact": blender.session().state.row(0).tolist()}
    yield from reset(blender)
