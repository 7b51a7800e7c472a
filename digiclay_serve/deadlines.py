"""Deadlines of control periods in real time: the rule for late ones, and the distribution of their times."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Rounding errors of times count as whole periods when they are below this share of one.
SLACK = 1e-6
#: Shares of the periods whose times are given.
SHARES = (0.5, 0.99, 0.999)


@dataclass(frozen=True)
class Schedule:
    """Beginning and deadline of every control period.

    Period k begins at `start` + k `period`, and its deadline is the beginning of the next one.

    Attributes
    ----------
    start : float
        By a clock that never goes back, s.
    period : float
        s.
    most : int
        Most periods simulated at a time; what is late beyond them is left out.
    planned : int
        Periods that were simulated or left out.
    left_out : int
        Periods that were left out.
    """

    start: float
    period: float
    most: int
    planned: int = 0
    left_out: int = 0

    @property
    def begins(self) -> float:
        """When the next period begins, s."""
        return self.start + self.planned * self.period


@dataclass(frozen=True)
class Due:
    """Periods that have begun: how many to simulate, and when each of them began, those left out first, s."""

    count: int
    begins: NDArray[np.float64]


def plan_periods(schedule: Schedule, now: float) -> tuple[Due, Schedule]:
    """Return the periods that have begun by now, and the schedule after them. `now`, s."""
    begun = math.floor((now - schedule.start) / schedule.period + SLACK) + 1
    late = max(0, begun - schedule.planned)
    count = min(late, schedule.most)
    begins = schedule.start + schedule.period * np.arange(schedule.planned, schedule.planned + late)
    left_out = schedule.left_out + late - count
    return Due(count, begins), replace(schedule, planned=schedule.planned + late, left_out=left_out)


@dataclass(frozen=True, eq=False)
class TimeCounts:
    """Histogram of times.

    Attributes
    ----------
    width : float
        Of a bin, s.
    bins : ndarray of int (k,)
        Counted in place; the last one has all longer times.
    longest : ndarray (1,)
        s.
    """

    width: float
    bins: NDArray[np.int64] = field(default_factory=lambda: np.zeros(20_001, np.int64))
    longest: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1))

    def count(self, time: float) -> None:
        """Count a time, s."""
        self.bins[min(int(time / self.width), len(self.bins) - 1)] += 1
        self.longest[0] = max(self.longest[0], time)

    def count_above(self, time: float) -> int:
        """Return how many times exceed a limit, by whole bins. `time`, s."""
        return int(self.bins[round(time / self.width) :].sum())

    def find_share(self, share: float) -> float:
        """Return the time that a share of the times does not exceed, by whole bins, s; 0 without any."""
        total = int(self.bins.sum())
        if not total:
            return 0.0
        index = int(np.searchsorted(np.cumsum(self.bins), math.ceil(share * total)))
        # Nothing is known of the times in the last bin but the longest.
        last = index >= len(self.bins) - 1
        return float(self.longest[0]) if last else min((index + 1) * self.width, float(self.longest[0]))

    def describe(self) -> dict[str, Any]:
        """Return the figures for a report: shares and longest, s; and the bins that hold something."""
        shares = {f"p{100 * share:g}": self.find_share(share) for share in SHARES}
        filled = np.flatnonzero(self.bins)
        table = [[round(float(index) * self.width, 9), int(self.bins[index])] for index in filled]
        return {**shares, "longest": float(self.longest[0]), "bin": self.width, "bins": table}
