"""Points of a sensitivity study: Saltelli's design over a Sobol sequence, by SALib."""

from __future__ import annotations

from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats


def describe_problem(parameters: int) -> dict[str, Any]:
    """Return SALib's description of parameters that are shares of their ranges, from 0 to 1."""
    # As an array: pandas, which SALib groups them with, takes no list.
    names = np.array([f"x{number}" for number in range(parameters)], dtype=object)
    return {"num_vars": parameters, "names": names, "bounds": [[0.0, 1.0]] * parameters}


def count_points(samples: int, parameters: int, *, second: bool) -> int:
    """Return how many points a design has.

    `samples`: of the Sobol sequence; `second`: whether second-order indices are computed.
    """
    return samples * (2 * parameters + 2 if second else parameters + 2)


def sample_shares(samples: int, parameters: int, seed: int, *, second: bool) -> Floats:
    """Return the points of Saltelli's design as shares of the ranges.

    Each sample gives a block of points: A, A with one parameter of B each, for the second order B with one
    parameter of A each, and B. A and B are halves of a scrambled Sobol point.

    `samples`: a power of two, for the balance of the Sobol sequence; `seed`: of the scrambling, at least 1;
    `second`: whether second-order indices are computed. Returns (points, parameters), in [0, 1).
    """
    from SALib.sample import sobol

    problem = describe_problem(parameters)
    shares: Floats = sobol.sample(problem, samples, calc_second_order=second, seed=seed)
    return shares
