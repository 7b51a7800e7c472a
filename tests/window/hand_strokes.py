"""Draws with the Press tool as a hand does: X events from outside Blender, in continuous motion."""

import subprocess
from pathlib import Path

import bpy
import numpy as np

#: Half the length of a stroke, mm.
HALF = 27.0
#: Duration of a stroke, s, and moves a second.
STROKES = ((0.3, 125), (3.0, 60))
#: Places of three taps within a second, mm.
TAPS = ((-24.0, 24.0), (0.0, 24.0), (24.0, 24.0))
DRAWN = Path(__file__).parents[2] / "benchmarks" / "strokes"
THINGS = ("letter_a", "r_lowered", "smiley", "spiral", "coin", "portrait")


def on_the_screen(blender, x, y):
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


def line(blender, start, end, duration=1.0, rate=60, key="", last="mouseup 1"):
    """Start a hand that draws a line over the bed, mm, with a key held down, and ends it by some words."""
    first, final = on_the_screen(blender, *start), on_the_screen(blender, *end)
    down, up = (f"keydown {key} sleep 0.2", f"keyup {key}") if key else ("", "")
    return hand(to(first), down, "mousedown 1", drag(first, final, duration, rate), last, up)


def done(blender, process):
    yield from blender.until(lambda: process.poll() is not None)
    yield from blender.rounds()


def finish(blender, process):
    """Wait until the hand is done, and then until the fingertip is, and the pins have come to rest."""
    yield from done(blender, process)
    yield from blender.until(lambda: not any(session.strokes for session in blender.sessions()))
    yield from rest(blender)


def rest(blender):
    """Let the pins come to rest: a tick simulates all the time since the one before, however long it was."""
    yield 2.0
    yield from blender.settle()


def act(blender, *words):
    yield from finish(blender, hand(*words))


def stroke(blender, name, start, end, *how, picture="", key=""):
    """Draw a line, finish it, and write it down; take a picture as soon as the hand is done."""
    process = line(blender, start, end, *how, key=key)
    if picture:
        yield from blender.until(lambda: process.poll() is not None)
        blender.shot(picture)
    yield from finish(blender, process)
    note(blender, name)


def note(blender, name):
    """Write down the heights, how many strokes the fingertip has finished, and how the view is turned."""
    blender.look(name)
    session, (area, _) = blender.session(), blender.view()
    blender.SEEN[name] |= {
        "bed": blender.heights().round(3).tolist(),
        "drawn": session.finished_strokes if session else 0,
        "view": list(area.spaces.active.region_3d.view_rotation),
        "distance": area.spaces.active.region_3d.view_distance,
    }


def ends(blender, y=0.0):
    return on_the_screen(blender, -HALF, y), on_the_screen(blender, HALF, y)


def reset(blender):
    if blender.call(bpy.ops.digiclay.session_reset.poll):
        blender.call(bpy.ops.digiclay.session_reset)
    yield from blender.settle()


def add_bed(blender, **chosen):
    blender.call(bpy.ops.object.select_all, action="SELECT")
    blender.call(bpy.ops.object.delete)
    blender.call(bpy.ops.mesh.digital_clay_add, **chosen)
    blender.call(bpy.ops.view3d.view_all)
    catch_up(blender)


def catch_up(blender):
    """Let the session catch up between two frames: one takes software GL half a second."""
    blender.preferences().most_periods = 1000


def take_tool(blender):
    blender.call(bpy.ops.wm.tool_set_by_id, name="digiclay.press_tool")
    blender.call(bpy.ops.object.select_all, action="DESELECT")


def focus_window():
    """Make Blender's window the active one: else a button is pressed where the pointer is by then."""
    # A slow server has the time it needs.
    hand("search --onlyvisible --class blender windowfocus --sync").wait(300)
    yield None


def prepare(blender, view="", **chosen):
    add_bed(blender, **chosen)
    if view:
        blender.call(bpy.ops.view3d.view_axis, type=view)
    take_tool(blender)
    yield from focus_window()


def brush(blender):
    return blender.part("press.brush").tool_settings(bpy.context)


def script(blender):
    yield from prepare(blender)
    for duration, rate in STROKES:
        how, picture = (duration, rate), f"hand_{duration:g}"
        yield from stroke(
            blender, f"stroke {duration:g}", (-HALF, 0.0), (HALF, 0.0), *how, picture=picture
        )
        yield from reset(blender)
    yield from message(blender)
    yield from taps(blender)
    yield from navigation(blender)
    yield from pie_menu(blender)
    yield from taken_back(blender)
    yield from act(blender, "key Escape")
    yield from things(blender)


def message(blender):
    """Draw a stroke after another one, with no key between them, while Blender shows a message."""
    tip = blender.fingertip()
    size = tip.scale.copy()
    for scale, waits in ((0.0 * size, True), (size, False)):
        tip.scale = scale
        yield from blender.until(
            lambda waits=waits: bool(blender.session().blocking_reason) == waits
        )
    blender.SEEN["message"] = blender.part("sessions.running").last_message()
    yield from stroke(blender, "stroke under a message", (-HALF, 0.0), (HALF, 0.0))
    yield from reset(blender)


def taps(blender):
    note(blender, "before the taps")
    yield from act(
        blender, *(to(on_the_screen(blender, *at), 0.08) + " click 1 sleep 0.15" for at in TAPS)
    )
    note(blender, "taps")
    yield from act(blender, to(on_the_screen(blender, 0.0, -30.0)), "key ctrl+z")
    note(blender, "one tap undone")
    yield from reset(blender)


def navigation(blender):
    start, end = ends(blender)
    middle = (start[0] + end[0]) // 2, (start[1] + end[1]) // 2
    note(blender, "before orbit")
    process = hand(
        to(start),
        "mousedown 1",
        drag(start, middle, 0.5, 60),
        "mousedown 2 sleep 0.05",
        drag(middle, (middle[0] + 60, middle[1]), 0.3, 60),
        "mouseup 2 sleep 0.1",
        "click 4 sleep 0.2",
    )
    yield from done(blender, process)
    note(blender, "in mid-stroke")
    yield from act(blender, drag(end, on_the_screen(blender, HALF, 0.0), 0.3, 60), "mouseup 1")
    note(blender, "after orbit")
    blender.shot("hand_orbit")
    yield from reset(blender)


def pie_menu(blender):
    """Pan in the middle of a stroke; then open the pie menu of the shading, and let go over Solid."""
    start, end = ends(blender)
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
    yield from finish(blender, process)
    note(blender, "pie menu")
    blender.SEEN["pie menu"]["panned"] = [b - a for a, b in zip(before, after, strict=True)]
    yield from reset(blender)


def taken_back(blender):
    for name, key in (("undone", "ctrl+z"), ("escaped", "Escape")):
        process = line(blender, (-HALF, 0.0), (HALF, 0.0), last="sleep 2")
        yield from blender.until(
            lambda: any(s.strokes and s.strokes[0].reached for s in blender.sessions())
        )
        yield from act(blender, f"key {key} sleep 0.2")
        hand("mouseup 1")
        yield from finish(blender, process)
        note(blender, name)


def follow(blender, recorded_stroke, *keys):
    start, *moves = recorded_stroke.moves
    words, before = [to(on_the_screen(blender, 1e3 * start[1], 1e3 * start[2]))], 0.0
    words += [*keys, "mousedown 1"]
    for time, x, y in moves:
        words.append(to(on_the_screen(blender, 1e3 * x, 1e3 * y), time - before))
        before = time
    return " ".join([*words, "mouseup 1"])


def things(blender):
    """Form some things of the gallery on an empty bed, stroke by stroke, with what each has in the header."""
    read = blender.part("recorded.pointer_strokes").read_strokes
    drawn = [(name, read(DRAWN / f"{name}.toml")) for name in THINGS]
    yield from prepare(blender, "TOP", bed=drawn[0][1].bed)
    usual = tuple(bpy.context.window_manager.digiclay_finger)
    for name, recorded in drawn:
        note(blender, f"before {name}")
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
            choose(blender, one)
            # Older ones were drawn on the surface as it was, when there was no base.
            keys = ["key y sleep 0.1"] if number and one.combine == "usual" else []
            yield from done(blender, hand(follow(blender, one, *keys)))
        yield from blender.until(lambda: not any(session.strokes for session in blender.sessions()))
        yield from blender.settle()
        blender.shot(f"thing_{name}")
        note(blender, name)
        yield from reset(blender)


def choose(blender, stroke):
    settings = brush(blender)
    settings.brush, settings.strength = stroke.kind.value, stroke.strength
    settings.path, settings.symmetry = stroke.path.upper(), stroke.symmetry.upper()
    settings.radial, settings.depth = stroke.radial, 1e3 * stroke.depth
    settings.height = 1e3 * stroke.height
