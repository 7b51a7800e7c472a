"""Draws with a pen that has pressure and tilt: upright, with half the pressure, and leaning to the right."""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

from tests.window import driver as blender
from tests.window.hand_strokes import finish, note, on_the_screen, prepare

HAND = Path(__file__).parent / "tablet" / "pen_hand.py"
#: Row, mm, pressure, and tilt to the right and to the user, of each stroke; half its length, mm.
STROKES = {
    "firm": (24.0, 1.0, 0.0, 0.0),
    "light": (0.0, 0.5, 0.0, 0.0),
    "leaning": (-24.0, 1.0, 0.8, 0.0),
}
HALF = 12.0


def draw(row, pressure, right, near):
    places = (on_the_screen(float(x), row) for x in np.linspace(-HALF, HALF, 31))
    (x, y), *later = places
    words = [
        f"to {x} {y} 0 {right} {near}",
        "sleep 0.1",
        f"to {x} {y} {pressure} {right} {near}",
        "down",
    ]
    for x, y in later:
        words += ["sleep 0.033", f"to {x} {y} {pressure} {right} {near}"]
    return subprocess.Popen([sys.executable, str(HAND), *words, "up"])


def pressed(since):
    """Return how high pins are where the finger was lowest since a period, mm, and its turns there."""
    (session,) = blender.sessions()
    poses = session.recording.path[since:, 0]
    lowest = poses[poses[:, 2] < poses[:, 2].min() + 1e-5]
    x, y = lowest[len(lowest) // 2, :2]
    cell = session.system.grid.at(np.array([x]), np.array([y]))
    return {"formed": 1e3 * float(session.state.row(0)[cell][0]), "inside": lowest[:, 3:].tolist()}


def script():
    yield from prepare("TOP")
    yield from blender.start()
    blender.call(bpy.ops.digiclay.take_record)
    for name, stroke in STROKES.items():
        (session,) = blender.sessions()
        since = len(session.recording.path)
        yield from finish(draw(*stroke))
        note(name)
        (session,) = blender.sessions()
        blender.SEEN[name] |= {"outside": session.pose[3:].tolist(), **pressed(since)}
    blender.shot("pen")
