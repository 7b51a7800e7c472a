"""Method II over whole sessions: it forms, it loses and finds the finger, and it comes to rest."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.state import State
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene

from tests.assemble import followed

METHODS = ("virtual_master", "cell_states")
RESTING = {int(Mode.REST), int(Mode.HOLD)}
Way = list[tuple[float, ...]]


def lasting(scene: Scene) -> State:
    """Run a scene to its end and return the last state."""
    system = assemble(scene)
    state = begin(system)
    *_, last = periods(system, scene.trajectories(), state, scene.periods)
    return last


def random_way(seed: int) -> Way:
    """Return a short random path that presses, drags, jumps or leaves, and is gone for the last 1.05 s."""
    chance = np.random.default_rng(seed)
    times = np.sort(chance.uniform(0.05, 0.9, 5))
    places = [
        (float(t) + 0.02 * i, *chance.uniform(-24, 24, 2), chance.uniform(33, 48))
        for i, t in enumerate(times)
    ]
    return [*places, (1.02, 0, 0, 90), (2.07, 0, 0, 90)]


LIFT = [(0, 0, 0, 43), (0.8, 0, 0, 36), (1.2, 0, 0, 37), (3.2, 0, 0, 46)]


@pytest.mark.parametrize(
    ("method", "arrangement"),
    [
        ("virtual_master", "aligned"),
        *(("cell_states", name) for name in ("aligned", "staggered", "hexagonal")),
    ],
)
def test_a_slow_lift_pulls_the_clay_up_after_the_finger(method: str, arrangement: str) -> None:
    # The finger ends 6 mm above the surface; the pins under it press into it from below.
    assert lasting(followed(method, LIFT, layout={"arrangement": arrangement})).row(0).max() > 46e-3


@pytest.mark.parametrize("method", METHODS)
def test_a_finger_that_leaves_at_once_leaves_the_clay_where_it_was_and_is_counted_as_lost(method):
    last = lasting(followed(method, [*LIFT, (3.3, 0, 0, 90), (4.4, 0, 0, 90)]))
    # Pins stood 1.5 mm into the finger; they follow it for some 30 ms, then rise for the loss time of
    # 50 ms, at 24 mm/s at the most: 3.5 mm above the finger's last place, and 1 mm for the servo's lag.
    assert 46e-3 < last.row(0).max() < 46e-3 + 4.5e-3
    assert last.memory.losses == 1


@pytest.mark.parametrize("method", METHODS)
def test_a_finger_that_comes_back_elsewhere_is_found_again(method: str) -> None:
    back = [(3.3, 0, 0, 90), (3.6, 12, 12, 60), (4.2, 12, 12, 36), (4.4, 12, 12, 36)]
    assert Mode.FORCE_FOLLOW in lasting(followed(method, [*LIFT, *back])).mode()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_sticks_in_a_mode_a_second_after_the_finger_has_left(method: str) -> None:
    # 12 random sessions a method; a failing one is named by its seed.
    stuck = {}
    for seed in range(12):
        between = {"interpolation": ("smooth", "linear")[seed % 2]}
        last = lasting(followed(method, random_way(seed), trajectory=between))
        modes = set(last.mode().tolist())
        if not modes <= RESTING:
            stuck[seed] = sorted(modes - RESTING)
    assert stuck == {}
