"""Draws R, X, logo, face and map with the Press tool: X events from outside, 100 moves per second."""

import bpy
import numpy as np

from tests.drawings import AS_DRAWN, RATE, TURNED, draw_by_hand, put, read_drawings
from tests.window import driver as blender
from tests.window.hand_strokes import (
    brush,
    done,
    hand,
    on_the_screen,
    prepare,
    reset,
    to,
)

#: Brush, height above the base, mm, and pose of each drawing.
DRAWN = {
    "R": ("RAISE", 8.0, AS_DRAWN),
    "X": ("LOWER", -4.0, TURNED),
    "logo": ("RAISE", 8.0, TURNED),
    "face": ("RAISE", 8.0, AS_DRAWN),
    "map": ("RAISE", 8.0, AS_DRAWN),
}


def script():
    yield from prepare("TOP", bed="design")
    settings, rng = brush(), np.random.default_rng(41)
    settings.depth, settings.height, settings.strength = 4.0, 8.0, 1.0
    drawings = read_drawings()
    for name, (kind, _, pose) in DRAWN.items():
        settings.brush = kind
        for path in put(drawings[name], *pose):
            yield from done(draw(draw_by_hand(path, rng)))
        yield from formed()
        blender.SEEN[name] = {"bed": blender.heights().round(3).tolist()}
        yield from look(name)
        yield from reset()


def draw(places):
    """Start a hand that goes through places (k, 2), mm, with the button down."""
    pixels = [on_the_screen(x, y) for x, y in places.tolist()]
    moves = [to(pixel, 1.0 / RATE) for pixel in pixels[1:]]
    return hand(to(pixels[0]), "mousedown 1", *moves, "mouseup 1")


def formed():
    """Wait until all strokes of the queue are formed."""
    yield from blender.until(lambda: not any(session.strokes for session in blender.sessions()))
    yield from blender.settle()


def look(name):
    """Take a picture from above the front edge, and look down again."""
    blender.call(bpy.ops.view3d.view_orbit, angle=0.7, type="ORBITUP")
    blender.shot(f"drawing_{name}")
    blender.call(bpy.ops.view3d.view_axis, type="TOP")
    yield from blender.rounds()
