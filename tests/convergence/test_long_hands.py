"""Hands for longer than in tests/scenes: tracked, lost, from beside the bed; samples of many fingers."""

from dataclasses import replace

import pytest

from tests.scenes.test_hand_scenes import assert_sample
from tests.scenes.test_tracked_hands import HANDS, WORSE, Stream, assert_soft, shaped


def test_hands_with_dropouts_other_identities_and_hostile_fingers_shape_softly():
    assert_soft(WORSE)


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


# The bowl where the hands meet, too.
@pytest.mark.parametrize("name, fingers", [("five_fingers_mound", 5), ("two_hands_bowl", 4)])
def test_a_sample_of_hands_loses_no_finger_and_forms_what_it_is_called(name, fingers):
    assert_sample(name, fingers)
