"""Press strokes of every brush in sessions without Blender, and the shape that they leave."""

from dataclasses import replace

import numpy as np
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.sessions import sculpting
from digiclay.sessions.running import find_device
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes.queue_ghosts import find_ghosts
from digiclay.strokes.stroke import lay_path, start

from tests import hand
from tests.hand import heights

#: Control periods that are simulated at a time: a stroke leaves the same bits in any number of
#: them, and each time its state is packed.
CHUNK = 64


def begin(scene):
    """Return a session of a scene, the fingertip above the middle of the bed."""
    above = np.array([0.0, 0.0, 46e-3, *LEVEL])
    return sculpting.begin_session(7, "Bed", scene, above)[0]


def begin_bed(name, rows, columns, method="virtual_master", arrangement="aligned", preset="paper"):
    """Return a session on a part of a bed that Add offers."""
    layout = Layout(rows, columns, BEDS[name].pitch, arrangement)
    return begin(make_scene(preset, layout, method, BEDS[name].share))


def lay(path, brush, amount=4.0, **more):
    """Return a stroke along a path, mm, that the hand has let go; `amount`: depth or height, mm."""
    places = 1e-3 * np.asarray(path, float)
    return lay_path(start(1, *places[0], 1e-3 * amount, brush=brush, **more), places)


def queue(session, *strokes):
    """Queue strokes."""
    for stroke in strokes:
        session, _ = sculpting.queue_stroke(session, stroke)
    return session


def find_ghost(session):
    """Return the nominal surface that is shown of a session's queue."""
    return find_ghosts(session.strokes, find_device(session), heights(session))[-1].nominal


def copy(session):
    """Return a session to go on with, while the first one stays."""
    return replace(session, state=session.state.copy())


def form(session, *strokes, periods=CHUNK):
    """Form strokes on a copy of a session, so many control periods at a time."""
    session = queue(copy(session), *strokes)
    while session.strokes:
        session = sculpting.follow_finger(session, session.pose, periods)
    return session


def settle(session):
    """Let the pins come to rest."""
    return hand.go_on(session, 15)


def relief(session):
    """Return the heights above rest, (rows, columns), mm; rows along y."""
    layout = session.scene.layout
    risen = 1e3 * (heights(session) - session.system.cell.actuator.rest_height)
    return risen.reshape(layout.rows, layout.columns)


def measure_spikes(formed):
    """Return how far the worst pin is above or below all 8 pins about it, or the 16 about those, mm."""
    worst = 0.0
    for reach in (1, 2):
        padded = np.pad(formed, reach, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1,) * 2)
        ring = np.pad(np.zeros((2 * reach - 1,) * 2, bool), 1, constant_values=True)
        around = windows[..., ring]
        over, under = formed - around.max(axis=-1), around.min(axis=-1) - formed
        worst = max(worst, float(over.max()), float(under.max()))
    return worst
