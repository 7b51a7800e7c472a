"""A stepper that throws pins beyond their stops says so; the closed-form one goes on."""

from __future__ import annotations

import pytest
from digiclay.core.base.errors import DivergenceError
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run


def coarse(stepper: str) -> Scene:
    """Return the slow press under control of 20 Hz, in steps as long: 20 times the finger's time constant."""
    settings = [
        Setting("simulation.stepper", f'"{stepper}"'),
        Setting("simulation.control_period", "50e-3"),
        Setting("simulation.physics_step", "50e-3"),
        Setting("simulation.duration", "2.0"),
    ]
    return load(find("slow_press"), settings)


def test_a_stepper_that_throws_a_pin_beyond_its_stops_says_when_and_which() -> None:
    with pytest.raises(
        DivergenceError, match=r"^At [\d.]+ s the height of cell \d+ became inf\. Use a shorter"
    ):
        run(coarse("euler"))


def test_the_closed_form_step_goes_on() -> None:
    assert not run(coarse("bernoulli")).incomplete
