"""What `benchmark stiff` takes for wrong, and what its reference is worth."""

import math
import warnings

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError

from benchmarks import stiff
from benchmarks.stiff import EASY


@pytest.mark.parametrize(
    "height, force, message",
    [
        ([0.0, 0.1], [0.0, 1.0], ""),
        ([-1e-9, 0.1], [0.0, 0.0], "height outside the stroke"),
        ([0.0, 0.1001], [0.0, 0.0], "height outside the stroke"),
        ([0.0, 0.1], [0.0, -1e-9], "negative force"),
        ([np.nan, 0.1], [0.0, 0.0], "not finite"),
        ([0.0, 0.1], [0.0, np.inf], "not finite"),
    ],
)
def test_every_broken_invariant_is_seen(height, force, message):
    assert stiff.allowed_range(np.array(height), np.array(force), 0.1) == message


@pytest.mark.parametrize(
    "error, estimate, silent",
    [(2.0, 0.2, True), (2.0, 1.1, False), (2.0, math.nan, True), (1e-5, math.nan, False)],
)
def test_a_run_is_silent_when_it_is_wrong_and_its_estimate_does_not_show_it(
    error, estimate, *, silent
):
    assert stiff.Outcome(error * stiff.WRONG, estimate * stiff.WRONG).silent is silent


def test_strict_makes_errors_of_warnings_and_the_reference_agrees_with_another_stepper():
    with pytest.raises(UserWarning, match="careful"), stiff.strict():
        warnings.warn("careful", stacklevel=1)
    with pytest.raises(FloatingPointError), stiff.strict():
        np.exp(np.array([1e4]))
    # Runge-Kutta at 0.2 ms, order 4 but for the kinks: 10 nm.
    other = stiff.replayed(EASY, "runge_kutta_4", 2e-4, stiff.PERIOD)
    assert np.abs(other - stiff.reference(EASY)[0]).max() < 1e-8


def test_a_divergence_is_shown_by_quantity_value_and_time(monkeypatch):
    def diverged(*_):
        raise DivergenceError(0.25, 3, "height", math.nan, "Use a shorter step.")

    monkeypatch.setattr(stiff, "replayed", diverged)
    outcome = stiff.outcome(EASY, np.zeros((1, 25)), "euler", 1e-3)
    assert outcome.cell == "height nan at 0.25 s"
