"""Runs judged in a stack, without their histories, are judged as they are alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from digiclay.core.base.errors import DivergenceError
from digiclay.core.batch.run_together import measure_together
from digiclay.core.control.methods import METHODS
from digiclay.core.metrics.summary import METRICS
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run

from tests.assemble import STACKABLE, begun_apart, moved, sample

#: Sums in another order. By unit: heights agree to 1e-12 m and forces to 1e-10 N (test_run_together.py), lags
#: are rounded to 1e-12 m; a volume adds up some hundred heights, each over 1e-5 m².
RELATIVE, ABSOLUTE = 1e-9, {"m": 1e-12, "N": 1e-10, "m3": 1e-15, "s": 1e-12, "1": 1e-12}


def judged(scenes: Sequence[Scene]) -> list[Any]:
    """Judge scenes in a stack; return what each came to."""
    done = dict(measure_together(scenes))
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


def test_the_papers_session_is_judged_as_alone() -> None:
    # The ridge ends after 10 s: by then every metric has a value.
    scenes = [
        sample("ridge_mound_valley", f"control.force_gain={gain}", "simulation.duration=11")
        for gain in (3, 5)
    ]
    assert_judged_as_alone(scenes)


@pytest.mark.parametrize("key", ["duration", "control_period"])
def test_runs_with_one_finger_and_times_of_their_own_are_judged_as_alone(key: str) -> None:
    values = {"duration": (2.0, 2.5), "control_period": (4e-3, 5e-3)}[key]
    assert_judged_as_alone(
        [sample("tap", "simulation.duration=2.5", f"simulation.{key}={value}") for value in values]
    )


def test_rows_that_are_left_out_are_left_out_of_the_metrics() -> None:
    settings = ("recorder.every=7", "simulation.duration=1.003")
    assert_judged_as_alone([sample("slow_press", f"control.force_gain={gain}", *settings) for gain in (3, 5)])


def test_a_session_of_a_single_period_is_judged() -> None:
    scenes = [sample("tap", f"control.force_gain={gain}", "simulation.duration=5e-3") for gain in (3, 5)]
    assert_judged_as_alone(scenes)


def test_a_finger_that_touches_nothing_is_judged() -> None:
    low = ("simulation.duration=0.1", "control.force_gain=3")
    assert_judged_as_alone([sample("tap", f"actuator.rest_height={height}", *low) for height in (0.01, 0.02)])


def test_beds_whose_rows_are_shifted_are_judged() -> None:
    settings = ("layout.arrangement=hexagonal", "simulation.duration=2.5")
    assert_judged_as_alone(
        [sample("ridge_mound_valley", f"control.force_gain={gain}", *settings) for gain in (3, 5)]
    )


def test_a_run_without_a_history_has_none() -> None:
    (only,) = judged([sample("tap", "simulation.duration=0.05")])
    assert only.history == {}


def test_a_run_that_diverges_is_told_and_the_others_are_judged() -> None:
    long = ("simulation.control_period=50e-3", "simulation.physics_step=50e-3", "simulation.duration=2.0")
    known = sample("slow_press", "simulation.stepper=euler", *long)
    away = moved(known, 0.0, 20e-3)
    found = judged([away, known])
    assert isinstance(found[1], DivergenceError)
    assert_as(found[0], run(away))
