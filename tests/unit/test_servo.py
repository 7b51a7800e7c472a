"""Proportional control of a cell's height."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.control.servo import Tracking, lock_overloaded

#: What the high reservoir can lift: 0.5 bar on a bore of 2 mm.
LIFT = 0.157


def commands(error: list[float]) -> list[float]:
    """Return the commands for height errors in mm."""
    return Tracking().command(50e-3 + np.array(error) * 1e-3, np.full(len(error), 50e-3)).tolist()


def test_the_command_is_the_gain_times_the_error() -> None:
    assert commands([1.0, -0.5]) == pytest.approx([0.5, -0.25], rel=1e-12)  # rounding of the difference


def test_the_command_is_limited_to_a_fully_open_valve() -> None:
    assert commands([10.0, -10.0]) == [1.0, -1.0]


def test_an_error_within_the_dead_band_is_left_alone() -> None:
    assert commands([0.0099, -0.0099, 0.0]) == [0.0, 0.0, 0.0]


def test_an_error_just_beyond_the_dead_band_is_not() -> None:
    assert np.sign(commands([0.0101, -0.0101])).tolist() == [1.0, -1.0]


def test_an_overloaded_cell_is_locked_instead_of_raised() -> None:
    locked = lock_overloaded(np.array([0.5, 0.5]), np.array([0.16, 0.15]), LIFT)
    assert locked.tolist() == [0.0, 0.5]


def test_an_overloaded_cell_may_be_lowered() -> None:
    assert lock_overloaded(np.array([-0.5]), np.array([1.0]), LIFT).tolist() == [-0.5]


def test_without_any_cell_there_is_nothing_to_lock() -> None:
    assert lock_overloaded(np.empty(0), np.empty(0), LIFT).size == 0


def test_without_gain_nothing_moves() -> None:
    assert Tracking(position_gain=0.0).command(np.ones(3), np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
