"""Two fingertips near each other, beside each of them alone."""

from __future__ import annotations

import pytest

from benchmarks.several_fingers import TURN, measure_near


@pytest.mark.parametrize(
    ("method", "case", "turn", "most"),
    [
        # From 15 mm on at most 1.1 of alone; nearer 1.5: both press a pin, or only one can have it.
        ("virtual_master", "crossing, 11", TURN, 1.1),
        ("virtual_master", "approach and part, 6", TURN, 1.1),
        ("virtual_master", "up beside down, 18", TURN, 1.1),
        ("hybrid", "parallel, 12", TURN, 1.1),
        ("hybrid", "crossing, 11", TURN, 1.1),
        ("hybrid", "up beside down, 18", TURN, 1.1),
        ("hybrid", "up beside down, 15", TURN, 1.1),
        # Both land in one period.
        ("hybrid", "up beside down, 15", 2.0, 1.1),
        # As alone in some turns, and not yet 1.5 in others: pins between them change hands.
        ("hybrid", "up beside down, 12", 2.0, 2.0),
        # Pins whose pulp one has pressed long carry nothing, until the other presses them.
        ("hybrid", "sinks beside a drag, 12", TURN, 1.5),
        ("hybrid", "approach and part, 6", TURN, 1.2),
        ("cell_states", "parallel, 18", TURN, 1.1),
        # Not yet as alone: the fingertip that sinks beside the hill is felt late.
        ("cell_states", "up beside down, 18", TURN, 1.2),
    ],
)
def test_no_finger_is_stolen_by_another_one_that_comes_near(
    method: str, case: str, turn: float, most: float
) -> None:
    together, alone = measure_near(method, case, turn)
    assert together.largest < 2.0  # N: what fingers were measured up to
    for own, single in zip(together.rfd, alone, strict=True):
        assert own <= most * single.rfd[0]
