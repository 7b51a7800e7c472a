"""A running session follows the finger, goes back, and is recorded; undo shortens the recording."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.sessions.running import match_poses
from digiclay.sessions.sculpting import (
    GESTURES,
    advance,
    begin_session,
    change_scene,
    reset,
    restore,
    restore_gesture,
    rewind,
    set_recording,
)

from tests.assemble import assert_near
from tests.hand import SCENE, SIZES, Hand, heights, pose, started

pytestmark = pytest.mark.usefixtures("quick_machine")


def test_a_paused_session_goes_on_without_catching_up_and_gestures_kept_do_not_grow():
    hand = Hand()
    session = replace(hand.move(started(), [(0.0, 39.0)] * 5), paused=True)
    before = session.state.period
    session = hand.move(session, [(0.0, 39.0)] * 100)
    assert (session.state.period, session.clock.factor) == (before, 0.0)
    session = hand.move(replace(session, paused=False), [(0.0, 39.0)] * 2)
    assert session.state.period <= before + 7
    hand, session = Hand(), started()
    assert rewind(session) is session  # there is none yet
    for _ in range(GESTURES + 3):
        session = hand.move(session, [(0.0, 46.0)] * 2 + [(0.0, 39.5)] * 4)
    assert len(session.gestures) == GESTURES


@pytest.mark.parametrize("off", [0.0, 1e-6])
def test_what_was_taken_back_within_a_press_counts_again_when_the_finger_moves(off):
    hand = Hand()
    session = hand.move(started(), [(0.0, z) for z in np.linspace(46, 38, 20)] + [(0.0, 38.0)] * 30)
    first = heights(session)
    session = hand.move(session, [(x, 38.0) for x in np.linspace(0, 5, 10)])
    assert len(session.gestures) == 2
    back = rewind(session)
    # Put there by 32 bits, the finger is read a little beside; and stands on the pins as it stood.
    back = hand.move(back, [(1e3 * off, 38.0)] * 3)
    assert len(back.gestures) == 1
    # Under a finger at rest pins still settle by hundredths of a millimeter, of 2 mm pressed.
    assert_near(heights(back), first, 5e-5)
    again = hand.move(back, [(x, 38.0) for x in np.linspace(1, 5, 10)])
    assert len(again.gestures) == 2
    back = rewind(rewind(again))
    assert (heights(back) == 40e-3).all()


def test_undo_brings_back_the_state_it_finds_bit_for_bit():
    hand = Hand()
    session = hand.press(started())
    kept = session.snapshot
    back = restore(hand.press(session, 6.0), kept, pose())
    assert snapshot.dump(back.system, back.state) == kept
    assert len(back.gestures) == 1
    other, said = begin_session(8, "Copy", SCENE, pose(), kept)
    assert (said, snapshot.dump(other.system, other.state)) == ("", kept)
    # Before the first start it finds a bed at rest.
    assert (heights(restore(session, None, pose())) == 40e-3).all()


def test_changed_parts_keep_the_heights_and_say_so_and_a_changed_gain_takes_effect():
    session = Hand().press(started())
    other = resolve({"layout": SIZES, "control": {"method": "plastic"}})
    later, said = begin_session(8, "Copy", other, pose(), session.snapshot)
    assert np.array_equal(heights(later), heights(session))
    assert "heights and locks were kept" in said
    hand = Hand()
    session = hand.move(started(), [(0.0, 38.0)] * 10)
    assert change_scene(session, resolve({"layout": SIZES}))[0] is session
    other = resolve({"layout": SIZES, "control": {"force_setpoint": 0.8}})
    later, said = change_scene(session, other)
    assert (said, later.snapshot) == ("", session.snapshot)
    assert hand.move(later, [(0.0, 38.0)] * 30).trace.set_point[-1] == 0.8


def test_a_fingertip_that_is_left_out_while_it_presses_leaves_heights():
    plain = {"layout": SIZES, "control": {"method": "plastic"}, "relaxation": "absent"}
    poses = np.array([pose(-6.0, z=38.0), pose(6.0, z=38.0)])
    session, _ = begin_session(7, "Bed", resolve(plain).with_fingers(2), poses)
    for now in (0.0, 0.1, 0.2):
        session = advance(session, poses, now, 100)
    before = heights(session)
    without = resolve(plain | {"fingertip": "absent"}).with_fingers(2)
    later, said = change_scene(session, without)
    assert "heights and locks were kept" in said
    later = advance(later, poses, 0.3, 100)
    assert_near(heights(advance(later, poses, 0.4, 100)), before, 1e-12)


def test_a_session_takes_no_more_memory_the_longer_it_lasts():
    hand, session = Hand(), started()
    circle = [(5.0 * np.cos(turn), 38.0) for turn in np.linspace(0.0, 6.0, 30)]
    # Longer than the trace's ten seconds, so that it is full.
    session = hand.move(session, [*circle * 11])
    assert 0.0 < session.errors.height < 1e-4
    tracemalloc.start()
    try:
        floors = []
        for _ in range(2):
            held = []
            for place in circle:
                session = hand.move(session, [place])
                held.append(tracemalloc.get_traced_memory()[0])
            # What a tick works with comes and goes; what a leak holds never goes.
            floors.append(min(held))
    finally:
        tracemalloc.stop()
    # A state kept for a gesture more or less, of at most 20: 25 kB each.
    assert floors[-1] - floors[0] < 100_000


def test_a_step_too_long_to_halve_has_no_estimate_and_parts_that_do_not_go_together_are_refused():
    steps = {"control_period": "1 s", "physics_step": "1 ms", "stepper": "euler"}
    table = {"simulation": steps, "layout": SIZES, "control": "absent"}
    session, _ = begin_session(7, "Bed", resolve(table), pose())
    assert session.monitor is None
    session = advance(session, pose(), 0.0, 9)
    assert advance(session, pose(z=39.0), 2.0, 9).errors is None
    table = {"layout": SIZES, "control": {"method": "shape_display", "amplitude": "1 m"}}
    with pytest.raises(DigiclayError, match="amplitude"):
        change_scene(started(), resolve(table))


def plays(session):
    """Return whether the recording of a session gives its state again bit for bit."""
    keep = session.recording
    *_, again = simulate_path(session.system, snapshot.load(session.system, keep.start), keep.path)
    return snapshot.dump(session.system, again) == session.snapshot


def test_a_recording_gives_the_session_again_bit_for_bit_and_undo_shortens_it():
    hand = Hand()
    session = set_recording(hand.press(started(), -6.0), True)
    session = hand.press(session)
    kept, moment, at = session.snapshot, session.tick, session.pose
    session = hand.press(session, 6.0)
    assert plays(session)
    session = hand.press(restore(session, kept, at, moment), 3.0)
    assert plays(session)
    # A gesture taken back is gone from it too.
    session = hand.press(rewind(hand.press(session)), 6.0)
    assert plays(session)


def test_redo_to_what_a_recording_did_not_lead_to_ends_it():
    hand = Hand()
    session = set_recording(started(), True)
    early = hand.press(session)
    here = early.snapshot, early.pose, early.tick
    late = hand.press(early, 6.0)
    there = late.snapshot, late.pose, late.tick
    session = hand.press(restore(late, *here), -6.0)
    assert restore(session, *there).recording is None


def test_a_long_recording_copies_itself_seldom():
    session = set_recording(started(), True)
    keep, arrays = session.recording, set()
    for moment in range(5000):
        keep = keep.extend(np.zeros((7, 7)), moment)
        arrays.add(id(keep.rows))
    assert len(keep.path) == 35001
    assert len(arrays) < 12


def test_a_recording_ends_with_what_began_before_it_a_gesture_or_a_reset_that_is_rewound():
    hand = Hand()
    begun = hand.press(started())
    session = hand.press(set_recording(begun, True), 6.0)
    assert restore_gesture(session, *begun.gestures).recording is None
    # Periods are counted anew from a reset on: those before it are not the recording's.
    session = set_recording(reset(begun), True)
    session = hand.press(hand.press(session), 6.0)
    for _ in range(3):
        session = rewind(session)
    assert session.state.period > 0
    assert session.recording is None


def test_fingertips_keep_their_poses_by_number_and_far_below_the_floor_do_no_harm():
    had, others = np.arange(14.0).reshape(2, 7), -np.ones((3, 7))
    matched = match_poses(had, (2, 5), others, (1, 5, 2))
    np.testing.assert_array_equal(matched, [others[0], had[1], had[0]])
    hand, session = Hand(), started()
    session = hand.move(session, [(0.0, -1e9), (1e12, -1e9), (0.0, 1e9), (0.0, 46.0)])
    assert np.isfinite(heights(session)).all()
    assert heights(session).min() >= 0.0
