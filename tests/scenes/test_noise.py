"""Sessions under noisy sensors: who is followed, and what stays where it is."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.session.run_scene import Result, run

from tests.assemble import followed

#: Press, lift a blister, drag it level, let go, and hang beside the ridge without touching it.
WAY = [
    (0.0, -9, 0, 43), (0.7, -9, 0, 36), (1.0, -9, 0, 36), (2.2, -9, 0, 42), (2.4, -9, 0, 42),
    (4.0, 9, 0, 42), (4.1, 9, 0, 42), (4.3, 9, 0, 62), (4.5, 0, 15, 62), (4.7, 0, 15, 43), (5.0, 0, 15, 43),
]  # fmt: skip
#: A finger that presses one spot and goes.
PRESS = [(0.0, 0, 0, 43), (0.4, 0, 0, 38.5), (0.6, 0, 0, 38.5), (0.8, 0, 0, 46), (1.0, 0, 0, 46)]


@cache
def session(method: str, noise: float, seed: int = 0) -> Result:
    """Run the session under so many millinewtons of noise."""
    return run(followed(method, WAY, sensors={"force_noise": noise * 1e-3, "seed": seed}))


@pytest.mark.parametrize("noise", [0, 5])
@pytest.mark.parametrize("method", ["virtual_master", "cell_states"])
def test_the_finger_is_lost_at_lift_off_alone_whatever_the_noise(method: str, noise: int) -> None:
    assert session(method, noise).metrics["losses"] == 1


def test_noise_does_not_bias_the_force_that_is_held_and_is_no_finger_over_the_bed() -> None:
    quiet, noisy = (session("virtual_master", noise) for noise in (0, 5))
    # Force that only what is above the floor adds up to is 40 mN off at 5 mN of noise.
    assert noisy.metrics["rfd"] == pytest.approx(quiet.metrics["rfd"], abs=5e-3)
    assert not np.isin(noisy.history["mode"][-60:], (Mode.SPRING, Mode.FORCE_FOLLOW)).any()


@pytest.mark.parametrize("method", ["elastic", "plastic", "viscous", "force_display"])
def test_noise_is_no_touch(method: str) -> None:
    history = run(followed(method, PRESS, 11, sensors={"force_noise": 4e-3})).history
    untouched = history["force"].max(axis=0) == 0.0
    touched_modes = (Mode.SPRING, Mode.FORCE_FOLLOW)
    assert not np.isin(history["mode"][:, untouched], touched_modes).any()


def test_pins_that_listen_are_not_touched_by_the_noise_of_their_heights() -> None:
    above = [(0.0, 0, 0, 46), (1.0, 0, 0, 46)]
    history = run(followed("push_pull", above, 7, sensors={"height_noise": 50e-6})).history
    assert not (history["mode"] == Mode.FORCE_FOLLOW).any()


@pytest.mark.parametrize(
    ("method", "noise"),
    [("virtual_master", 21.0), ("cell_states", 8.1), ("plastic", 6.1), ("force_display", 10.1)],
)
def test_noise_that_hides_what_is_asked_for_is_refused_in_one_line(method: str, noise: float) -> None:
    with pytest.raises(ParameterError, match=r"^sensors\.force_noise must .*control\.\w+ = [\d.]+ N") as told:
        run(followed(method, WAY, sensors={"force_noise": noise * 1e-3}))
    assert "\n" not in str(told.value)
