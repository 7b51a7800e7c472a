"""Session at a fixed rate: orders of the clients in, frames out, parts of a take to the disk."""

from __future__ import annotations

import gc
import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.session import snapshot
from digiclay.core.session.take import make_take
from numpy.typing import NDArray

from .doors import Doors
from .protocol import name_flags, pack_frame
from .served_session import PartWriter, Session, follow, make_frame, record, reset

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


#: Periods are made up for if they are this late at most, s; those before are left out.
CATCH_UP = 0.05
#: Width of a bin of the histograms, s.
BIN = 1e-5
#: Longest time without a look at whether to stop, s.
LOOK = 0.1
#: Time after which another thread of this process gets the interpreter, s; by default it is five periods.
SWITCH = 2e-4


@dataclass(frozen=True, eq=False)
class LoopTimes:
    """Times of control periods.

    Attributes
    ----------
    elapsed : TimeCounts
        From the beginning of a period to the frame after it, those left out included: above a period it
        has missed its deadline.
    spent : TimeCounts
        Processor time of each simulated period.
    lateness : TimeCounts
        From the beginning of a period to that of its simulation.
    """

    elapsed: TimeCounts
    spent: TimeCounts
    lateness: TimeCounts

    def describe(self, schedule: Schedule) -> dict[str, Any]:
        """Return the figures of a report, times in s."""
        return {
            "period": schedule.period,
            "periods": schedule.planned,
            "left_out": schedule.left_out,
            "missed": self.elapsed.count_above(schedule.period),
            "elapsed": self.elapsed.describe(),
            "processor": self.spent.describe(),
            "lateness": self.lateness.describe(),
        }


def run_session(
    session: Session,
    doors: Doors,
    writer: PartWriter | None,
    part: float,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
) -> tuple[Session, dict[str, Any]]:
    """Run a session in real time until it is to stop; return it, and the figures of its deadlines.

    `session`: used up; `writer`: of a take; `part`: duration of a part of it, s; `stopped`: whether to stop;
    `tell`: told what a person has to know, a line at a time.
    """
    sys.setswitchinterval(SWITCH)
    room = max(1, round(part / session.system.period))
    if writer:
        session = record(session, room)
    doors.show(pack_frame(make_frame(session)))
    # What is there stays: the collector need not look through it again and again.
    gc.collect()
    gc.freeze()
    times = LoopTimes(TimeCounts(BIN), TimeCounts(BIN), TimeCounts(BIN))
    period = session.system.period
    schedule = Schedule(time.perf_counter(), period, max(1, round(CATCH_UP / period)))
    resets, flagged = 0, Counter[str]()
    while not stopped():
        wait = schedule.begins - time.perf_counter()
        if wait > 0.0:
            time.sleep(min(wait, LOOK))
            if wait > LOOK:
                continue
        began, spent = time.perf_counter(), time.thread_time()
        due, schedule = plan_periods(schedule, began)
        if not due.count:
            continue
        order = doors.read_order()
        if order.resets != resets:
            resets = order.resets
            session = _restart(session, writer, room)
        session = _advance(session, order.target, order.number, due.count, tell)
        frame = make_frame(session)
        doors.show(pack_frame(frame))
        ended = time.perf_counter()
        flagged.update(name_flags(frame.flags))
        # A turn that makes up for late periods simulates several.
        each = (time.thread_time() - spent) / due.count
        for _ in range(due.count):
            times.spent.count(each)
        for begin in due.begins.tolist():
            times.elapsed.count(ended - begin)
            times.lateness.count(began - begin)
        if writer:
            session = _keep(session, writer, room, tell)
    gc.unfreeze()
    _hand_over(session, writer)
    return replace(session, recording=None), {**times.describe(schedule), "flagged": dict(flagged)}


def _advance(
    session: Session,
    target: Floats | None,
    number: int,
    count: int,
    tell: Callable[[str], None],
) -> Session:
    """Return the session after some control periods, its fingertip at the newest pose."""
    after = follow(session, session.pose if target is None else target, number, count)
    if after.diverged != session.diverged:
        tell(f"The session diverged, and went back to {after.kept.period * after.system.period:.3f} s.")
    return after


def _restart(session: Session, writer: PartWriter | None, room: int) -> Session:
    """Return the session at rest; a take ends, and another one begins."""
    _hand_over(session, writer)
    fresh = reset(session)
    if writer is None or session.recording is None:
        return fresh
    writer.end_session()
    return record(fresh, room)


def _keep(session: Session, writer: PartWriter, room: int, tell: Callable[[str], None]) -> Session:
    """Return the session with a new part of its take when the last one is full."""
    recording = session.recording
    if recording is None or recording.count <= room:
        return session
    _hand_over(session, writer)
    if writer.failure:
        tell(writer.failure)
        return replace(session, recording=None)
    return record(session, room)


def _hand_over(session: Session, writer: PartWriter | None) -> None:
    """Hand what is recorded to the writer."""
    if writer is None or session.recording is None:
        return
    end = snapshot.dump(session.system, session.state)
    take = make_take(session.scene, session.recording, end)
    if take is not None:
        writer.put(take)
