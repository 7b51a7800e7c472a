"""Runs judged in a stack, without their histories, are judged as they are alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import pytest
from digiclay.core.base.errors import DivergenceError
from digiclay.core.batch.packing import describe_structure
from digiclay.core.batch.run_together import measure_together
from digiclay.core.control.methods import METHODS
from digiclay.core.metrics.summary import METRICS
from digiclay.core.scene.schema import Scene
from digiclay.core.session.accuracy import estimate_errors, make_reference
from digiclay.core.session.run_scene import run

from tests.assemble import STACKABLE, begun_apart, moved, sample

#: Sums in another order. By unit: heights agree to 1e-12 m and forces to 1e-10 N (test_run_together.py), lags
#: are rounded to 1e-12 m; a volume adds up some hundred heights, each over 1e-5 m².
RELATIVE, ABSOLUTE = 1e-9, {"m": 1e-12, "N": 1e-10, "m3": 1e-15, "s": 1e-12, "1": 1e-12}


def judged(scenes: Sequence[Scene], *, errors: bool = False) -> list[Any]:
    """Judge scenes in a stack, with their errors or without; return what each came to."""
    done = dict(measure_together(scenes, errors=errors))
    return [done[number] for number in range(len(scenes))]


def figures(result: Any) -> dict[str, Any]:
    """Return what a run is judged by."""
    return {name: result.metrics[name] for name in (*METRICS, "losses", "control_periods")}


def assert_judged_as_alone(scenes: Sequence[Scene]) -> None:
    """Check every figure of every run against the run alone."""
    for found, one in zip(judged(scenes), scenes, strict=True):
        assert_as(found, run(one))


def assert_as(found: Any, alone: Any) -> None:
    """Check every figure of a run against the run alone."""
    for name, value in figures(alone).items():
        unit = alone.metrics["units"].get(name, "1")
        assert found.metrics["units"].get(name, "1") == unit
        expected = value if value is None else pytest.approx(value, rel=RELATIVE, abs=ABSOLUTE[unit])
        assert found.metrics[name] == expected, name


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_fingers_and_ends_of_their_own_are_judged_as_alone(method: str) -> None:
    known = sample(STACKABLE[method], f"control.method={method}", "simulation.duration=2.5")
    assert_judged_as_alone(begun_apart(known, (1.5, 1.3, 1.1)))


@pytest.mark.parametrize(
    ("name", "key", "values", "settings"),
    [
        # The ridge ends after 10 s: by then every metric has a value.
        ("ridge_mound_valley", "control.force_gain", (3, 5), ("simulation.duration=11",)),
        ("tap", "simulation.duration", (2.0, 2.5), ()),
        ("tap", "simulation.control_period", (4e-3, 5e-3), ("simulation.duration=2.5",)),
        ("slow_press", "control.force_gain", (3, 5), ("recorder.every=7", "simulation.duration=1.003")),
        ("tap", "control.force_gain", (3, 5), ("simulation.duration=5e-3",)),  # a single period
        ("tap", "actuator.rest_height", (0.01, 0.02), ("simulation.duration=0.1",)),  # nothing is touched
        (
            "ridge_mound_valley",
            "control.force_gain",
            (3, 5),
            ("layout.arrangement=hexagonal", "simulation.duration=2.5"),
        ),
    ],
)
def test_runs_with_parameters_of_their_own_are_judged_as_alone(
    name: str, key: str, values: Sequence[float], settings: Sequence[str]
) -> None:
    assert_judged_as_alone([sample(name, *settings, f"{key}={value}") for value in values])


def test_a_run_without_a_history_has_none() -> None:
    (only,) = judged([sample("tap", "simulation.duration=0.05")])
    assert only.history == {}
    assert "height_error" not in only.metrics  # not asked for


def test_a_run_that_diverges_is_told_and_the_others_are_judged() -> None:
    long = ("simulation.control_period=50e-3", "simulation.physics_step=50e-3", "simulation.duration=2.0")
    known = sample("slow_press", "simulation.stepper=euler", *long)
    away = moved(known, 0.0, 20e-3)
    found = judged([away, known])
    assert isinstance(found[1], DivergenceError)
    assert_as(found[0], run(away))


#: An estimate is the difference of two integrations under the same commands. Alone and in a stack both end in
#: other last bits (sums in another order), some 1e-17 m and 1e-14 N, of heights of 4 cm and forces of 0.4 N.
NOTHING = {"height": 1e-15, "force": 1e-12, "total_force": 1e-12}


def assert_estimated_as_alone(scenes: Sequence[Scene]) -> None:
    """Check the errors of every run against what is estimated of the run alone."""
    assert len({describe_structure(make_reference(one)) for one in scenes}) == 1
    for found, one in zip(judged(scenes, errors=True), scenes, strict=True):
        history = run(one).history
        assert history is not None
        alone = estimate_errors(one, history)
        assert alone is not None
        assert alone.height > 1e-12  # there is something to estimate
        for name, value in asdict(alone).items():
            expected = pytest.approx(value, rel=RELATIVE, abs=NOTHING[name])
            assert found.metrics[f"{name}_error"] == expected, name


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_fingers_and_ends_of_their_own_are_as_exact_as_alone(method: str) -> None:
    known = sample(STACKABLE[method], f"control.method={method}", "simulation.duration=1.5")
    assert_estimated_as_alone(begun_apart(known, (0.7, 0.9, 1.1)))


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("control.force_gain", ("2", "8")),
        ("fingertip.length", ("8e-3", "12e-3")),
        ("contact.stiffness", ("150", "400")),
        ("relaxation.times", ("[2e-3, 0.1, 1.0]", "[4e-3, 0.07, 1.4]")),
        ("actuator.bore", ("1.8e-3", "2e-3")),
        ("actuator.bore", ("0.2e-3", "0.3e-3")),  # the load makes the flow turbulent
        ("supply.high", ("0.4e5", "0.6e5")),
        ("valve.stroke", ("25e-6", "40e-6")),
        ("valve_lag.time_constant", ("1e-3", "3e-3")),
        ("delay.dead_time", ("1e-3", "2e-3")),
        ("fluid.viscosity", ("1e-6", "3e-6")),
        ("simulation.control_period", ("4e-3", "5e-3")),
    ],
)
def test_runs_with_parameters_of_their_own_are_as_exact_as_alone(key: str, values: Sequence[str]) -> None:
    assert_estimated_as_alone([sample("tap", f"{key}={value}") for value in values])


@pytest.mark.parametrize(
    ("stepper", "step"), [("richardson", "1e-3"), ("adaptive", "5e-3"), ("runge_kutta_4", "1e-3")]
)
def test_runs_of_any_stepper_are_as_exact_as_alone(stepper: str, step: str) -> None:
    settings = (f"simulation.stepper={stepper}", f"simulation.physics_step={step}", "simulation.duration=0.4")
    assert_estimated_as_alone([sample("tap", f"control.force_gain={gain}", *settings) for gain in (3, 5)])


def test_pins_on_their_end_stops_are_as_exact_as_alone() -> None:
    settings = ("control.method=elastic", "control.stiffness=5")
    known = sample("tap", "actuator.rest_height=1.5e-3", *settings)
    low = moved(known, 0.0, -39e-3)
    assert_estimated_as_alone([low, replace(low, actuator=replace(low.actuator, rest_height=1e-3))])


def test_where_commands_are_left_out_no_errors_are_told() -> None:
    (found,) = judged([sample("tap", "recorder.every=2", "simulation.duration=0.1")], errors=True)
    assert "height_error" not in found.metrics
