"""What the metrics take of a history, on a bed of two cells."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.metrics_trace import trace_of
from digiclay.core.modes import Mode

#: Two rows of two cells, at (1, 2) and (4, 6) mm.
HISTORY = {
    "height": np.array([[50e-3, 52e-3], [51e-3, 53e-3]]),
    "force": np.array([[0.0, 0.0], [0.3, 0.1]]),
    "mode": np.array([[Mode.REST, Mode.SPRING], [Mode.FORCE_FOLLOW, Mode.REST]]),
    "total_force": np.array([0.0, 0.4]),
    "position": np.array([[1e-3, 2e-3], [4e-3, 6e-3]]),
}
TRACE = trace_of(HISTORY)


def test_a_trace_has_the_moments_of_the_forces_about_both_axes() -> None:
    # 0.3 N at 1 mm and 0.1 N at 4 mm; 0.3 N at 2 mm and 0.1 N at 6 mm.
    assert [TRACE.x[1], TRACE.y[1]] == pytest.approx([0.7e-3, 1.2e-3], rel=1e-12)  # rounding


def test_a_trace_has_the_sum_of_force_times_height() -> None:
    assert TRACE.height == pytest.approx([0.0, 0.3 * 51e-3 + 0.1 * 53e-3], rel=1e-12)  # rounding


def test_a_trace_has_the_strongest_force_of_each_row() -> None:
    np.testing.assert_array_equal(TRACE.strongest, [0.0, 0.3])


def test_a_trace_counts_the_cells_that_follow_the_force() -> None:
    np.testing.assert_array_equal(TRACE.following, [0, 1])


def test_a_trace_has_the_first_and_the_last_heights() -> None:
    np.testing.assert_array_equal([TRACE.first, TRACE.last], [[50e-3, 52e-3], [51e-3, 53e-3]])
