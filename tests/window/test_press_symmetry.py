"""Symmetric strokes form at the same time, drawn without a pause on a turned bed in a real window."""

import numpy as np
import pytest

from tests.assemble import assert_near
from tests.window.blender_window import FORMED, down

PLAYED = {"script": "press_symmetry.py", "size": (800, 560), "by_hand": True}


@pytest.mark.parametrize(
    "name, alone, fingers, longer",
    [
        pytest.param("radial", "one", 4, 1.05, id="four turned images"),
        pytest.param("mirrored", "one", 2, 1.05, id="two mirrored ones"),
        pytest.param("across", "across alone", 2, 1.2, id="across the axis both go on"),
        pytest.param("along", "along alone", 2, 1.05, id="on the axis one presses"),
    ],
)
def test_images_take_about_as_many_periods_as_one(seen, name, alone, fingers, longer):
    # The hand does not draw exactly as before: some periods more or less.
    assert seen[name]["periods"] <= longer * seen[alone]["periods"] + 8
    assert (seen[name]["fingers"], seen[name]["left"]) == (fingers, 1)


@pytest.mark.parametrize(
    "name, turns",
    [
        ("radial", [np.rot90]),
        ("mirrored", [np.fliplr]),
        ("across", [np.fliplr]),
        ("along", [np.fliplr]),
        ("two", []),
    ],
)
def test_images_are_alike_on_a_turned_bed(seen, name, turns):
    formed = down(seen, name)
    assert formed.max() > FORMED
    for turn in turns:  # the valves place pins to 1 µm; heights are noted to as much
        assert_near(formed, turn(formed), 3e-3)


def test_twelve_images_on_a_large_bed_take_the_periods_of_one(seen):
    print(
        {
            name: f"{periods} periods, {seconds:.2f} s"
            for name, (periods, seconds) in seen["timed"].items()
        }
    )
    # While the hand is slower than the fingertip, the session waits for it.
    for name, alone in (("2", "1"), ("6", "1"), ("12", "1"), ("2 beside", "1 beside")):
        assert seen["timed"][name][0] <= 1.15 * seen["timed"][alone][0] + 16
    # Those that begin at their ends do so when the hand lets go, at 1.6 times that of one if it is
    # slow.
    assert seen["timed"]["12 rays"][0] <= 1.6 * seen["timed"]["1 ray"][0]


def test_strokes_of_other_symmetries_wait_in_a_queue_and_are_taken_back_one_by_one(seen):
    three, two = down(seen, "three"), down(seen, "two")
    # The last one alone has pins in the middle of a row beside the bed's edge.
    assert (three[22, [14, 16, 10, 8]] > FORMED).all()
    assert (two[22, [14, 16, 10, 8]] < FORMED).any()
    for row, column in ((17, 5), (7, 5), (17, 21), (21, 7), (7, 3), (3, 17)):
        assert two[row, column] > FORMED, (row, column)
    assert_near(down(seen, "escaped"), two, 3e-3)


def test_what_is_recorded_is_replayed(seen):
    assert seen["at the end"] == [1, 7]
    assert seen["take"] == [4, 1]
    assert_near(down(seen, "replayed"), down(seen, "escaped"), 1e-3)
