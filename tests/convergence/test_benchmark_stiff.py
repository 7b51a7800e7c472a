"""The machinery of `benchmark stiff`: it sees what is wrong, and says so."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError

from benchmarks import stiff_runs as stiff
from benchmarks.stiff_runs import CASES, EASY


@pytest.mark.parametrize(
    ("height", "force", "said"),
    [
        ([0.0, 0.1], [0.0, 1.0], ""),
        ([-1e-9, 0.1], [0.0, 0.0], "height outside the stroke"),
        ([0.0, 0.1001], [0.0, 0.0], "height outside the stroke"),
        ([0.0, 0.1], [0.0, -1e-9], "negative force"),
        ([np.nan, 0.1], [0.0, 0.0], "not finite"),
        ([0.0, 0.1], [0.0, np.inf], "not finite"),
    ],
)
def test_every_broken_invariant_is_seen(height: list[float], force: list[float], said: str) -> None:
    assert stiff.allowed_range(np.array(height), np.array(force), 0.1) == said


def test_a_run_is_silent_when_it_is_wrong_and_does_not_know_it() -> None:
    wrong, known = 2.0 * stiff.WRONG, 1.1 * stiff.WRONG
    outcomes = (stiff.Outcome(wrong, 0.1 * wrong), stiff.Outcome(wrong, known), stiff.Outcome(1e-9))
    assert [one.silent for one in outcomes] == [True, False, False]


def test_a_run_without_an_estimate_counts_as_silent_when_it_is_wrong() -> None:
    assert stiff.Outcome(2.0 * stiff.WRONG, math.nan).silent


def test_strict_makes_an_error_of_a_warning() -> None:
    with pytest.raises(UserWarning, match="careful"), stiff.strict():
        warnings.warn("careful", stacklevel=1)


def test_strict_makes_an_error_of_an_overflow() -> None:
    with pytest.raises(FloatingPointError), stiff.strict():
        np.exp(np.array([1e4]))


def test_a_divergence_is_told_by_quantity_value_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    def diverged(*_: object) -> None:
        raise DivergenceError(0.25, 3, "height", math.nan, "Use a shorter step.")

    monkeypatch.setattr(stiff, "replayed", diverged)
    told = stiff.outcome(CASES[EASY], np.zeros((1, 25)), np.zeros((1, 25)), "euler", 1e-3)
    assert told.said == "height nan at 0.25 s"


def test_all_steps_play_the_same_commands() -> None:
    # Each divides the time a command is held: the problem does not change with the step.
    ratios = [stiff.HOLD / stiff.period_of(step) for step in stiff.STEPS]
    assert ratios == pytest.approx([round(ratio) for ratio in ratios], abs=1e-9)


def test_the_reference_agrees_with_another_stepper() -> None:
    # Runge-Kutta at 0.1 ms, order 4 but for the kinks: 10 nm.
    commands = stiff.commands_of(CASES[EASY])
    exact, _ = stiff.reference(CASES[EASY], commands)
    other = stiff.replayed(CASES[EASY], commands, "runge_kutta_4", 1e-4, stiff.PERIOD)
    assert np.abs(other - exact).max() < 1e-8
