"""Pace of the methods: what they state is not above what pins follow, and a faster one is seen to fail."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.control.methods import ControlParameters, Pace
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes
from digiclay.sessions.sculpting import begin_session, follow_finger
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes.tracking import find_tracking

from benchmarks.pace import RIDGE, VALLEY, find_limit, find_stated, lead, make_device

DESIGN = make_device("hybrid", "design", "design")


@pytest.mark.parametrize(
    ("method", "bed", "preset"),
    [
        ("hybrid", "design", "design"), ("hybrid", "fine", "design"), ("hybrid", "paper", "paper"),
        ("virtual_master", "design", "design"), ("virtual_master", "paper", "paper"),
        ("cell_states", "design", "design"),
    ],
)  # fmt: skip
def test_pins_follow_at_the_stated_pace(method: str, bed: str, preset: str) -> None:
    scene = make_device(method, bed, preset)
    system = assemble(scene)
    for height in (RIDGE, VALLEY):
        led = lead(scene, system, find_stated(scene, system), height)
        assert led.is_followed(method), led


@pytest.mark.parametrize(
    ("raised", "height"),
    [
        ({"push": 0.4}, VALLEY),  # m/s: the pins ahead are not out of the way in time
        ({"drag": 0.5}, RIDGE),
        ({"gain": 8.0}, RIDGE),
    ],
)
def test_a_pace_that_is_too_fast_is_seen_to_fail(raised: dict[str, float], height: float) -> None:
    system = assemble(DESIGN)
    assert not lead(DESIGN, system, replace(find_stated(DESIGN, system), **raised), height).is_followed(
        "hybrid"
    )


def test_the_limit_is_the_last_speed_that_held_and_0_where_the_stated_one_does_not() -> None:
    system = assemble(DESIGN)
    stated = find_stated(DESIGN, system)
    limit, led = find_limit(DESIGN, system, stated, "push")
    assert stated.push <= limit < 0.4
    assert led.force < 0.5
    assert find_limit(DESIGN, system, replace(stated, push=0.4), "push")[0] == 0.0


def test_what_is_made_for_hands_is_led_at_100_mm_a_second_and_a_method_of_one_s_own_carefully() -> None:
    tracking = find_tracking(DESIGN, assemble(DESIGN))
    assert tracking is not None
    assert min(tracking.drag, tracking.push) >= 0.1
    assert tracking.limit_drag(50e-3, pressed=False) == tracking.drag  # the skirt is there at any height
    assert ControlParameters().pace == Pace()
    assert Pace().press == 20e-3


def test_pins_stay_where_a_stroke_of_method_iii_has_left_them() -> None:
    bed = BEDS["design"]
    scene = make_scene(bed.preset, Layout(rows=30, columns=50, pitch=bed.pitch), bed.method, bed.share)
    session, _ = begin_session(1, "", scene, np.array([0.0, 0.0, 0.05, *LEVEL]))
    moves = tuple((float(at), 1e-3 * at, 0.0) for at in range(-15, 16))
    stroke = PointerStroke(brush="lower", depth=4e-3, moves=tuple((at + 15.0, x, y) for at, x, y in moves))
    *_, session = play_strokes(session, (stroke,))
    left = session.state.row(0).copy()
    later = follow_finger(session, session.pose, 60).state.row(0)
    # 1 µm is what counts as arrived.
    np.testing.assert_allclose(later, left, rtol=0, atol=2e-6)
    assert later.max() <= scene.actuator.rest_height + 2e-6


# More than twice the stated speed through a valley 12 mm deep: without yielding 351 kN. How deep it gets
# before is chance, so one speed has more than its neighbors.
@pytest.mark.parametrize(("push", "most"), [(0.22, 50.0), (0.24, 50.0), (0.25, 500.0)])
def test_pins_give_way_under_a_fingertip_that_is_not_where_it_is_taken_to_be(
    push: float, most: float
) -> None:
    system = assemble(DESIGN)
    fast = replace(find_stated(DESIGN, system), push=push)
    assert lead(DESIGN, system, fast, -12e-3).force < most
