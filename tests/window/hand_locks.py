"""Locks pins beside a ridge by a box, a lasso and the menu, and forms over them: X events from outside."""

from itertools import pairwise

import bpy
import numpy as np

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    brush,
    finish,
    hand,
    note,
    on_the_screen,
    prepare,
    stroke,
    to,
)
from tests.window.see_the_form import read_shot

HOW = (0.5, 60)
#: Corners of the box and of a lasso that crosses itself, an eight, mm.
BOX = ((4.0, -26.0), (26.0, -10.0))
EIGHT = ((-26.0, 8.0), (-2.0, 28.0), (-2.0, 8.0), (-26.0, 28.0), (-26.0, 8.0))


def keep(name):
    note(name)
    session = blender.session()
    shares = session.state.shares()
    grid, height = session.system.grid, session.state.row(0)
    places = np.column_stack([grid.positions, height])
    area, region = blender.view()
    with bpy.context.temp_override(window=blender.window(), area=area, region=region):
        seen = blender.part("bridge").project(bpy.context, blender.bed(), places)
    blender.SEEN[name] |= {
        "shares": shares.tolist(),
        "seen": np.add(seen, (region.x, region.y)).round(1).tolist(),
    }


def draw(*places, before="", after=""):
    """Return the hand that drags along places of the bed, mm, and their pixels in the window."""
    screen = [on_the_screen(*place) for place in places]
    first, words = screen[0], []
    for start, end in pairwise(screen):
        way = np.linspace(start, end, 12)[1:].round().astype(int)
        words += [to((int(x), int(y)), 0.03) for x, y in way]
    pixels = [(x, blender.window().height - 1 - y) for x, y in screen]
    return (to(first), before, "mousedown 1", *words, "mouseup 1", after), pixels


def change(name, operator, **given):
    blender.call(operator, **given)
    yield from finish(hand("sleep 0.1"))
    keep(name)


def script():
    yield from prepare()
    settings = brush()
    settings.brush, settings.height = "RAISE", 8.0
    yield from stroke("ridge", (-27.0, -6.0), (27.0, 12.0), *HOW)
    settings.brush = "LOCK"
    words, pixels = draw(*BOX, before="key b sleep 0.4")
    yield from act(*words)
    keep("box")
    blender.SEEN["box"]["path"] = pixels
    words, pixels = draw(
        *EIGHT,
        before="keydown ctrl keydown shift sleep 0.2",
        after="keyup shift keyup ctrl",
    )
    yield from act(*words)
    keep("lasso")
    blender.SEEN["lasso"]["path"] = pixels
    yield from act(to(on_the_screen(0.0, 33.0)), "key ctrl+z")
    keep("lasso undone")
    words, _ = draw(
        (10.0, -28.0),
        (28.0, -16.0),
        before="key b sleep 0.4 keydown ctrl sleep 0.2",
        after="keyup ctrl",
    )
    yield from act(*words)
    keep("box with ctrl")
    # Inside the view: a press beside that would drag a value of another editor.
    _, region = blender.view()
    x, y = region.x + 150, blender.window().height - region.y - 100
    box = ("mousedown 1", to((x + 20, y - 20)), "mouseup 1")
    yield from act(to((x, y)), "key b sleep 0.4", *box)
    keep("nothing inside")
    height = bpy.ops.digiclay.press_locks_height
    yield from change("by height", height, side="ABOVE", height=4.0)
    blender.shot("locks_skin")
    for what in ("BLUR", "BLUR"):
        yield from change("blurred", bpy.ops.digiclay.press_locks, change=what)
    blender.shot("locks_skin_blurred")
    blender.bed().digiclay_display.form = "pins"
    yield from blender.rounds(8)
    blender.shot("locks_pins_blurred")
    blender.bed().digiclay_display.form = "skin"
    yield from blender.rounds(8)
    settings.brush = "ERASE"
    yield from stroke("erased", (-27.0, -6.0), (27.0, 12.0), *HOW)
    keep("erased")
    blender.shot("locks_erased")
    yield from change("cleared", bpy.ops.digiclay.press_locks, change="CLEAR")
    blender.shot("locks_skin_cleared")
    blender.bed().digiclay_display.form = "pins"
    yield from blender.rounds(8)
    blender.shot("locks_pins_cleared")
    for name in ("skin", "pins_blurred", "skin_cleared", "pins_cleared"):
        blender.SEEN[f"white {name}"] = count_white(name).tolist()
    settings.symmetry = "X"
    words, _ = draw(*BOX, before="key b sleep 0.4")
    yield from act(*words)
    keep("mirrored box")
    settings.symmetry = "NONE"
    yield from change("left in part", bpy.ops.digiclay.press_locks, change="BLUR")
    yield from without_session()


def count_white(name):
    """Return how many pixels are white in the left and in the right half of the view in a picture."""
    white = (read_shot(f"locks_{name}") > 0.98).all(axis=-1).sum(axis=0)
    return np.array([half.sum() for half in np.array_split(white, 2)])


def without_session():
    """Look at two beds without a session, as skin and as pins, before and after the file is opened again."""
    yield from act("key Escape")
    yield from blender.stopped()
    bed = blender.bed()
    blender.select(bed)
    blender.call(bpy.ops.object.duplicate)
    other = bpy.context.object
    other.location.x += 1.1 * bed.dimensions.x
    bed.digiclay_display.form, other.digiclay_display.form = "skin", "pins"
    blender.call(bpy.ops.object.select_all, action="DESELECT")
    yield from blender.rounds(8)
    blender.call(bpy.ops.view3d.view_axis, type="TOP")
    blender.call(bpy.ops.view3d.view_orbit, angle=0.7, type="ORBITUP")
    blender.call(bpy.ops.view3d.view_all)
    yield from look_with_and_without("two")
    file = str(blender.OUT / "locked.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    yield from blender.rounds(8)
    yield from look_with_and_without("opened")


def look_with_and_without(name):
    """Write down how many white pixels the overlays have in both halves of a picture."""
    area, _ = blender.view()
    for shown in (True, False):
        area.spaces.active.overlay.show_overlays = shown
        yield from blender.rounds(8)
        blender.shot(f"locks_{name}_{shown}")
    area.spaces.active.overlay.show_overlays = True
    white = [count_white(f"{name}_{shown}") for shown in (True, False)]
    blender.SEEN[f"white {name}"] = (white[0] - white[1]).tolist()
