"""Runs in a stack come to what they come to alone, and what befalls one of them is its own affair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError, ParameterError
from digiclay.core.batch.packing import describe_structure
from digiclay.core.batch.run_together import run_together
from digiclay.core.control.methods import METHODS
from digiclay.core.model.trajectory import Waypoint
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result, run

from tests.assemble import STACKABLE, moved, sample

#: Settings of a short run, and the key of its step.
SHORT, STEP = ("simulation.duration=0.4",), "simulation.physics_step"
#: Sums in another order: a last bit here and there. Heights are centimeters, forces tenths of a newton.
HEIGHT, FORCE = 1e-12, 1e-10


def together(scenes: Sequence[Scene]) -> list[Any]:
    """Run scenes in a stack; return what each came to."""
    assert len({describe_structure(one) for one in scenes}) == 1
    done: dict[int, Any] = {}
    for number, result in run_together(scenes):
        history = getattr(result, "history", None)
        if history:  # valid until the next result is asked for
            result = replace(result, history={name: rows.copy() for name, rows in history.items()})
        done[number] = result
    return [done[number] for number in range(len(scenes))]


def assert_as_alone(found: Result, known: Scene) -> None:
    """Check a result of a stack against the session by itself."""
    alone = run(known)
    assert found.history is not None
    assert alone.history is not None
    assert found.history.keys() == alone.history.keys()
    for name, values in alone.history.items():
        tolerance = HEIGHT if name == "height" else FORCE
        np.testing.assert_allclose(found.history[name], values, rtol=0, atol=tolerance, err_msg=name)
    judged = ("control_periods", "rfd", "contact_share", "incomplete")
    known_by = {name: value for name, value in alone.metrics.items() if name in judged and value is not None}
    assert {name: found.metrics[name] for name in known_by} == pytest.approx(known_by, rel=1e-9)
    assert found.metrics["losses"] == alone.metrics["losses"]


def assert_all_as_alone(scenes: Sequence[Scene]) -> list[Any]:
    """Check every result of a stack against the session by itself; return the results."""
    results = together(scenes)
    for found, one in zip(results, scenes, strict=True):
        assert_as_alone(found, one)
    return results


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_fingers_and_ends_of_their_own_come_to_what_they_come_to_alone(method: str) -> None:
    known = sample(STACKABLE[method], f"control.method={method}", "simulation.duration=1.5")
    scenes = [
        replace(
            moved(known, 0.7e-3 * i, -0.2e-3 * i),
            simulation=replace(known.simulation, duration=1.2 - 0.1 * i),
        )
        for i in range(3)
    ]
    assert_all_as_alone(scenes)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("control.force_gain", ("2", "5", "8")),
        ("control.position_gain", ("200", "500", "800")),
        ("control.loss_time", ("0.01", "0.05", "0.1")),
        ("control.travel", ("1e-3", "2e-3", "4e-3")),
        ("blister.radius", ("12e-3", "15e-3", "16e-3")),
        ("blister.sigma", ("6e-3", "9e-3")),
        ("fingertip.length", ("8e-3", "10e-3", "12e-3")),
        ("contact.stiffness", ("150", "250", "400")),
        ("relaxation.times", ("[2e-3, 0.1, 1.0]", "[4e-3, 0.07, 1.4]")),
        ("actuator.bore", ("1.8e-3", "2e-3")),
        ("actuator.rest_height", ("30e-3", "40e-3")),
        ("supply.high", ("0.4e5", "0.6e5")),
        ("valve.stroke", ("25e-6", "30e-6", "40e-6")),
        ("valve_lag.time_constant", ("1e-3", "3e-3")),
        ("delay.dead_time", ("1e-3", "2e-3")),
        ("fluid.viscosity", ("1e-6", "1.6e-6", "3e-6")),
        ("fluid.viscosity", ("1.6e-9", "2e-9")),  # the flow is turbulent
        ("simulation.control_period", ("4e-3", "5e-3")),
    ],
)
def test_runs_with_parameters_of_their_own_come_to_what_they_come_to_alone(
    key: str, values: Sequence[str]
) -> None:
    profile = "gaussian" if key == "blister.sigma" else "cone"
    scenes = [sample("tap", f"{key}={value}", f"blister.profile={profile}") for value in values]
    assert_all_as_alone(scenes)


@pytest.mark.parametrize("method", ["elastic", "plastic", "cell_states"])
@pytest.mark.parametrize(
    ("key", "values"),
    [("valve.stroke", ("25e-6", "40e-6")), ("actuator.rest_height", ("39e-3", "41e-3"))],
)
def test_the_other_methods_hold_on_devices_of_their_own(method: str, key: str, values: Sequence[str]) -> None:
    assert_all_as_alone([sample("tap", f"{key}={value}", f"control.method={method}") for value in values])


@pytest.mark.parametrize(
    ("name", "key", "values", "settings"),
    [
        ("elastic_press", "control.stiffness", ("10", "20", "40"), ("simulation.duration=1.0",)),
        ("elastic_press", "control.settling_time", ("20e-3", "40e-3"), ("simulation.duration=1.0",)),
        ("plastic_press", "control.yield_force", ("0.02", "0.05"), ("simulation.duration=1.0",)),
        ("plastic_press", "control.damping", ("5", "8"), ("simulation.duration=1.0",)),
        ("tap", "valve.stroke", ("25e-6", "40e-6"), ("simulation.stepper=richardson", *SHORT)),
        *(
            (
                "tap",
                "control.force_gain",
                ("3", "5"),
                (f"simulation.stepper={name}", f"{STEP}={step}", *SHORT),
            )
            for name, step in (("richardson", "5e-4"), ("adaptive", "5e-3"), ("runge_kutta_4", "5e-4"))
        ),
        ("slow_press", "control.force_gain", ("3", "5"), ("recorder.every=7", "simulation.duration=1.003")),
        # The cells are chosen anew every 32 periods or sooner: most of their sets have no row of their own.
        (
            "plastic_press",
            "contact.exponent",
            ("2000", "1990"),
            ("recorder.every=400", "simulation.duration=6"),
        ),
    ],
)
def test_behaviors_steppers_and_recorders_with_parameters_of_their_own_do_what_they_do_alone(
    name: str, key: str, values: Sequence[str], settings: Sequence[str]
) -> None:
    assert_all_as_alone([sample(name, f"{key}={value}", *settings) for value in values])


def test_the_papers_session_in_a_stack_is_the_papers_session() -> None:
    gains = ((3, 10), (5, 26.5))
    scenes = [
        sample("ridge_mound_valley", f"control.force_gain={gain}", f"simulation.duration={end}")
        for gain, end in gains
    ]
    assert_as_alone(together(scenes)[1], scenes[1])


def test_pins_pressed_onto_their_end_stops_come_to_what_they_come_to_alone() -> None:
    rests = ("1e-3", "1.5e-3")
    method = ("control.method=elastic", "control.stiffness=5")
    low = [sample("tap", f"actuator.rest_height={rest}", *method) for rest in rests]
    scenes = [moved(one, 0.0, -41e-3) for one in low]
    for found in assert_all_as_alone(scenes):
        pressed = found.history["force"] > 0.0
        assert found.history["height"][pressed].min() == 0.0


def test_a_finger_that_comes_back_finds_the_pulp_as_relaxed_as_alone() -> None:
    points = tuple(
        Waypoint(time=time, position=(0.0, 0.0, z))
        for time, z in ((0.0, 41e-3), (0.2, 38e-3), (0.3, 60e-3), (0.5, 60e-3), (0.7, 38e-3), (0.9, 60e-3))
    )
    known = sample("tap", "control.method=plastic")
    twice = known.with_sections(
        trajectory=replace(known.section("trajectory"), waypoints=points),
        simulation=replace(known.simulation, duration=0.9),
    )
    scenes = [twice, moved(twice, 1e-3, -0.5e-3)]
    assert_all_as_alone(scenes)


def test_without_a_recorder_there_is_no_history() -> None:
    scenes = [sample("tap", f"control.force_gain={gain}", "recorder=absent") for gain in (3, 5)]
    assert [one.history for one in together(scenes)] == [{}, {}]


def test_without_a_finger_or_a_controller_a_stack_stands_still() -> None:
    settings = ("control=absent", "fingertip=absent", "simulation.duration=0.1")
    scenes = [replace(sample("tap", *settings), name=name) for name in "ab"]
    assert_as_alone(together(scenes)[1], scenes[1])


def blown_up() -> list[Scene]:
    """Return three scenes in steps far too long for Euler; only the middle one's finger gets to the bed."""
    long = ("simulation.control_period=50e-3", "simulation.physics_step=50e-3", "simulation.duration=2.0")
    known = sample("slow_press", "simulation.stepper=euler", *long)
    return [moved(known, 0.0, 20e-3), known, moved(known, 1e-3, 20e-3)]


def test_a_run_that_diverges_ends_in_its_own_error_and_the_others_go_on() -> None:
    scenes = blown_up()
    with pytest.raises(DivergenceError) as alone:
        run(scenes[1])
    found = together(scenes)
    assert isinstance(found[1], DivergenceError)
    assert str(found[1]) == str(alone.value)
    assert_as_alone(found[0], scenes[0])
    assert_as_alone(found[2], scenes[2])


def test_a_run_that_cannot_fit_in_memory_is_told_and_the_others_go_on() -> None:
    known = sample("tap")
    endless = replace(known, simulation=replace(known.simulation, duration=1e6))
    found = together([endless, known])
    assert isinstance(found[0], ParameterError)
    assert str(found[0]).startswith("recorder.every must be at least")
    assert_as_alone(found[1], known)


def test_a_stack_that_is_stopped_gives_up_what_is_not_done() -> None:
    scenes = [sample("tap", f"control.force_gain={gain}") for gain in (3, 5)]
    assert list(run_together(scenes, stopped=lambda: True)) == []


def test_the_run_times_of_a_stack_are_shares_of_it() -> None:
    first, second = together([sample("tap", f"control.force_gain={gain}") for gain in (3, 5)])
    assert first.run_time == second.run_time > 0.0


@pytest.mark.parametrize(
    "setting",
    [
        "sensors.delay=1",
        "layout.rows=21",
        "delay=absent",
        "simulation.physics_step=2e-3",
        "blister.profile=gaussian",
        "fluid.viscosity=1.6e-9",  # the flow is turbulent
    ],
)
def test_scenes_of_another_structure_do_not_stand_together(setting: str) -> None:
    assert describe_structure(sample("tap", setting)) != describe_structure(sample("tap"))


@pytest.mark.parametrize("method", ["virtual_master", "cell_states", "elastic"])
@pytest.mark.parametrize(
    "sensors",
    [
        ("sensors.height_step=20e-6", "sensors.force_step=1e-3"),
        ("sensors.delay=2",),
        ("sensors.delay=1", "sensors.height_step=5e-6"),
        ("sensors.observer=valve", "sensors.height_step=1e-6"),
    ],
)
def test_runs_with_sensors_come_to_what_they_come_to_alone(method: str, sensors: Sequence[str]) -> None:
    known = sample("slow_press", f"control.method={method}", *sensors, "simulation.duration=0.8")
    scenes = [moved(known, 0.7e-3 * i, -1e-3 * i) for i in range(3)]
    assert_all_as_alone(scenes)


def test_runs_with_sensors_of_their_own_come_to_what_they_come_to_alone() -> None:
    steps = ("5e-6", "10e-6", "20e-6")
    scenes = [sample("tap", f"sensors.height_step={step}", f"sensors.force_step={step}") for step in steps]
    assert_all_as_alone(scenes)


#: Noise of three runs: of force, of height, and its seed.
NOISES = (("1e-3", "5e-6", "1"), ("2e-3", "2e-6", "2"), ("0.5e-3", "20e-6", str(2**62 + 1)))


def noisy(name: str, *settings: str) -> list[Scene]:
    """Return scenes with noise of their own."""
    keys = ("force_noise", "height_noise", "seed")
    noises = ([f"sensors.{key}={value}" for key, value in zip(keys, noise, strict=True)] for noise in NOISES)
    return [sample(name, *settings, *noise) for noise in noises]


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_noise_of_their_own_come_to_what_they_come_to_alone(method: str) -> None:
    scenes = noisy(STACKABLE[method], f"control.method={method}", "simulation.duration=1.5")
    # Fingers that come down elsewhere and differently far: other cells of each, and not as many.
    scenes = [
        replace(moved(one, 2e-3 * i, -0.2e-3 * i), simulation=replace(one.simulation, duration=1.5 - 0.3 * i))
        for i, one in enumerate(scenes)
    ]
    assert_all_as_alone(scenes)


@pytest.mark.parametrize("method", ["virtual_master", "cell_states"])
@pytest.mark.parametrize(
    "sensors",
    [
        ("sensors.height_step=20e-6", "sensors.force_step=1e-3"),
        ("sensors.delay=2", "sensors.height_step=5e-6"),
    ],
)
def test_noise_that_is_rounded_or_late_is_that_of_the_run_alone(method: str, sensors: Sequence[str]) -> None:
    scenes = noisy("slow_press", f"control.method={method}", *sensors, "simulation.duration=0.8")
    assert_all_as_alone(scenes)


@pytest.mark.parametrize("method", ["virtual_master", "cell_states", "viscous"])
def test_noisy_runs_whose_sets_are_far_apart_come_to_what_they_come_to_alone(method: str) -> None:
    lengths = ("7e-3", "10e-3", "14e-3")
    one_by_one = (
        noisy("tap", f"control.method={method}", f"fingertip.length={length}")[i]
        for i, length in enumerate(lengths)
    )
    scenes = [moved(one, 8e-3 * (i - 1), -0.2e-3 * i) for i, one in enumerate(one_by_one)]
    assert_all_as_alone(scenes)


def test_the_papers_session_with_noise_is_that_session() -> None:
    scenes = noisy("ridge_mound_valley", "simulation.duration=6")
    assert_all_as_alone(scenes)


def test_runs_that_start_from_a_shape_come_to_what_they_come_to_alone() -> None:
    known = sample("dome_peaked", "layout.rows=15", "layout.columns=15", "simulation.duration=3.2")
    scenes = [moved(known, 0.7e-3 * i, -0.5e-3 * i) for i in range(2)]
    assert_all_as_alone(scenes)
