"""What the device itself answers: force on a held bed, free speed, step of a valve."""

import re

import digiclay
import numpy as np
import pytest
from digiclay import DigiclayError
from digiclay.core.model.matrix_drive import DriveParameters
from digiclay.core.scene.toml_table import tabulate

from tests.assemble import refused_in_a_line


def test_a_held_bed_has_the_law_of_the_contact():
    scene = digiclay.scene("tap", {"relaxation": "absent"})
    law = scene.section("contact")
    force = digiclay.force(scene, (0.0, 0.0, 0.039))
    # The pin at the lowest point is 1 mm deep: equation 11 by hand.
    deepest = (
        law.share * law.stiffness / law.exponent * np.expm1(law.exponent * (1e-3 - law.offset))
    )
    assert force.max() == force[60] == pytest.approx(deepest, rel=1e-9)
    assert digiclay.force(scene, (0.0, 0.0, 0.039, 2.0, 0.0, 0.0, 0.0)).tolist() == force.tolist()
    higher = digiclay.scene(scene, {"actuator.rest_height": "42 mm"})
    assert digiclay.force(higher, (0.0, 0.0, 0.041)).tolist() == pytest.approx(
        force.tolist(), rel=1e-9
    )
    assert not digiclay.force(scene, (0.0, 0.0, 0.041)).any()
    # A bed that is held, as a run has it: valves without a command stay shut.
    held = digiclay.scene({**tabulate(scene), "control": "absent"}, {"simulation.duration": 0.005})
    pressed = held.with_sections(
        trajectory=digiclay.scene(
            {"trajectory": {"waypoints": [{"time": 1, "position": [0, 0, 0.039]}]}}
        ).section("trajectory")
    )
    first = next(digiclay.steps(pressed))
    np.testing.assert_allclose(first.force, force, rtol=1e-9, atol=1e-15)


def test_a_pin_moves_as_the_equations_of_valve_and_cylinder_say():
    plain = digiclay.scene("tap", {"conduit": "absent", "valve_lag": "absent", "delay": "absent"})
    speeds = digiclay.free_speed(plain)
    law, area = plain.valve.flow_law(plain.fluid, plain.actuator.area), plain.actuator.area
    assert (
        speeds.rise
        == -speeds.fall
        == pytest.approx(law.laminar * plain.supply.high / area, rel=1e-12)
    )
    time, height = digiclay.step_response(plain, 0.5, 1.0)
    # The laminar flow is as the square of the opening.
    np.testing.assert_allclose(height, 0.04 + 0.25 * speeds.rise * time, rtol=1e-9)
    lagging = digiclay.scene(
        plain, {"valve_lag": {"time_constant": "20 ms"}, "delay": {"dead_time": "7 ms"}}
    )
    time, height = digiclay.step_response(lagging, -1.0, 0.2)
    late = np.maximum(time - 7e-3, 0.0)
    one, two = -np.expm1(-late / 20e-3), -np.expm1(-late / 10e-3)
    wanted = 0.04 + speeds.fall * (late - 40e-3 * one + 10e-3 * two)
    # Of the fourth order in steps of a sixteenth of the time constant.
    np.testing.assert_allclose(height, wanted, atol=1e-9)
    assert digiclay.step_response(plain, 1.0, 10.0).height[-1] == plain.actuator.stroke
    for drive in ({"sections": 4}, {"kind": "servo"}):  # the valve alone counts
        driven = plain.with_sections(drive=DriveParameters(**drive))
        assert digiclay.step_response(driven, 1.0, 10.0).height[-1] == plain.actuator.stroke
    assert (
        digiclay.step_response(digiclay.scene("five_fingers_mound"), 0.0).height.tolist()
        == [0.04] * 21
    )


@pytest.mark.parametrize(
    "ask, message",
    [
        (
            lambda scene: digiclay.force(scene, (0, 0)),
            "Waypoint.position must be a list of 3 numbers (got 2",
        ),
        (
            lambda scene: digiclay.force(scene, "abc"),
            "Waypoint.position must be a number (got 'abc').",
        ),
        (
            lambda scene: digiclay.force(scene, None),
            "Waypoint.position must be a number (got None).",
        ),
        (
            lambda scene: digiclay.force(scene, (0, 0, np.nan)),
            "Waypoint.position must be a finite number",
        ),
        (
            lambda scene: digiclay.force(scene, (0, 0, 0.04, 1)),
            "Waypoint.orientation must be a list of 4",
        ),
        (
            lambda scene: digiclay.force(scene, (0, 0, 0.04, 0, 0, 0, 0)),
            "Trajectory.orientations must have a",
        ),
        (lambda scene: digiclay.force(scene, (0, 0, 0.0)), "force.pose must press at most 0.0"),
        (
            lambda scene: digiclay.force(digiclay.scene("pinch_crease"), (0, 0, 0.04)),
            "scene.fingers must be o",
        ),
        (
            lambda scene: digiclay.force(digiclay.scene(scene, {"fingertip": "absent"}), (0, 0, 0)),
            "fingertip",
        ),
        (
            lambda scene: digiclay.force("tap", (0, 0, 0.04)),
            "scene must be a Scene, as digiclay.scene returns",
        ),
        (
            lambda scene: digiclay.free_speed(None),
            "scene must be a Scene, as digiclay.scene returns it (got None",
        ),
        (
            lambda scene: digiclay.step_response(scene, 2.0),
            "ValveStep.command must be at most 1 (got 2).",
        ),
        (
            lambda scene: digiclay.step_response(scene, np.nan),
            "ValveStep.command must be a finite number",
        ),
        (
            lambda scene: digiclay.step_response(scene, 1.0, 0.0),
            "ValveStep.duration must be above 0 s (got 0 s).",
        ),
        (
            lambda scene: digiclay.step_response(scene, 1.0, 1e9),
            "ValveStep.duration must be at most 100 s",
        ),
        (
            lambda scene: digiclay.step_response(None, 1.0),
            "scene must be a Scene, as digiclay.scene returns it",
        ),
    ],
)
def test_the_device_is_not_asked_what_has_no_answer(tap, ask, message):
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}"):
        ask(tap)
