"""Two fingertips near each other, beside each of them alone."""

from dataclasses import replace

import pytest
from digiclay.core.session.run_scene import run

from benchmarks.several_fingers import TURN, make_scene, measure_near


@pytest.mark.parametrize(
    "method, case, turn, most",
    [
        # From 15 mm on at most 1.1 of alone; nearer 1.5: both press a pin, or only one can have it.
        ("virtual_master", "crossing, 11", TURN, 1.1),
        ("virtual_master", "approach and part, 6", TURN, 1.1),
        ("virtual_master", "up beside down, 18", TURN, 1.1),
        # What it presses is within reach of the one beside it, whose underside is far above.
        ("virtual_master", "lands over the rim beside one, 11", TURN, 1.1),
        ("virtual_master", "lands over the rim beside one, 12", 0.0, 1.1),
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
        ("cell_states", "up beside down, 18", TURN, 1.1),
        ("cell_states", "up beside down, 15", 1.1, 1.1),
        # One is felt, and its cells follow, while no cell follows the other one yet.
        ("cell_states", "up beside down, 12", 0.5, 1.2),
        ("cell_states", "up beside down, 12", 2.0, 1.2),
        ("cell_states", "sinks beside a drag, 15", 0.5, 1.1),
        ("cell_states", "crossing, 11", TURN, 1.1),
    ],
)
def test_no_finger_is_stolen_by_another_one_that_comes_near(method, case, turn, most):
    together, alone = measure_near(method, case, turn)
    for own, single in zip(together, alone, strict=True):
        assert own["max_total_force"] < 2.0  # N: what fingers were measured up to
        assert own["rfd"] <= most * single["rfd"]
        # The RFD leaves out the time without contact: a hundredth is a pause between two periods of
        # it.
        assert own["contact_share"] >= single["contact_share"] - 0.01


@pytest.mark.parametrize("turn", [TURN, 1.1, 2.0])
@pytest.mark.parametrize("pitch", [3e-3, 4.5e-3, 6e-3])
def test_on_a_bed_of_a_few_pins_a_force_comes_to_rest_after_a_tremor(pitch, turn):
    # Seconds, mm.
    heights = {
        0.0: 43.0,
        0.5: 38.5,
        2.0: 38.5,
        2.005: 38.7,
        2.015: 38.7,
        2.02: 38.5,
        4.0: 38.5,
    }
    made = make_scene("hybrid", [[(time, 0.4, 0.7, z) for time, z in heights.items()]], 20, turn)
    force = run(replace(made, layout=replace(made.layout, pitch=pitch))).history["total_force"][
        500:600
    ]
    # A hundredth of the set point; it swung by 21 mN, from period to period, where one pin carries
    # the most.
    assert force.std() < 4e-3
