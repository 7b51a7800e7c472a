"""League of control methods: confidence intervals over seeds of the noise, and one row per method.

An interval is Student's t for the mean over the seeds, of which each has the same trajectories. It
states what other noise would do, and nothing about other trajectories.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from statistics import fmean, median, stdev
from typing import NamedTuple

from digiclay.core.metrics.metric_table import ERRORS, METHOD, METRICS, Metric

from .method_trials import LIMITS, RANDOM

#: Of the intervals, and how they are named.
CONFIDENCE = 0.95
KIND = f"{CONFIDENCE:.0%} interval of the mean, Student's t over the seeds"
#: Measures of a league, in the order of its columns; those of `LIMITS` are speeds.
MEASURES: dict[str, Metric] = {
    name: {**METRICS, **METHOD, **ERRORS}.get(name)
    or METHOD["speed_limit"]._replace(label=name.replace("-", " "))
    for name in (
        "rfd",
        "rfd_jnd_least",
        "rfd_jnd_most",
        "lag_mean",
        "ridge_unevenness",
        "ridge_unevenness_touch",
        "relief_rms",
        "max_total_force",
        "losses",
        "contact_loss_share",
        *LIMITS,
        "period_cost",
        "cost_ratio",
        *ERRORS,
    )
}
#: Measures that are no means over the trajectories: the largest, the number, and the usual one.
REDUCED: dict[str, Callable[[list[float]], float]] = {
    "max_total_force": max,
    "losses": sum,
    "period_cost": median,
    **dict.fromkeys(ERRORS, max),
}

#: Method, trajectory and seed of a trial.
Cell = tuple[str, str, int]
#: Measured values by trial; None where there is none.
Table = Mapping[Cell, Mapping[str, float | None]]


class Interval(NamedTuple):
    """Mean of some values, half the width of its confidence interval, and their number."""

    mean: float
    #: None of a single one.
    half: float | None
    number: int


class Row(NamedTuple):
    """Row of the league."""

    method: str
    #: By name in `MEASURES`.
    measures: Mapping[str, Interval | None]
    #: On how many trajectories the mean RFD is above that of the first method; None of that one.
    worse: int | None
    #: With an RFD.
    trajectories: int
    #: Motions whose largest speed was searched.
    searched: frozenset[str] = frozenset()


def find_interval(values: Sequence[float | None]) -> Interval | None:
    """Return the mean of the finite values and half = t(0.975, n - 1) s / sqrt(n); None without values."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    if not finite:
        return None
    if len(finite) == 1:
        return Interval(finite[0], None, 1)
    from scipy.stats import t

    width = float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(finite) - 1)) / math.sqrt(len(finite))
    return Interval(fmean(finite), width * stdev(finite), len(finite))


def find_trajectories(table: Table) -> list[str]:
    """Return the trajectories of all trials."""
    return list(dict.fromkeys(name for _, name, _ in table))


def list_values(table: Table, method: str, trajectory: str, measure: str) -> list[float]:
    """Return a measure of a method on a trajectory, one value per seed that has one."""
    trials = (
        figures
        for (other, name, _), figures in table.items()
        if (other, name) == (method, trajectory)
    )
    return [value for figures in trials if (value := figures.get(measure)) is not None]


def find_league(table: Table, methods: Sequence[str]) -> list[Row]:
    """Return one row per method, the smallest mean RFD first; all are compared with the first method."""
    seeds = sorted({seed for _, _, seed in table})
    rows = []
    for method in methods:
        measures = {
            name: find_interval([_reduce(table, method, name, seed) for seed in seeds])
            for name in MEASURES
        }
        costs = [
            [_reduce(table, each, "period_cost", seed) for each in (method, methods[0])]
            for seed in seeds
        ]
        measures["cost_ratio"] = find_interval(
            [cost / first for cost, first in costs if cost and first]
        )
        for limit in LIMITS:
            measures[limit] = find_interval(list_values(table, method, limit, "speed_limit"))
        searched = frozenset(name for other, name, _ in table if other == method and name in LIMITS)
        worse, compared = count_worse(table, method, methods[0])
        rows.append(
            Row(method, measures, None if method == methods[0] else worse, compared, searched)
        )
    return sorted(
        rows, key=lambda row: math.inf if row.measures["rfd"] is None else row.measures["rfd"].mean
    )


def count_worse(table: Table, method: str, first: str) -> tuple[int, int]:
    """Return on how many trajectories, of how many, a method has a greater mean RFD than the first one."""
    pairs = [
        [list_values(table, each, name, "rfd") for each in (method, first)]
        for name in find_trajectories(table)
    ]
    both = [pair for pair in pairs if all(pair)]
    return sum(fmean(values) > fmean(others) for values, others in both), len(both)


def _reduce(table: Table, method: str, name: str, seed: int) -> float | None:
    """Return a measure over all trajectories of a seed: as `REDUCED` has it, or the mean."""
    groups: dict[str, list[float]] = {}
    for (tried, trajectory, number), figures in table.items():
        value = figures.get(name)
        if (tried, number) == (method, seed) and value is not None and math.isfinite(value):
            # The random drags together count as one trajectory of a mean.
            random = trajectory.startswith(f"{RANDOM}-")
            groups.setdefault(RANDOM if random else trajectory, []).append(value)
    if not groups:
        return None
    if name in REDUCED:
        return float(REDUCED[name]([value for values in groups.values() for value in values]))
    return fmean(map(fmean, groups.values()))
