"""The valve's first-order lag (equation 9): exact while the command is held."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.model.delay import Delay, Queue, split_delay
from digiclay.core.model.lag import SHUT, ValveLag
from digiclay.core.model.null_parts import InstantValve

START, COMMAND = np.array([0.0, 1.0, -0.7, 0.3]), np.array([1.0, -1.0, 0.2, 0.3])
NEXT = np.array([-1.0, 0.5, 0.5, -0.3])


def after(start: np.ndarray, command: np.ndarray, time: float) -> np.ndarray:
    """Return the analytic opening after a step of the command, for τ_v = 2 ms."""
    return command + (start - command) * math.exp(-time / 2e-3)


@pytest.mark.parametrize("time", [0.0, 1e-5, 1e-3, 0.3])
def test_the_opening_is_the_analytic_exponential_at_any_time(time: float) -> None:
    opening = ValveLag().response(Queue(), [time]) @ np.array([START, COMMAND])
    assert opening[0] == pytest.approx(after(START, COMMAND, time), abs=1e-15)  # rounding


@pytest.mark.parametrize("time", [0.2e-3, 1.3e-3, 1.4e-3, 5e-3])
def test_the_opening_goes_over_to_the_next_command_at_the_cut(time: float) -> None:
    waiting = split_delay(Delay(1.3e-3), 5e-3)
    opening = ValveLag().response(waiting, [time]) @ np.array([START, COMMAND, NEXT])
    expected = after(START, COMMAND, min(time, 1.3e-3))
    if time > 1.3e-3:
        expected = after(expected, NEXT, time - 1.3e-3)
    assert opening[0] == pytest.approx(expected, abs=1e-15)  # rounding


def test_commands_that_are_not_due_yet_do_not_matter() -> None:
    response = ValveLag().response(split_delay(Delay(11.3e-3), 5e-3), [0.0, 2e-3, 5e-3])
    assert not response[:, 3:].any()


def test_a_valve_at_its_command_stays_there() -> None:
    # What is in one opening or command out of three comes out again: each row adds up to 1.
    response = ValveLag().response(split_delay(Delay(1e-3), 5e-3), [0.0, 0.5e-3, 1e-3, 3e-3])
    assert response.sum(axis=1) == pytest.approx(1.0, abs=1e-15)


def test_the_rate_is_the_derivative_of_the_exact_opening() -> None:
    moved = ValveLag().response(Queue(), [1e-9]) @ np.array([START, COMMAND])
    # A difference over 1 ns: truncation 1e-9/τ_v, 5e-7; rounding 1e-16/1e-9 against rates of 500 1/s.
    rate = ValveLag().rate(START[None], COMMAND)
    assert (moved - START) / 1e-9 == pytest.approx(rate, rel=1e-5, abs=1e-5)


def test_a_valve_that_is_almost_shut_is_shut() -> None:
    own = np.array([[0.9 * SHUT, -0.9 * SHUT, 1.1 * SHUT, -1.1 * SHUT]])
    ValveLag().settle(own)
    assert own[0].astype(bool).tolist() == [False, False, True, True]


def test_what_counts_as_shut_lets_nothing_noticeable_through() -> None:
    # Flow goes with the square of the opening: in a session, less than the width of an atom's nucleus.
    assert 24e-3 * SHUT**2 * 26.0 < 1e-15


def test_without_lag_the_opening_is_the_command() -> None:
    assert InstantValve().opening(np.empty((0, 4)), COMMAND) is COMMAND


def test_without_lag_the_opening_jumps_at_the_cut() -> None:
    waiting = split_delay(Delay(1.3e-3), 5e-3)
    openings = InstantValve().response(waiting, [1.29e-3, 1.31e-3]) @ np.array([COMMAND, NEXT])
    assert np.array_equal(openings, [COMMAND, NEXT])
