"""Draws faster than strokes are formed, from outside Blender: a queue, its end at once, Esc, undo, load."""

import time
from itertools import pairwise

import bpy

from tests.window import driver as blender
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


def draw(*paths, then=""):
    words = []
    for path in paths:
        places = [on_the_screen(*place) for place in path]
        words += [to(places[0], 0.02), "mousedown 1"]
        words += [
            drag(start, end, DURATION / (len(places) - 1), RATE) for start, end in pairwise(places)
        ]
        words += ["mouseup 1"]
    return hand(*words, then)


def drawn(*paths):
    yield from done(draw(*paths))


def script():
    yield from prepare("TOP", bed="paper")
    yield from act(to(on_the_screen(0.0, 0.0)), "click 1")  # the session begins
    yield from reset()
    yield from taken_back()
    # Ridges take the device of this bed much longer.
    brush().brush, brush().height = "RAISE", 8.0
    yield from queue()
    yield from haste()
    brush().brush = "LOWER"
    for name, (rate, load) in LOADS.items():
        yield from under_load(name, rate, load)


def queue():
    # So few are for a finger that is moved by hand.
    preferences, usual = blender.preferences(), blender.preferences().most_periods
    preferences.most_periods = 1
    process = draw(*LINES)
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
    note("formed")
    for count in (1, 2):
        yield from act(to(on_the_screen(0.0, -33.0)), "key ctrl+z sleep 0.2")
        note(f"undone {count}")
    for count in (1, 2):
        yield from act("key ctrl+shift+z sleep 0.2")
        note(f"redone {count}")
    yield from act("key BackSpace sleep 0.2")
    note("backspace")
    yield from reset()


def haste():
    loop = blender.part("live.loop").LOOP
    for name, keys in (
        ("finished", "key Return"),
        ("let go on", "key Return sleep 0.05 key Escape"),
    ):
        yield from done(draw(*LINES, then=keys))
        yield from blender.until(lambda: not loop.in_haste)
        note(name)
        blender.SEEN[name]["left"] = len(blender.session().strokes)
        yield from blender.until(lambda: not blender.session().strokes)
        yield from blender.settle()
        note(f"{name}, formed")
        yield from act(to(on_the_screen(0.0, -33.0)), "key ctrl+z sleep 0.2")
        note(f"{name}, undone")
        yield from reset()


def taken_back():
    """Take back queued strokes, redo them; save a queue, and press Esc three times while it is formed."""
    away = to(on_the_screen(0.0, -33.0))
    yield from drawn(*LINES)
    yield from act(away, "key ctrl+z sleep 0.2 key ctrl+z sleep 0.2")
    note("two taken back")
    yield from act("key ctrl+shift+z sleep 0.2 key ctrl+shift+z sleep 0.2")
    note("two redone")
    yield from reset()
    # A ridge takes longer than the keys after it.
    brush().brush = "RAISE"
    yield from drawn(*LINES)
    file = str(blender.OUT / "queue.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    yield from done(hand("key Escape sleep 0.05 key Escape sleep 0.05 key Escape"))
    blender.SEEN["after Esc"] = len(blender.sessions())
    yield from blender.until(lambda: not blender.sessions())
    note("stopped")
    bpy.ops.wm.open_mainfile(filepath=file)
    yield from blender.until(lambda: not blender.part("live.beds").read_queue(blender.bed())[-1])
    yield from blender.rounds()
    note("opened")
    brush().brush = "LOWER"
    yield from act(to(on_the_screen(0.0, -33.0)), "click 1")
    yield from reset()


def under_load(name, rate, load):
    preferences = blender.preferences()
    preferences.redraw_rate = rate

    def burn():
        until = time.perf_counter() + load
        while time.perf_counter() < until:
            pass
        return None if not preferences.redraw_rate else 0.01

    if load:
        bpy.app.timers.register(burn)
    process, path = draw(WAVE), []

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
    note(name)
    blender.SEEN[name] |= {"path": path, "exact": blender.session().state.row(0).tolist()}
    yield from reset()
