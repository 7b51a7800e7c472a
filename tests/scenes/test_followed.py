"""Who is followed over whole sessions: a finger that lifts, leaves, comes back, and noise that is none."""

from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.control.methods import METHODS
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.run_scene import run

from tests.assemble import followed, refused_in_a_line

BOTH = ("virtual_master", "cell_states")
ARRANGEMENTS = ("aligned", "staggered", "hexagonal")
RESTING = {int(Mode.REST), int(Mode.HOLD)}


def lasting(scene):
    system = assemble(scene)
    state = begin(system)
    *_, last = periods(system, scene.trajectories(), state, scene.periods)
    return last


def random_way(seed):
    """Return a short random path that presses, drags, jumps or leaves, and is gone for the last 1.05 s."""
    chance = np.random.default_rng(seed)
    times = np.sort(chance.uniform(0.05, 0.9, 5))
    places = [
        (float(t) + 0.02 * i, *chance.uniform(-24, 24, 2), chance.uniform(33, 48))
        for i, t in enumerate(times)
    ]
    return [*places, (1.02, 0, 0, 90), (2.07, 0, 0, 90)]


LIFT = [(0, 0, 0, 43), (0.8, 0, 0, 36), (1.2, 0, 0, 37), (3.2, 0, 0, 46)]


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_a_slow_lift_pulls_the_clay_up_after_the_finger(arrangement):
    # The finger ends 6 mm above the surface; the pins under it press into it from below.
    scene = followed("cell_states", LIFT, layout={"arrangement": arrangement})
    assert lasting(scene).row(0).max() > 46e-3


@pytest.mark.parametrize("method", BOTH)
def test_a_finger_that_leaves_at_once_leaves_the_clay_where_it_was_and_is_counted_as_lost(method):
    last = lasting(followed(method, [*LIFT, (3.3, 0, 0, 90), (4.4, 0, 0, 90)]))
    # Pins stood 1.5 mm into the finger; they follow it for some 30 ms, then rise for the loss time
    # of 50 ms, at 24 mm/s at the most: 3.5 mm above the finger's last place, and 1 mm for the
    # servo's lag.
    assert 46e-3 < last.row(0).max() < 46e-3 + 4.5e-3
    assert last.memory.losses == 1


@pytest.mark.parametrize("method", BOTH)
def test_a_finger_that_comes_back_elsewhere_is_found_again(method):
    back = [(3.3, 0, 0, 90), (3.6, 12, 12, 60), (4.2, 12, 12, 36), (4.4, 12, 12, 36)]
    assert Mode.FORCE_FOLLOW in lasting(followed(method, [*LIFT, *back])).mode()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_sticks_in_a_mode_a_second_after_the_finger_has_left(method):
    # A failing session is named by its seed. The display goes to a low shape, all rows at once: its
    # refresh would take longer than the way.
    low = {"refresh": "approximate_gradual", "surfaces": 1, "amplitude": 3e-3}
    control = {"method": method, **(low if method == "shape_display" else {})}
    stuck = {}
    for seed in range(6 if method in BOTH else 3):
        bed = {"arrangement": ARRANGEMENTS[seed % 3]}
        between = {"interpolation": ("smooth", "linear")[seed % 2]}
        scene = followed(method, random_way(seed), layout=bed, trajectory=between, control=control)
        last = lasting(scene)
        modes = set(last.mode().tolist())
        if not modes <= RESTING or not np.isfinite(last.row(0)).all():
            stuck[seed] = sorted(modes - RESTING)
    assert stuck == {}


#: Press, lift a blister, drag it level, let go, and hang beside the ridge without touching it.
WAY = [
    (0.0, -9, 0, 43), (0.7, -9, 0, 36), (1.0, -9, 0, 36), (2.2, -9, 0, 42), (2.4, -9, 0, 42),
    (4.0, 9, 0, 42), (4.1, 9, 0, 42), (4.3, 9, 0, 62), (4.5, 0, 15, 62), (4.7, 0, 15, 43), (5.0, 0, 15, 43),
]  # fmt: skip
PRESS = [(0.0, 0, 0, 43), (0.4, 0, 0, 38.5), (0.6, 0, 0, 38.5), (0.8, 0, 0, 46), (1.0, 0, 0, 46)]


@cache
def session(method, noise):
    return run(followed(method, WAY, sensors={"force_noise": noise * 1e-3}))


@pytest.mark.parametrize("noise", [0, 5])
@pytest.mark.parametrize("method", BOTH)
def test_the_finger_is_lost_at_lift_off_alone_whatever_the_noise(method, noise):
    assert session(method, noise).metrics["losses"] == 1


def test_noise_does_not_bias_the_force_that_is_held_and_is_no_finger_over_the_bed_or_on_a_pin():
    quiet, noisy = (session("virtual_master", noise) for noise in (0, 5))
    # Force that only what is above the floor adds up to is 40 mN off at 5 mN of noise.
    assert noisy.metrics["rfd"] == pytest.approx(quiet.metrics["rfd"], abs=5e-3)
    assert not np.isin(noisy.history["mode"][-60:], (Mode.SPRING, Mode.FORCE_FOLLOW)).any()
    above = [(0.0, 0, 0, 46), (1.0, 0, 0, 46)]
    history = run(followed("push_pull", above, 7, sensors={"height_noise": 50e-6})).history
    assert not (history["mode"] == Mode.FORCE_FOLLOW).any()


@pytest.mark.parametrize("method", ["elastic", "plastic", "viscous", "force_display"])
def test_noise_is_no_touch(method):
    history = run(followed(method, PRESS, 11, sensors={"force_noise": 4e-3})).history
    untouched = history["force"].max(axis=0) == 0.0
    touched_modes = (Mode.SPRING, Mode.FORCE_FOLLOW)
    assert not np.isin(history["mode"][:, untouched], touched_modes).any()


@pytest.mark.parametrize(
    "method, noise",
    [("virtual_master", 21.0), ("cell_states", 8.1), ("plastic", 6.1), ("force_display", 10.1)],
)
def test_noise_that_hides_what_is_asked_for_is_refused_in_one_line(method, noise):
    said = r"^sensors\.force_noise must .*control\.\w+ = [\d.]+ N"
    with refused_in_a_line(ParameterError, said):
        run(followed(method, WAY, sensors={"force_noise": noise * 1e-3}))
