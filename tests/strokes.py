"""Press strokes of every brush in sessions without Blender, and the shape that they leave."""

import numpy as np
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.sessions import sculpting
from digiclay.sessions.sculpting import change_stroke, queue_stroke
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes.stroke import draw, start

from tests import hand
from tests.hand import heights, let_go

#: Control periods that are simulated at a time: a stroke leaves the same bits in any number of
#: them, and each time its state is packed.
CHUNK = 64


def begin_bed(name, rows, columns):
    """Return a session on a part of a bed that Add offers."""
    scene = make_scene(
        "paper", Layout(rows, columns, BEDS[name].pitch), "virtual_master", BEDS[name].share
    )
    above = np.array([0.0, 0.0, 46e-3, *LEVEL])
    session, _ = sculpting.begin_session(7, "Bed", scene, above)
    return sculpting.advance(session, above, 0.0, 100)


def queue(session, ends, brush, depth=15.0, share=1.0):
    """Queue a quick stroke straight from place to place, mm."""
    places = np.array(ends) * 1e-3
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    session, number = queue_stroke(
        session, start(0, *places[0].tolist(), depth * 1e-3, brush=brush, share=share)
    )
    for part in np.arange(1, 31) / 30:
        at = tuple(np.interp(part * way[-1], way, places[:, axis]) for axis in (0, 1))
        session = change_stroke(
            session, number, lambda stroke, at=at: draw(stroke, *at, depth * 1e-3, share)
        )
    return let_go(session, number)


def finish(session, most=60.0):
    """Let the session go on until its strokes are finished and the pins at rest, at most so long, s."""
    last = session.state.period + round(most / hand.PERIOD)
    while session.strokes and session.state.period < last:
        session = sculpting.follow_finger(session, session.pose, CHUNK)
    assert not session.strokes
    return hand.go_on(session, 15)


def form(session, ends, brush, depth=15.0, share=1.0):
    """Queue a stroke and finish it."""
    return finish(queue(session, ends, brush, depth, share))


def relief(session):
    """Return the heights above rest, (rows, columns), mm; rows along y."""
    layout = session.scene.layout
    risen = 1e3 * (heights(session) - session.system.cell.actuator.rest_height)
    return risen.reshape(layout.rows, layout.columns)


def measure_spikes(formed):
    """Return how far the worst pin is above or below all 8 pins about it, or the 16 about those, mm."""
    worst = 0.0
    rows, columns = formed.shape
    for reach in (1, 2):
        padded = np.pad(formed, reach, mode="edge")
        steps = range(-reach, reach + 1)
        around = np.array(
            [
                padded[reach + i : reach + i + rows, reach + j : reach + j + columns]
                for i in steps
                for j in steps
                if max(abs(i), abs(j)) == reach
            ]
        )
        worst = max(
            worst, float((formed - around.max(0)).max()), float((around.min(0) - formed).max())
        )
    return worst
