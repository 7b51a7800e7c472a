"""Runs with sensors, or with a shape at the start, come to in a stack what they come to alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.schema import Scene

from tests.assemble import STACKABLE, moved, sample
from tests.scenes.test_run_together import assert_as_alone, together


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
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


def test_runs_with_sensors_of_their_own_come_to_what_they_come_to_alone() -> None:
    steps = ("5e-6", "10e-6", "20e-6")
    scenes = [sample("tap", f"sensors.height_step={step}", f"sensors.force_step={step}") for step in steps]
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


#: Noise of three runs: of force, of height, and its seed.
NOISES = (("1e-3", "5e-6", "1"), ("2e-3", "2e-6", "2"), ("0.5e-3", "20e-6", str(2**62 + 1)))


def noisy(name: str, *settings: str) -> list[Scene]:
    """Return scenes with noise of their own."""
    return [
        sample(
            name,
            *settings,
            f"sensors.force_noise={force}",
            f"sensors.height_noise={height}",
            f"sensors.seed={seed}",
        )
        for force, height, seed in NOISES
    ]


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_noise_of_their_own_come_to_what_they_come_to_alone(method: str) -> None:
    scenes = noisy(STACKABLE[method], f"control.method={method}", "simulation.duration=1.5")
    # Fingers that come down elsewhere and differently far: other cells of each, and not as many.
    scenes = [
        replace(moved(one, 2e-3 * i, -0.2e-3 * i), simulation=replace(one.simulation, duration=1.5 - 0.3 * i))
        for i, one in enumerate(scenes)
    ]
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


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
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


@pytest.mark.parametrize("method", ["virtual_master", "cell_states", "viscous"])
def test_noisy_runs_whose_sets_are_far_apart_come_to_what_they_come_to_alone(method: str) -> None:
    lengths = ("7e-3", "10e-3", "14e-3")
    one_by_one = (
        noisy("tap", f"control.method={method}", f"fingertip.length={length}")[i]
        for i, length in enumerate(lengths)
    )
    scenes = [moved(one, 8e-3 * (i - 1), -0.2e-3 * i) for i, one in enumerate(one_by_one)]
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


def test_the_papers_session_with_noise_is_that_session() -> None:
    scenes = noisy("ridge_mound_valley", "simulation.duration=6")
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)


def test_runs_that_start_from_a_shape_come_to_what_they_come_to_alone() -> None:
    known = sample("dome_peaked", "layout.rows=15", "layout.columns=15", "simulation.duration=3.2")
    scenes = [moved(known, 0.7e-3 * i, -0.5e-3 * i) for i in range(2)]
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)
