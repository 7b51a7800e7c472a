"""Runs with sensors, or with a shape at the start, come to in a stack what they come to alone."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from digiclay.core.batch.packing import find_reason

from tests.assemble import sample
from tests.scenes.test_run_together import assert_as_alone, moved, together


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


def test_noisy_sensors_keep_a_scene_out_of_stacks() -> None:
    reasons = {find_reason(sample("tap", f"sensors.{one}_noise=1e-6")) for one in ("force", "height")}
    assert reasons == {"what noisy sensors make of a cell depends on which cells take part"}


def test_runs_that_start_from_a_shape_come_to_what_they_come_to_alone() -> None:
    known = sample("dome_peaked", "layout.rows=15", "layout.columns=15", "simulation.duration=3.2")
    scenes = [moved(known, 0.7e-3 * i, -0.5e-3 * i) for i in range(2)]
    for found, one in zip(together(scenes), scenes, strict=True):
        assert_as_alone(found, one)
