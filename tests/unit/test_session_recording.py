"""What is recorded of a session can be played again; undo shortens it."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.sessions import sculpting
from digiclay.sessions.running import Running

from tests.hand import Hand, started

pytestmark = pytest.mark.usefixtures("quick_machine")


def plays(session: Running) -> bool:
    """Return whether the recording of a session gives its state again bit for bit."""
    keep = session.recording
    assert keep is not None
    *_, again = simulate_path(session.system, snapshot.load(session.system, keep.start), keep.path)
    return snapshot.dump(session.system, again) == session.snapshot


def test_a_recording_gives_the_session_again_bit_for_bit_and_undo_shortens_it() -> None:
    hand = Hand()
    session = sculpting.set_recording(hand.press(started(), -6.0), True)
    session = hand.press(session)
    kept, moment, at = session.snapshot, session.tick, session.pose
    session = hand.press(session, 6.0)
    assert plays(session)
    session = hand.press(sculpting.restore(session, kept, at, moment), 3.0)
    assert plays(session)
    session = hand.press(
        sculpting.rewind(hand.press(session)), 6.0
    )  # a gesture taken back is gone from it too
    assert plays(session)


def test_redo_to_what_a_recording_did_not_lead_to_ends_it() -> None:
    hand = Hand()
    session = sculpting.set_recording(started(), True)
    early = hand.press(session)
    here = early.snapshot, early.pose, early.tick
    late = hand.press(early, 6.0)
    there = late.snapshot, late.pose, late.tick
    session = hand.press(sculpting.restore(late, *here), -6.0)
    assert sculpting.restore(session, *there).path is None


def test_a_long_recording_copies_itself_seldom() -> None:
    session = sculpting.set_recording(started(), True)
    keep, arrays = session.recording, set()
    assert keep is not None
    for moment in range(5000):
        keep = keep.extend(np.zeros((7, 7)), moment)
        arrays.add(id(keep.rows))
    assert len(keep.path) == 35001
    assert len(arrays) < 12


def test_a_recording_ends_with_a_gesture_that_began_before_it() -> None:
    hand = Hand()
    session = hand.press(started())
    (gesture,) = session.gestures
    session = hand.press(sculpting.set_recording(session, True), 6.0)
    assert sculpting.restore_gesture(session, gesture).recording is None


def test_a_recording_ends_with_a_reset_that_is_rewound() -> None:
    # Periods are counted anew from a reset on: those before it are not the recording's.
    hand = Hand()
    session = sculpting.set_recording(sculpting.reset(hand.press(started())), True)
    session = hand.press(hand.press(session), 6.0)
    for _ in range(3):
        session = sculpting.rewind(session)
    assert session.state.period > 0
    assert session.recording is None
