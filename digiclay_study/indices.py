"""Sobol samples and indices by SALib: shares of an output's variance by parameter, with intervals."""

from __future__ import annotations

from dataclasses import dataclass
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


#: Level of the confidence intervals, and resamples of the bootstrap they come from.
CONFIDENCE, RESAMPLES = 0.95, 1000


@dataclass(frozen=True, eq=False)
class Indices:
    """Sobol indices of one output over d parameters.

    Attributes
    ----------
    first, total : ndarray (d,)
        Share of the variance by the parameter alone, and with all its interactions.
    first_interval, total_interval : ndarray (d,)
        Half widths of their confidence intervals.
    second, second_interval : ndarray (d, d)
        Share by the interaction of two parameters, above the diagonal, NaN elsewhere; all NaN if it was not
        requested.
    """

    first: Floats
    first_interval: Floats
    total: Floats
    total_interval: Floats
    second: Floats
    second_interval: Floats


def compute_indices(values: Floats, parameters: int, seed: int, *, second: bool) -> Indices | None:
    """Return the Sobol indices of an output at the points of `indices.sample_shares`.

    `values` (points,), in the order of the points; finite; `seed`: of the bootstrap, at least 1: SALib takes
    0 for none; `second`: as at the sampling. Returns none for an output that does not vary, or varies by
    rounding alone: its variance has no shares.
    """
    from SALib.analyze import sobol

    if not np.ptp(values) > 1e-9 * np.max(np.abs(values)):
        return None
    found = sobol.analyze(
        describe_problem(parameters), values, calc_second_order=second, num_resamples=RESAMPLES,
        conf_level=CONFIDENCE, seed=seed,
    )  # fmt: skip
    none = np.full((parameters, parameters), np.nan)
    return Indices(
        found["S1"], found["S1_conf"], found["ST"], found["ST_conf"],
        found["S2"] if second else none, found["S2_conf"] if second else none,
    )  # fmt: skip
