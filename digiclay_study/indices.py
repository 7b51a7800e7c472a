"""Sobol indices of an output: shares of its variance by parameter, with confidence intervals, by SALib."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from digiclay.core.base.arrays import Floats

from .sampling import describe_problem

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
    """Return the Sobol indices of an output at the points of `sampling.sample_shares`.

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
