"""Several fingertips in a real Blender window: two, and a hand that is pressed, deleted and had back."""

import numpy as np

from tests.window.blender_window import Seen

PLAYED = {"script": "several_fingers.py"}
HAND = list(range(1, 8))


def test_fingertips_come_and_go_while_the_session_goes_on(seen: Seen) -> None:
    found = {name: seen[name]["numbers"] for name in ("two", "hand", "deleted", "hand again", "copied")}
    assert found == {
        "two": [1, 2], "hand": HAND, "deleted": [1, 2], "hand again": HAND, "copied": [*HAND, 8],
    }  # fmt: skip
    assert [seen[name]["tips"] == seen[name]["numbers"] for name in found] == [True] * 5
    assert [seen[name]["waits"] for name in found] == [""] * 5


def test_two_fingertips_press_each_with_its_force_and_a_hand_as_one(seen: Seen) -> None:
    assert min(seen["two pressed"]["forces"]) > 0.01
    moved = np.array(seen["hand pressed"]["poses"]) - seen["hand"]["poses"]
    # The mouse moves by pixels.
    np.testing.assert_allclose(moved[2:], [[0.0, 0.0, -9.0]] * 5, rtol=0, atol=0.3)
    np.testing.assert_allclose(moved[:2], 0.0, rtol=0, atol=1e-3)
    assert min(seen["hand pressed"]["forces"]) > 0.01
