"""A cell that meets or leaves the finger within a step, against its equation integrated by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.closed_form import crossed
from scipy.integrate import solve_ivp


def integrated(exponent: float, slip: float, decay: float, pulp: float) -> tuple[float, float]:
    """Return ``e(1) - e(0) - slip`` and the mean of ``max(exp(e) - 1, 0)``."""

    def rhs(_: float, y: np.ndarray) -> list[float]:
        return [slip - decay * max(np.exp(y[0]) - pulp, 0.0), max(np.expm1(y[0]), 0.0)]

    done = solve_ivp(rhs, (0.0, 1.0), [exponent, 0.0], "DOP853", rtol=1e-10, atol=1e-12, max_step=5e-3)
    assert done.success
    return done.y[0, -1] - exponent - slip, done.y[1, -1]


@pytest.mark.parametrize(
    ("exponent", "slip", "decay", "pulp"),
    [
        (0.2, 1.5, 0.8, 2.0),  # meets the finger
        (-0.5, 3.0, 2.0, 1.0),  # meets it from a gap
        (1.5, -2.5, 0.8, 2.0),  # leaves it
        (0.8, -3.0, 1.5, 1.3),  # leaves it for a gap
    ],
    ids=["meets", "meets from a gap", "leaves", "leaves for a gap"],
)
def test_a_cell_that_meets_or_leaves_the_finger_goes_where_its_equation_says(
    exponent: float, slip: float, decay: float, pulp: float
) -> None:
    found = crossed(*(np.array([value]) for value in (exponent, 0.0, slip, decay, pulp)))
    # The kinks cost SciPy some digits: 5e-3 squared, times its steps' share.
    expected = integrated(exponent, slip, decay, pulp)
    np.testing.assert_allclose(np.ravel(found), expected, rtol=2e-6, atol=2e-6)
