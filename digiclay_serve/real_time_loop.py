"""Session at a fixed rate: orders of the clients in, frames out, parts of a take to the disk."""

import gc
import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from digiclay.core.files.tables import Record
from digiclay.core.session import snapshot
from digiclay.core.session.take import make_take
from numpy.typing import NDArray

from .doors import Doors
from .protocol import Flag, name_flags, pack_frame
from .served_session import PartWriter, Session, aim, follow, lacks_pose, make_frame, record, reset

#: Rounding errors of times count as whole periods when they are below this share of one.
SLACK = 1e-6
#: Times beyond it are counted in one bin, s.
LONGEST = 0.2
#: Shares of the periods whose times are given.
SHARES = (0.5, 0.99, 0.999)


@dataclass
class Schedule:
    """Beginnings of the control periods: period k begins at `start` + k `period`, and ends the one before."""

    #: By a clock that never goes back, s.
    start: float
    period: float
    #: Most periods simulated at a time; what is late beyond them is left out.
    most: int
    #: Periods that were simulated or left out, and that were left out.
    planned: int = 0
    left_out: int = 0

    @property
    def begins(self) -> float:
        """When the next period begins, s."""
        return self.start + self.planned * self.period

    def take_due(self, now: float) -> tuple[int, NDArray[np.float64]]:
        """Return how many periods to simulate now, s, and when all that have begun did, oldest first, s."""
        begun = math.floor((now - self.start) / self.period + SLACK) + 1
        late = max(0, begun - self.planned)
        count = min(late, self.most)
        begins = self.start + self.period * np.arange(self.planned, self.planned + late)
        self.planned, self.left_out = self.planned + late, self.left_out + late - count
        return count, begins


class TimeCounts:
    """Histogram of times, in bins of a width, s."""

    def __init__(self, width: float) -> None:
        self.width = width
        self.bins: Counter[int] = Counter()
        self.longest = 0.0

    def count(self, time: float) -> None:
        """Count a time, s; those beyond `LONGEST` are in one bin."""
        self.bins[int(min(time, LONGEST) / self.width)] += 1
        self.longest = max(self.longest, time)

    def count_above(self, time: float) -> int:
        """Return how many times exceed a limit, by whole bins. `time`, s."""
        return sum(
            count for number, count in self.bins.items() if number >= round(time / self.width)
        )

    def find_share(self, share: float) -> float:
        """Return the time that a share of the times does not exceed, by whole bins, s; 0 without any."""
        left = math.ceil(share * self.bins.total())
        for number, count in sorted(self.bins.items()):
            left -= count
            if left <= 0 and number < int(LONGEST / self.width):
                return min((number + 1) * self.width, self.longest)
        return self.longest

    def describe(self) -> Record:
        """Return the figures for a report: shares and longest, s; and the bins that hold something."""
        shares = {f"p{100 * share:g}": self.find_share(share) for share in SHARES}
        table = [
            [round(number * self.width, 9), count] for number, count in sorted(self.bins.items())
        ]
        return {**shares, "longest": self.longest, "bin": self.width, "bins": table}


#: Periods are made up for if they are this late at most, s; those before are left out.
CATCH_UP = 0.05
#: How long frames tell that periods were left out: a slow reader misses some, s.
TOLD = 1.0
#: Width of a bin of the histograms, s.
BIN = 1e-5
#: Longest time without a look at whether to stop, s.
LOOK = 2e-2
#: Time after which another thread of this process gets the interpreter, s; by default it is five
#: periods.
SWITCH = 2e-4


def run_session(
    session: Session,
    doors: Doors,
    writer: PartWriter | None,
    part: float,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
) -> tuple[Session, Record]:
    """Run a session in real time until it is to stop; return it, and the figures of its deadlines.

    `session`: used up; `writer`: of a take; `part`: duration of a part of it, s; `stopped`: whether
    to stop; `tell`: called with what a person has to know, a line at a time.
    """
    sys.setswitchinterval(SWITCH)
    period = session.system.period
    room = max(1, round(part / period))
    if writer:
        session = record(session, room)
    doors.show(pack_frame(make_frame(session)))
    # What is there stays: the collector need not look through it again and again.
    gc.collect()
    gc.freeze()
    # From the beginning of a period to the frame after it, those left out included: above a period
    # it has missed its deadline. Processor time of a simulated one. From its beginning to that of
    # its simulation.
    elapsed, spent, lateness = (TimeCounts(BIN) for _ in range(3))
    schedule = Schedule(time.perf_counter(), period, max(1, round(CATCH_UP / period)))
    resets, flagged, taken = 0, Counter[str](), doors.read_order()
    heard, omitted = schedule.start, -math.inf
    while not stopped():
        order, began = doors.read_order(), time.perf_counter()
        # What is new is not left to wait: its period begins early, by one at most.
        wait = schedule.begins - began - (period if order is not taken else 0.0)
        if wait > 0.0:
            doors.wait(min(wait, LOOK))
            continue
        if order is not taken:
            taken, heard = order, began
        before = time.thread_time()
        count, begins = schedule.take_due(max(began, schedule.begins))
        begins = np.minimum(begins, began)
        if order.resets != resets:
            resets = order.resets
            session = _restart(session, writer, room)
        diverged = session.diverged
        session, targets, clear = aim(session, order, count, began - heard)
        omitted = began if count < len(begins) else omitted
        flags = Flag.LEFT_OUT * (began - omitted < TOLD)
        flags |= Flag.NO_POSE * lacks_pose(session, order, began - heard)
        session = follow(session, targets, order.number, count, clear)
        if session.diverged != diverged:
            tell(f"The session diverged, and went back to {session.kept.period * period:.3f} s.")
        frame = make_frame(session, flags)
        doors.show(pack_frame(frame))
        ended = time.perf_counter()
        flagged.update(name_flags(frame.flags))
        # A turn that makes up for late periods simulates several.
        each = (time.thread_time() - before) / count
        for _ in range(count):
            spent.count(each)
        for begin in begins.tolist():
            elapsed.count(ended - begin)
            lateness.count(began - begin)
        if writer:
            session = _keep(session, writer, room, tell)
    gc.unfreeze()
    _hand_over(session, writer)
    figures = {
        "period": period,
        "periods": schedule.planned,
        "left_out": schedule.left_out,
        "missed": elapsed.count_above(period),
        "elapsed": elapsed.describe(),
        "processor": spent.describe(),
        "lateness": lateness.describe(),
        "flagged": dict(flagged),
        **_find_effort(session),
    }
    return replace(session, recording=None), figures


def _find_effort(session: Session) -> Record:
    """Return simulated time, s, and errors since the last reset, as the metrics of a run have them."""
    simulated = {"simulated": session.state.period * session.system.period}
    if session.errors is None:
        return {
            **simulated,
            "errors_absent": "not yet"
            if session.monitor
            else "gates of lines, or a step that cannot be halved",
        }
    return simulated | {f"{name}_error": value for name, value in session.errors._asdict().items()}


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
        writer.efforts[writer.session] = _find_effort(session)
