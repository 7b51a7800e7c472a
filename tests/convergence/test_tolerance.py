"""The adaptive stepper keeps the heights within its tolerance, in every sample scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.model.valve import Fluid, Valve
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.accuracy import estimate_errors
from digiclay.core.session.run_scene import run

from tests.assemble import AWAY, one_cell, record, scripted

SCENES = ("ridge_mound_valley", "slow_press", "tap")


def scene_of(name: str, tolerance: float) -> Scene:
    """Return a sample scene of at most 1.2 s, with whole control periods as steps."""
    settings = [
        Setting("simulation.stepper", '"adaptive"'),
        Setting("simulation.physics_step", "5e-3"),
        Setting("simulation.tolerance", str(tolerance)),
    ]
    scene = load(find(name), settings)
    short = min(scene.simulation.duration, 1.2)
    return replace(scene, simulation=replace(scene.simulation, duration=short))


@pytest.mark.parametrize("tolerance", [1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("name", SCENES)
def test_the_heights_keep_within_the_tolerance(name: str, tolerance: float) -> None:
    scene = scene_of(name, tolerance)
    history = run(scene).history
    assert history is not None
    # The reference is Richardson's extrapolation at half of 1 ms. Another half changes the errors by 2e-11 m.
    exact = replace(scene, simulation=replace(scene.simulation, stepper="richardson", physics_step=1e-3))
    errors = estimate_errors(exact, history)
    assert errors is not None
    assert errors.height <= tolerance


def test_a_free_pin_keeps_within_the_tolerance_over_many_commands() -> None:
    # The errors of a pin that nothing presses add up: 60 reversals of a valve that is turbulent in between.
    script = scripted(lambda t, x, y: (1.0, -0.6, 0.8, -1.0, 0.3, -0.2)[round(t / 20e-3) % 6])
    parts = {"valve": Valve(orifice_diameter=0.8e-3), "fluid": Fluid(760.0, 0.65e-6)}
    known = {"control": script, "period": 20e-3, "dead_time": 0.0, **parts}
    exact, found = (
        record(one_cell(stepper=name, step=step, **known), AWAY, 60).height
        for name, step in (("bernoulli", 0.1e-3), ("adaptive", 20e-3))
    )
    assert np.ptp(found) > 1e-3
    assert np.abs(found - exact).max() <= one_cell(stepper="adaptive").stepper.tolerance
