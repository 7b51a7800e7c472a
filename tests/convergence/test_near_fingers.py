"""Two fingertips near each other, beside each of them alone."""

from __future__ import annotations

import pytest

from benchmarks.several_fingers import measure_near


@pytest.mark.parametrize(
    ("method", "case", "most"),
    [
        # From 15 mm on at most 1.1 of alone, but for a fingertip that sinks beside a hill: 2 mN more.
        ("virtual_master", "crossing, 11", 1.1),
        ("virtual_master", "approach and part, 6", 1.1),
        ("virtual_master", "up beside down, 18", 1.1),
        ("hybrid", "parallel, 12", 1.5),
        ("hybrid", "crossing, 11", 1.5),
        ("hybrid", "up beside down, 18", 1.5),
        ("cell_states", "parallel, 18", 1.1),
    ],
)
def test_no_finger_is_stolen_by_another_one_that_comes_near(method: str, case: str, most: float) -> None:
    together, alone = measure_near(method, case)
    assert together.largest < 2.0  # N: what fingers were measured up to
    for own, single in zip(together.rfd, alone, strict=True):
        assert own <= most * single.rfd[0]
