"""Two fingertips near each other, beside each of them alone."""

from __future__ import annotations

from dataclasses import replace

import pytest
from digiclay.core.scene.assembly import assemble

from benchmarks.several_fingers import PRESSED, TURN, feel, land, make_scene, measure_near, trace


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
        ("hybrid", "up beside down, 12", 1.1, 1.5),
        # Pins whose pulp one has pressed long carry nothing, until the other presses them.
        ("hybrid", "sinks beside a drag, 12", TURN, 1.5),
        ("hybrid", "sinks beside a drag, 12", 4.0, 1.5),
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


@pytest.mark.parametrize("turn", [TURN, 1.1, 2.0])
def test_on_a_bed_of_a_few_pins_a_force_comes_to_rest_after_a_tremor(turn: float) -> None:
    made = make_scene("hybrid", 1, 20)
    system = assemble(replace(made, layout=replace(made.layout, pitch=6e-3)))
    path = trace([[*land(0.4, 0.7), (4.0, 0.4, 0.7, PRESSED)]], system.period, turn)
    path[400:403, 0, 2] += 0.2e-3  # for 15 ms
    force = feel(system, path).force[500:600, 0]
    # A hundredth of the set point; it swung by 30 to 39 mN, from period to period.
    assert force.std() < 4e-3
