"""Session at a fixed rate: orders of the clients in, frames out, parts of a take to the disk."""

from __future__ import annotations

import gc
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from digiclay.core.base.arrays import Floats
from digiclay.core.session import snapshot
from digiclay.core.session.recorded_path import make_take

from .deadlines import Schedule, TimeCounts, plan_periods
from .doors import Doors
from .protocol import name_flags, pack_frame
from .served_session import Session, follow, make_frame, record, reset
from .take_parts import PartWriter

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
