"""A shape in, clay, the finger, a shape kept, in a real Blender window."""

import pytest

from tests.window.blender_window import Seen

PLAYED = {"script": "shape_round_trip.py", "size": (1000, 640)}


def test_the_shape_comes_up_and_a_session_goes_on_from_it_with_the_fingertip_above(seen: Seen) -> None:
    assert seen["added"]["heights"] == pytest.approx([0.04, 0.04], abs=1e-7)
    # The dead band of the height control, 10 µm.
    assert seen["displayed"]["heights"] == pytest.approx([0.04, 0.052], abs=1.1e-5)
    assert seen["displayed"]["pose"][2] > 0.052
    assert seen["started"]["sessions"] == 1
    assert seen["started"]["heights"] == pytest.approx(seen["displayed"]["heights"], abs=1e-7)


def test_the_fingertip_forms_the_shape_which_is_made_a_mesh(seen: Seen) -> None:
    assert max(seen[name]["force"] for name in seen if name.startswith("pressing")) > 0.1
    assert seen["formed"]["sessions"] == 0
    assert seen["formed"]["heights"] != pytest.approx(seen["displayed"]["heights"], abs=1e-4)
    assert seen["mesh"] == pytest.approx(seen["formed"]["heights"][1], abs=1e-7)


def test_keeping_what_was_formed_and_adding_a_sample_are_one_undo_step_each(seen: Seen) -> None:
    assert (seen["kept"] > 100, seen["keeping undone"]) == (True, "ripple")
    assert (seen["beds"], seen["beds after undo"]) == (2, 1)
