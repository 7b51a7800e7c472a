"""Draws with the Press tool as a hand does: X events from outside Blender, in continuous motion."""

import subprocess
from pathlib import Path

import bpy
import numpy as np

from tests.window import driver as blender

#: Half the length of a stroke, mm.
HALF = 27.0
#: Duration of a stroke, s, and moves a second.
STROKES = ((0.3, 125), (3.0, 60))
#: Places of three taps within a second, mm.
TAPS = ((-24.0, 24.0), (0.0, 24.0), (24.0, 24.0))
DRAWN = Path(__file__).parents[2] / "benchmarks" / "strokes"
THINGS = ("letter_a", "r_lowered", "smiley", "spiral", "coin", "portrait")


def on_the_screen(x, y):
    """Return where a place on the pins at rest, mm, is on the screen: pixels from its top left corner."""
    left, up = blender.on_the_bed(x, y)
    return left, blender.window().height - 1 - up


def hand(*words):
    return subprocess.Popen(["xdotool", *" ".join(words).split()])


def to(at, pause=0.05):
    """Return what moves the hand to a pixel and leaves it there for a while, s."""
    return f"mousemove {at[0]} {at[1]} sleep {pause:.4f}"


def drag(start, end, duration, rate):
    count = max(2, round(duration * rate))
    way = np.linspace(start, end, count + 1)[1:].round().astype(int)
    return " ".join(to((int(x), int(y)), duration / count) for x, y in way)


def line(start, end, duration=1.0, rate=60, key="", last="mouseup 1"):
    """Start a hand that draws a line over the bed, mm, with a key held down, and ends it by some words."""
    first, final = on_the_screen(*start), on_the_screen(*end)
    down, up = (f"keydown {key} sleep 0.2", f"keyup {key}") if key else ("", "")
    return hand(to(first), down, "mousedown 1", drag(first, final, duration, rate), last, up)


def done(process):
    yield from blender.until(lambda: process.poll() is not None)
    yield from blender.rounds()


def finish(process):
    """Wait until the hand is done, and then until the fingertip is, and the pins have come to rest."""
    yield from done(process)
    yield from blender.until(lambda: not any(session.strokes for session in blender.sessions()))
    yield from rest()


def rest():
    """Let the pins come to rest: a tick simulates all the time since the one before, however long it was."""
    yield 2.0
    yield from blender.settle()


def act(*words):
    yield from finish(hand(*words))


def stroke(name, start, end, *how, picture="", key=""):
    """Draw a line, finish it, and write it down; take a picture as soon as the hand is done."""
    process = line(start, end, *how, key=key)
    if picture:
        yield from blender.until(lambda: process.poll() is not None)
        blender.shot(picture)
    yield from finish(process)
    note(name)


def note(name):
    """Write down the heights, how many strokes the fingertip has finished, and how the view is turned."""
    blender.look(name)
    session, (area, _) = blender.session(), blender.view()
    blender.SEEN[name] |= {
        "bed": blender.heights().round(3).tolist(),
        "drawn": session.finished_strokes if session else 0,
        "view": list(area.spaces.active.region_3d.view_rotation),
        "distance": area.spaces.active.region_3d.view_distance,
    }


def ends(y=0.0):
    return on_the_screen(-HALF, y), on_the_screen(HALF, y)


def reset():
    if blender.call(bpy.ops.digiclay.session_reset.poll):
        blender.call(bpy.ops.digiclay.session_reset)
    yield from blender.settle()


def add_bed(**chosen):
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.call(bpy.ops.object.delete)
    blender.call(bpy.ops.mesh.digital_clay_add, **chosen)
    blender.call(bpy.ops.view3d.view_all)
    catch_up()


def catch_up():
    """Let the session catch up between two frames: one takes software GL half a second."""
    blender.preferences().most_periods = 1000


def take_tool():
    blender.choose_tool()
    blender.call(bpy.ops.object.select_all, action="DESELECT")


def focus_window():
    """Make Blender's window the active one: else a button is pressed where the pointer is by then."""
    # A slow server has the time it needs.
    hand("search --onlyvisible --class blender windowfocus --sync").wait(300)
    yield None


def prepare(view="", **chosen):
    add_bed(**chosen)
    if view:
        blender.call(bpy.ops.view3d.view_axis, type=view)
    take_tool()
    yield from focus_window()


def brush():
    return blender.part("press.brush").tool_settings(bpy.context)


def script():
    yield from prepare()
    for duration, rate in STROKES:
        how, picture = (duration, rate), f"hand_{duration:g}"
        yield from stroke(f"stroke {duration:g}", (-HALF, 0.0), (HALF, 0.0), *how, picture=picture)
        yield from reset()
    yield from message()
    yield from taps()
    yield from navigation()
    yield from pie_menu()
    yield from taken_back()
    yield from act("key Escape")
    yield from things()


def message():
    """Draw a stroke after another one, with no key between them, while Blender shows a message."""
    tip = blender.fingertip()
    size = tip.scale.copy()
    for scale, waits in ((0.0 * size, True), (size, False)):
        tip.scale = scale
        yield from blender.until(
            lambda waits=waits: bool(blender.session().blocking_reason) == waits
        )
    blender.SEEN["message"] = blender.part("sessions.running").last_message()
    yield from stroke("stroke under a message", (-HALF, 0.0), (HALF, 0.0))
    yield from reset()


def taps():
    note("before the taps")
    yield from act(*(to(on_the_screen(*at), 0.08) + " click 1 sleep 0.15" for at in TAPS))
    note("taps")
    yield from act(to(on_the_screen(0.0, -30.0)), "key ctrl+z")
    note("one tap undone")
    yield from reset()


def navigation():
    start, end = ends()
    middle = (start[0] + end[0]) // 2, (start[1] + end[1]) // 2
    note("before orbit")
    process = hand(
        to(start),
        "mousedown 1",
        drag(start, middle, 0.5, 60),
        "mousedown 2 sleep 0.05",
        drag(middle, (middle[0] + 60, middle[1]), 0.3, 60),
        "mouseup 2 sleep 0.1",
        "click 4 sleep 0.2",
    )
    yield from done(process)
    note("in mid-stroke")
    yield from act(drag(end, on_the_screen(HALF, 0.0), 0.3, 60), "mouseup 1")
    note("after orbit")
    blender.shot("hand_orbit")
    yield from reset()


def pie_menu():
    """Pan in the middle of a stroke; then open the pie menu of the shading, and let go over Solid."""
    start, end = ends()
    x, y = (start[0] + end[0]) // 2, (start[1] + end[1]) // 2
    area, _ = blender.view()
    before = list(area.spaces.active.region_3d.view_location)
    process = hand(
        to(start), "mousedown 1", drag(start, (x, y), 0.5, 60),
        "keydown shift mousedown 2 sleep 0.05", drag((x, y), (x, y + 40), 0.3, 60),
        "mouseup 2 keyup shift sleep 0.3 key z sleep 1", drag((x, y + 40), (x + 60, y + 40), 0.3, 30),
        "sleep 0.3 mouseup 1 sleep 0.5", drag((x + 60, y + 40), (x + 90, y + 40), 0.3, 30),
    )  # fmt: skip
    yield from blender.until(lambda: process.poll() is not None)
    yield from blender.until(
        lambda: not any(one.held for s in blender.sessions() for one in s.strokes)
    )
    after = list(area.spaces.active.region_3d.view_location)
    yield from finish(process)
    note("pie menu")
    blender.SEEN["pie menu"]["panned"] = [b - a for a, b in zip(before, after, strict=True)]
    yield from reset()


def taken_back():
    for name, key in (("undone", "ctrl+z"), ("escaped", "Escape")):
        process = line((-HALF, 0.0), (HALF, 0.0), last="sleep 2")
        yield from blender.until(
            lambda: any(s.strokes and s.strokes[0].reached for s in blender.sessions())
        )
        yield from act(f"key {key} sleep 0.2")
        hand("mouseup 1")
        yield from finish(process)
        note(name)


def follow(recorded_stroke, *keys):
    start, *moves = recorded_stroke.moves
    words, before = [to(on_the_screen(1e3 * start[1], 1e3 * start[2]))], 0.0
    words += [*keys, "mousedown 1"]
    for time, x, y in moves:
        words.append(to(on_the_screen(1e3 * x, 1e3 * y), time - before))
        before = time
    return " ".join([*words, "mouseup 1"])


def things():
    """Form some things of the gallery on an empty bed, stroke by stroke, with what each has in the header."""
    read = blender.part("recorded.pointer_strokes").read_strokes
    drawn = [(name, read(DRAWN / f"{name}.toml")) for name in THINGS]
    yield from prepare("TOP", bed=drawn[0][1].bed)
    usual = tuple(bpy.context.window_manager.digiclay_finger)
    for name, recorded in drawn:
        note(f"before {name}")
        for number, one in enumerate(recorded.strokes):
            axes = one.length, one.width, one.thickness
            size = [1e3 * given or other for given, other in zip(axes, usual, strict=True)]
            if not np.allclose(bpy.context.window_manager.digiclay_finger, size):
                # The fingertip has a size at a time; the strokes of one size are drawn while others
                # wait.
                yield from blender.until(
                    lambda: not any(session.strokes for session in blender.sessions())
                )
                bpy.context.window_manager.digiclay_finger = size
            choose(one)
            # Older ones were drawn on the surface as it was, when there was no base.
            keys = ["key y sleep 0.1"] if number and one.combine == "usual" else []
            yield from done(hand(follow(one, *keys)))
        yield from blender.until(lambda: not any(session.strokes for session in blender.sessions()))
        yield from blender.settle()
        blender.shot(f"thing_{name}")
        note(name)
        yield from reset()


def choose(stroke):
    settings = brush()
    settings.brush, settings.strength = stroke.kind.value, stroke.strength
    settings.path, settings.symmetry = stroke.path.upper(), stroke.symmetry.upper()
    settings.radial, settings.depth = stroke.radial, 1e3 * stroke.depth
    settings.height = 1e3 * stroke.height
