"""Hands for longer than in tests/scenes: tracked from beside the bed, without a part, and a bowl of two."""

from dataclasses import replace

from tests.scenes.test_hand_scenes import assert_sample
from tests.scenes.test_tracked_hands import HANDS, WORSE, Stream, assert_soft, shaped


def test_hands_at_30_hz_from_beside_the_bed_with_places_that_are_none_shape_softly():
    assert_soft(Stream(30.0, beside=True, astray=True))


def test_without_a_part_tracked_hands_are_no_fingers():
    # With all parts it shapes from 1.3 s on, as deep as it then is.
    times = {"clutch": 1.9, "cutoff": 1.3}
    found = {
        part: shaped(WORSE, replace(HANDS, **{part: 0.0}), lasts) for part, lasts in times.items()
    }
    found["coupling"] = shaped(WORSE, lasts=1.0, coupling=0.0)
    # Off by 7 mm, a hand touches nothing, or presses as much deeper.
    assert not found["clutch"].shaping[:, 0].any()
    # The spring makes 50 mN of a tremor of 1 mm.
    assert found["cutoff"].force.max() > shaped(WORSE, lasts=times["cutoff"]).force.max() + 0.05
    assert found["coupling"].force.max() > 2.0


def test_a_bowl_of_two_hands_loses_no_finger_and_is_formed_where_they_meet_too():
    assert_sample("two_hands_bowl", 4)
