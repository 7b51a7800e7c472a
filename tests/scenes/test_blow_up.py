"""A stepper that throws pins beyond their stops says so; the closed-form one goes on."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError
from digiclay.core.engine.simulation import find_divergence
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run

from tests.assemble import one_cell


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


@pytest.mark.parametrize(
    ("row", "called"),
    [(0, "height"), (3, "relaxation"), (4, "valve opening"), (-2, "commanded height"), (-1, "force")],
)
def test_a_quantity_that_diverges_is_called_by_its_name(row: int, called: str) -> None:
    system = one_cell()
    block = np.zeros((system.rows.count, 2))
    block[row, 1] = np.nan
    error = find_divergence(system, np.array([5, 7]), block, 3)
    assert str(error).startswith(f"At 0.015 s the {called} of cell 7 became nan.")
