"""A finger moved by hand, tick by tick, over a running session."""

from dataclasses import replace

import numpy as np
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.toml_table import resolve
from digiclay.sessions import sculpting
from digiclay.sessions.sculpting import change_stroke

SIZES = {"rows": 15, "columns": 15}
SCENE = resolve({"layout": SIZES})
TICK = 1 / 30
PERIOD = SCENE.simulation.control_period


def pose(x=0.0, z=46.0):
    """Return a level finger's pose, in mm."""
    return np.array([x * 1e-3, 0.0, z * 1e-3, *LEVEL])


def started():
    """Return a session at its beginning, its clock started."""
    session, said = sculpting.begin_session(7, "Bed", SCENE, pose())
    assert said == ""
    return sculpting.advance(session, pose(), 0.0, 100)


class Hand:
    """Moves the finger, in mm, while time goes by."""

    def __init__(self):
        self.now = 0.0

    def move(self, session, poses):
        """Advance tick by tick."""
        for x, z in poses:
            self.now += TICK
            session = sculpting.advance(session, pose(x, z), self.now, 100)
        return session

    def press(self, session, x=0.0):
        """Press at a place and lift off again."""
        down, up = np.linspace(46, 37, 10), np.linspace(37, 46, 10)
        return self.move(session, [(x, z) for z in (*down, *[37] * 10, *up, *[46] * 20)])


def go_on(session, ticks):
    """Let the session go on; the fingertip stays where it is, or follows strokes in the time of the ticks."""
    now = session.clock.seen or 0.0
    for count in range(ticks):
        time = now + (count + 1) * TICK
        if session.strokes and not session.paused:
            # Else the machine's speed would tell how far it comes.
            periods = round((time - now) / PERIOD) - round((time - TICK - now) / PERIOD)
            session = replace(
                session, clock=replace(session.clock, seen=time), tick=session.tick + 1
            )
            session = _follow_stroke(session, periods)
        else:
            session = sculpting.advance(session, session.pose, time, 100)
    return session


def _follow_stroke(session, periods):
    """Simulate so many control periods of the first stroke, or to its end, or to where it waits."""
    end, finished, before = session.state.period + periods, session.finished_strokes, -1
    while before < session.state.period < end and session.finished_strokes == finished:
        before = session.state.period
        session = sculpting.follow_finger(session, session.pose, end - before)
    return session


def finish(session, ticks=300):
    """Let the session go on until no stroke is left."""
    for _ in range(ticks):
        if not session.strokes:
            break
        session = go_on(session, 1)
    return session


def let_go(session, number):
    """End a stroke where the hand is."""
    return change_stroke(session, number, lambda stroke: replace(stroke, held=False))


def pin(session, x, y):
    """Return the pin at a place, mm."""
    return int(session.system.grid.at(np.array([1e-3 * x]), np.array([1e-3 * y]))[0])


def risen(session, x, y):
    """Return how far the pin at a place, mm, is above rest, m."""
    return float(heights(session)[pin(session, x, y)]) - 40e-3


def heights(session):
    """Return the pin tops."""
    return session.state.row(0)
