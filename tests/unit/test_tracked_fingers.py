"""From tracked fingers to fingertips: whose is which, clutch, filter."""

import math
from dataclasses import replace

import numpy as np
import pytest

from digiclay_serve.tracked_fingers import (
    CLEAR,
    PARKED,
    Felt,
    Tracking,
    advance,
    begin_tracks,
    name_fingers,
)
from tests.assemble import table

LEVEL = (1.0, 0.0, 0.0, 0.0)
PLACE = (0.01, -0.02, 0.05)


def felt(poses, top=0.04):
    """Return what fingertips are near to."""
    return Felt(np.array(poses, float), top, lambda: np.full(len(poses), top))


def at(*places):
    """Return fingers 1, 2, ... at places."""
    return [(1 + row, (*place, *LEVEL)) for row, place in enumerate(places)]


def test_a_finger_that_is_not_named_lifts_after_100_ms_and_its_fingertip_is_free():
    simulated, tracks = np.tile([0.0, 0.0, 0.05, *LEVEL], (2, 1)), begin_tracks(np.zeros((2, 7)))
    tracks = name_fingers(tracks, at((0.0, 0.0, 0.05), (0.02, 0.0, 0.05)))
    lifted = []
    for step in range(40):
        if step in (5, 19):  # 70 ms without are a dropout that nobody feels
            tracks = name_fingers(tracks, at((0.0, 0.0, 0.05))[:1])
        tracks, targets = advance(tracks, Tracking(), felt(simulated), 5e-3)
        lifted.append([bool(z == PARKED) for z in targets[:, 2]])
    # At first it is not there either.
    assert [both.index(True, 1) for both in zip(*lifted, strict=True)] == [38, 19]
    tracks = name_fingers(tracks, [(9, (*PLACE, *LEVEL))])
    assert tracks.identities.tolist() == [9, -1]


@pytest.mark.parametrize(
    "above, there", [(-1e-3, False), (0.9 * CLEAR, False), (1.1 * CLEAR, True)]
)
def test_a_fingertip_comes_to_its_finger_from_above_all_pins_alone(above, there):
    simulated = np.array([[0.0, 0.0, 0.04 + above, *LEVEL]])
    tracks = name_fingers(begin_tracks(simulated), at((0.0, 0.0, 0.038)))
    tracks, _ = advance(tracks, Tracking(), felt(simulated), 5e-3)
    assert tracks.there.tolist() == [there]
    _, targets = advance(tracks, Tracking(), felt(simulated), 5e-3)
    assert (targets[0, 2] < PARKED) == there


EXCHANGED = {
    "two change places": ((0.0, 0.04), (0.04, 0.0), (2, 1)),
    "neighbors change places": ((0.0, 0.018), (0.017, 0.001), (2, 1)),
    "all go on as they were": ((0.0, 0.018), (0.004, 0.022), (1, 2)),
    "they meet and part": ((0.0, 0.018), (0.008, 0.010), (1, 2)),
    "they pass each other quickly": ((0.0, 0.020), (0.0105, 0.0095), (1, 2)),
    "three go around": ((0.0, 0.018, 0.036), (0.018, 0.036, 0.0), (3, 1, 2)),
    "two hands change places": ((0.0, 0.018, 0.1, 0.118), (0.1, 0.118, 0.0, 0.018), (3, 4, 1, 2)),
}


@table("before, after, held", EXCHANGED)
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_exchanged_identities_do_not_move_a_fingertip_through_the_clay(before, after, held, turn):
    way = np.array([math.cos(turn), math.sin(turn), 0.0])
    start, now = ([tuple(np.array([0, 0, 0.04]) + x * way) for x in xs] for xs in (before, after))
    poses = np.array([[*place, *LEVEL] for place in start])
    tracks = name_fingers(begin_tracks(poses), at(*start))
    tracks = replace(tracks, there=np.ones(len(start), bool))
    tracks, targets = advance(name_fingers(tracks, at(*now)), Tracking(), felt(poses), 5e-3)
    assert tuple(tracks.identities.tolist()) == held
    # Of what each has moved.
    assert np.linalg.norm(targets[:, :3] - poses[:, :3], axis=1).max() < 0.011


#: Fingers before and after a time, s, by identity: x and, where it is not that of all, z, mm; who
#: is held.
RENAMED = {
    "one has another identity": ({1: (0,), 2: (40,)}, 0.016, {1: (0,), 7: (42,)}, (1, 7, -1)),
    "both": ({1: (0,), 2: (18,)}, 0.016, {8: (19,), 7: (1,)}, (7, 8, -1)),
    "after 80 ms farther off": ({1: (0,)}, 0.08, {7: (14,)}, (7, -1, -1)),
    "a new one beside one that is lifted": (
        {1: (0,), 2: (18,)},
        0.016,
        {2: (18,), 7: (-14,)},
        (1, 2, 7),
    ),
    "at another time": ({1: (0,)}, 0.08, {7: (16,)}, (1, 7, -1)),
    "a new one below one that was raised": ({1: (0, 60)}, 0.016, {7: (3, 40)}, (1, 7, -1)),
    "nearer to one that stays": ({1: (0,), 2: (15,)}, 0.03, {1: (0,), 7: (7,)}, (1, 2, 7)),
    "two new ones near one that is gone": ({1: (0,)}, 0.03, {7: (6,), 8: (-3,)}, (8, 7, -1)),
}


@table("before, time, after, held", RENAMED)
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_a_finger_that_goes_on_under_another_identity_keeps_its_fingertip(
    before, time, after, held, turn
):
    def tell(fingers):
        way = 1e-3 * np.array([math.cos(turn), math.sin(turn)])
        place = (
            (one, x * way, 1e-3 * z)
            for one, (x, z) in ((one, (*at, 40)[:2]) for one, at in fingers)
        )
        return [(one, (*xy.tolist(), z, *LEVEL)) for one, xy, z in place]

    tracks = name_fingers(begin_tracks(np.zeros((3, 7))), tell(before.items()))
    tracks = replace(tracks, there=tracks.identities >= 0, unnamed=np.full(3, time))
    tracks = name_fingers(tracks, tell(after.items()))
    assert tuple(tracks.identities.tolist()) == held
    # Another one has to land.
    assert tracks.there.tolist() == [row < len(before) for row in range(3)]


@pytest.mark.parametrize("far", [0.02, 1e300])
def test_a_finger_that_is_elsewhere_all_at_once_is_not_believed_and_rises_if_it_stays(far):
    here, there, found = np.array([[0.0, 0.0, 0.038, *LEVEL]]), (far, 0.0, 0.038), []
    tracks = replace(
        name_fingers(begin_tracks(here), at((0.0, 0.0, 0.038))), there=np.ones(1, bool)
    )
    for _ in range(20):
        tracks, targets = advance(name_fingers(tracks, at(there)), Tracking(), felt(here), 5e-3)
        found.append(targets[0, :3].tolist())
    assert found == [[0.0, 0.0, 0.038]] * 19 + [[0.0, 0.0, PARKED]]
    for _ in range(2):
        tracks, targets = advance(
            name_fingers(tracks, at(there)), Tracking(), felt(here + 0.01), 5e-3
        )
    assert targets[0, :3].tolist() == [min(far, 1e3), 0.0, 0.038]


@pytest.mark.parametrize("bias", [-0.011, 0.0, 0.011, 1.06])
def test_a_clutch_takes_away_any_bias_of_height_and_slips_where_the_hand_is_raised(bias):
    tracks, heights = begin_tracks(np.array([[0.0, 0.0, PARKED, *LEVEL]])), []
    for height in (0.060, 0.055, 0.045, 0.070, 0.060):
        for step in range(2):  # at first it goes over its place, whose pins it feels then
            tracks = name_fingers(tracks, at((0.0, 0.0, height + bias)))
            pins = felt([[0, 0, 1.0, *LEVEL]], top=0.02 if step == 0 and not heights else 0.04)
            tracks, targets = advance(tracks, Tracking(clutch=0.01), pins, 5e-3)
        heights.append(float(targets[0, 2]))
    assert heights == pytest.approx([0.05, 0.045, 0.035, 0.05, 0.04], abs=1e-12)


def filtered(signal, cutoff, seconds, step):
    """Return what the 1-euro filter makes of a height over time."""
    tracks, found = begin_tracks(np.zeros((1, 7))), []
    for time in np.arange(0.0, seconds, step):
        tracks = name_fingers(tracks, at((0.0, 0.0, signal(time))))
        tracks, targets = advance(
            tracks, Tracking(cutoff=cutoff), felt([[0, 0, 1.0, *LEVEL]]), step
        )
        found.append(targets[0, 2])
    return np.array(found[1:])


@pytest.mark.parametrize("step", [1e-3, 5e-3])
def test_the_filter_calms_a_trembling_hand_and_follows_a_quick_one(step):
    still = filtered(lambda _: 0.05, 1.0, 0.5, step)
    assert np.ptp(still) == 0.0
    # A tremor of 0.1 mm at 10 Hz, of 4 mm/s, raises the cutoff of 1 Hz by 0.1 Hz at most: a tenth
    # passes.
    tremor = filtered(lambda time: 0.05 + 1e-4 * math.sin(20.0 * math.pi * time), 1.0, 4.0, step)[
        -int(1.0 / step) :
    ]
    assert 0.08 < np.ptp(tremor) / 2e-4 < 0.13
    # A hand at 0.1 m/s has a cutoff of 3 Hz: it is followed by 1 / (2 pi 3 Hz), 53 ms.
    ramp = filtered(lambda time: 0.1 * time, 1.0, 4.0, step)
    assert 0.1 * (4.0 - step) - ramp[-1] == pytest.approx(0.1 / (2.0 * math.pi * 3.0), rel=0.02)


def test_a_turn_and_its_negative_are_one_to_the_filter():
    turn = np.array([0.8, 0.0, 0.0, 0.6])
    tracks = name_fingers(begin_tracks(np.zeros((1, 7))), [(1, (*PLACE, *turn))])
    tracks = name_fingers(tracks, [(1, (*PLACE, *-np.array([0.6, 0.0, 0.0, 0.8])))])
    _, targets = advance(tracks, Tracking(cutoff=1.0), felt([[0, 0, 1.0, *LEVEL]]), 5e-3)
    assert 0.6 < targets[0, 3] < 0.8
    assert 0.6 < targets[0, 6] < 0.8
