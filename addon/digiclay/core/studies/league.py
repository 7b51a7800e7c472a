"""League of control methods: confidence intervals over seeds of the noise, and one row a method.

An interval is Student's t for the mean over the seeds, of which each has the same trajectories. It states
what other noise would do, and nothing about other trajectories.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median, stdev

from ..metrics.metric_table import METHOD, METRICS, Metric
from .method_trials import LIMITS, RANDOM

#: Of the intervals, and how they are named.
CONFIDENCE = 0.95
KIND = f"{CONFIDENCE:.0%} interval of the mean, Student's t over the seeds"
#: Measures of a league, which are means over the trajectories.
MEANS = (
    "rfd", "rfd_jnd_least", "rfd_jnd_most", "lag_mean", "ridge_unevenness", "ridge_unevenness_touch",
    "relief_rms", "contact_loss_share",
)  # fmt: skip
#: Measures of a league, in the order of its columns; those of `LIMITS` are speeds.
MEASURES: dict[str, Metric] = {
    name: METHOD.get(name) or METRICS.get(name) or Metric("m/s", "", name.replace("-", " "), "mm/s")
    for name in (
        "rfd", "rfd_jnd_least", "rfd_jnd_most", "lag_mean", "ridge_unevenness", "ridge_unevenness_touch",
        "relief_rms", "max_total_force", "losses", "contact_loss_share", *LIMITS, "period_cost", "cost_ratio",
    )
}  # fmt: skip

#: Method, trajectory and seed of a trial.
Cell = tuple[str, str, int]
#: Measured values by trial; None where there is none.
Table = Mapping[Cell, Mapping[str, float | None]]


@dataclass(frozen=True)
class Interval:
    """Mean and its confidence interval.

    Attributes
    ----------
    half : float or None
        Half the width; None of a single value.
    count : int
        Values.
    """

    mean: float
    half: float | None
    count: int


@dataclass(frozen=True)
class Row:
    """Row of the league.

    Attributes
    ----------
    measures : mapping of str to Interval or None
        `MEANS`, ``max_total_force``, ``losses``, ``period_cost``, ``cost_ratio`` and a limit a motion.
    worse : int or None
        On how many trajectories the mean RFD is above that of the first method; None of that one.
    trajectories : int
        With an RFD.
    searched : frozenset of str
        Motions whose largest speed was searched.
    """

    method: str
    measures: Mapping[str, Interval | None]
    worse: int | None
    trajectories: int
    searched: frozenset[str] = frozenset()


def find_interval(values: Sequence[float | None]) -> Interval | None:
    """Return the mean of values and its interval; None without values.

    ``half = t(0.975, n - 1) s / sqrt(n)`` with the standard deviation s.

    `values`: none and values that are not finite are left out.
    """
    known = [value for value in values if value is not None and math.isfinite(value)]
    if not known:
        return None
    if len(known) == 1:
        return Interval(known[0], None, 1)
    from scipy.stats import t

    width = float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(known) - 1)) / math.sqrt(len(known))
    return Interval(fmean(known), width * stdev(known), len(known))


def find_league(table: Table, methods: Sequence[str]) -> list[Row]:
    """Return a row a method, the smallest mean RFD first; methods without one are last.

    `methods`: the first is the one that the others are compared with.
    """
    seeds = sorted({seed for _, _, seed in table})
    worse = count_worse(table, methods)
    rows = []
    for method in methods:
        own = {cell: found for cell, found in table.items() if cell[0] == method}
        measures = {name: find_interval([_mean(own, name, seed) for seed in seeds]) for name in MEANS}
        measures["max_total_force"] = find_interval([_largest(own, seed) for seed in seeds])
        measures["losses"] = find_interval([_sum(own, seed) for seed in seeds])
        measures["period_cost"] = find_interval([_cost(own, seed) for seed in seeds])
        first = {cell: found for cell, found in table.items() if cell[0] == methods[0]}
        measures["cost_ratio"] = find_interval(
            [_divide(_cost(own, seed), _cost(first, seed)) for seed in seeds]
        )
        for limit in LIMITS:
            measures[limit] = find_interval(
                [own.get((method, limit, seed), {}).get("speed_limit") for seed in seeds]
            )
        searched = frozenset(name for _, name, _ in own if name in LIMITS)
        rows.append(Row(method, measures, *worse[method], searched))
    order = {method: number for number, method in enumerate(methods)}
    return sorted(rows, key=lambda row: (_rank(row.measures["rfd"]), order[row.method]))


def count_worse(table: Table, methods: Sequence[str]) -> dict[str, tuple[int | None, int]]:
    """Return on how many trajectories, of how many, a method has a greater mean RFD than the first one."""
    means = {method: _means_by_trajectory(table, method) for method in methods}
    first = means[methods[0]]
    counted: dict[str, tuple[int | None, int]] = {methods[0]: (None, len(first))}
    for method in methods[1:]:
        both = means[method].keys() & first.keys()
        counted[method] = (sum(means[method][name] > first[name] for name in both), len(both))
    return counted


def _means_by_trajectory(table: Table, method: str) -> dict[str, float]:
    """Return the RFD of each trajectory, the mean over the seeds, N."""
    found: dict[str, list[float]] = {}
    for (own, name, _), figures in table.items():
        value = figures.get("rfd")
        if own == method and value is not None:
            found.setdefault(name, []).append(value)
    return {name: fmean(values) for name, values in found.items()}


def _mean(own: Table, name: str, seed: int) -> float | None:
    """Return the mean over the trajectories of a seed; the random drags together count as one."""
    groups: dict[str, list[float]] = {}
    for (_, trajectory, number), figures in own.items():
        value = figures.get(name)
        if number == seed and value is not None and math.isfinite(value):
            group = RANDOM if trajectory.startswith(f"{RANDOM}-") else trajectory
            groups.setdefault(group, []).append(value)
    return fmean(map(fmean, groups.values())) if groups else None


def _largest(own: Table, seed: int) -> float | None:
    """Return the largest total force of all trajectories of a seed, N."""
    values = [found.get("max_total_force") for (_, _, number), found in own.items() if number == seed]
    return max((value for value in values if value is not None), default=None)


def _sum(own: Table, seed: int) -> float | None:
    """Return the number of losses on all trajectories of a seed; None where the method does not count."""
    values = [found.get("losses") for (_, _, number), found in own.items() if number == seed]
    known = [value for value in values if value is not None]
    return float(sum(known)) if known else None


def _cost(own: Table, seed: int) -> float | None:
    """Return the processor time of a control period, the median over the trajectories of a seed, s."""
    values = [found.get("period_cost") for (_, _, number), found in own.items() if number == seed]
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _divide(one: float | None, other: float | None) -> float | None:
    return None if one is None or not other else one / other


def _rank(found: Interval | None) -> float:
    return math.inf if found is None else found.mean
