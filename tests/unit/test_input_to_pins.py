"""An input reaches the commanded pins in the next tick, and a tick packs the state once."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from digiclay.core.session import snapshot
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running
from digiclay.sessions.stroke_queue import change_stroke, queue_stroke
from digiclay.strokes.stroke import draw

from tests.hand import TICK, Hand, heights, pose, started

pytestmark = pytest.mark.usefixtures("quick_machine")

#: A finger in the pins, mm, and how long it has pressed, ticks.
PRESSED, TICKS = 37.0, 20


def pressed() -> tuple[Running, Hand]:
    """Return a session whose finger presses, and the hand that holds it."""
    hand = Hand()
    return hand.move(started(), [(0.0, z) for z in np.linspace(46.0, PRESSED, TICKS)]), hand


def commands(session: Running) -> np.ndarray:
    """Return the commanded heights."""
    return session.state.row(session.system.rows.target)


def forked(session: Running) -> Running:
    """Return the same session with a state of its own: a tick uses it up."""
    return replace(session, state=session.state.copy())


def test_a_move_between_two_ticks_changes_the_commands_of_the_next() -> None:
    session, hand = pressed()
    now = hand.now + TICK
    still = sculpting.advance(forked(session), pose(0.0, PRESSED), now, 100)
    moved = sculpting.advance(forked(session), pose(2.0, PRESSED), now, 100)
    assert still.state.period == moved.state.period > session.state.period
    assert not np.array_equal(commands(still), commands(moved))


def test_a_place_drawn_between_two_ticks_changes_the_commands_of_the_next() -> None:
    session, number = queue_stroke(started(), 0.0, 0.0, 4e-3)
    now = 0.0
    while session.strokes[0].reached == 0 and now < 3.0:
        now += TICK
        # The hand goes along x; Blender has told all of it by each tick.
        drawn = partial(draw, time=now, x=0.01 * now, y=0.0, depth=4e-3)
        session = change_stroke(session, number, drawn)
        session = change_stroke(session, number, partial(replace, known=now))
        session = sculpting.advance(session, pose(), now, 100)
    assert session.strokes[0].reached
    now += TICK
    ways = []
    for y in (0.0, 4e-3):
        drawn = partial(draw, time=now, x=0.01 * now, y=y, depth=4e-3)
        other = change_stroke(forked(session), number, drawn)
        other = change_stroke(other, number, partial(replace, known=now))
        ways.append(sculpting.advance(other, pose(), now, 100))
    straight, aside = ways
    assert aside.pose[1] > straight.pose[1] == 0.0
    assert not np.array_equal(commands(straight), commands(aside))


def test_a_tick_packs_the_state_once_however_many_periods_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    packed: list[int] = []
    dump = snapshot.dump

    def counted(*arguments: Any) -> bytes:
        packed.append(1)
        return dump(*arguments)

    session, hand = pressed()
    monkeypatch.setattr(snapshot, "dump", counted)
    later = sculpting.advance(session, pose(1.0, PRESSED), hand.now + 0.5, 100)
    assert later.state.period - session.state.period == 100
    assert len(packed) == 1
    paused = replace(later, paused=True)
    assert heights(sculpting.advance(paused, pose(2.0, PRESSED), hand.now + 1.0, 100)).size
    assert len(packed) == 1
