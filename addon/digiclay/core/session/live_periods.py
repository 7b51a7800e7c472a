"""Clock of a live session: due control periods, and the fingertip path between ticks.

The wall's clock says how many whole control periods are due. A machine that is too slow for
them leaves some out and says so by its real-time factor; it never falls behind for good.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from ..base.arrays import Floats
from ..engine.simulation import advance, trace_fingers
from ..engine.state import State
from ..engine.system import System
from ..model.trajectory import interpolate_poses

#: Over how much of the wall's time the real-time factor is taken, s.
WINDOW = 1.0
#: Longest time the periods of one tick may take, as a share of the time between two ticks: the rest
#: is for drawing, and for whoever works in the window.
SHARE = 0.7
#: Shortest time between two ticks that is counted with, s: ticks may come in a burst.
SHORTEST = 1e-2
#: Rounding errors of times count as whole periods when they are below this share of one.
SLACK = 1e-6


@dataclass(frozen=True)
class Clock:
    """Wall clock of a live session.

    Attributes
    ----------
    seen : float or None
        When the clock was last looked at, s; None: it starts with the next look.
    left : float
        Time gone by that is not simulated yet, less than a control period, s.
    cost : float
        Wall time one control period takes, s, as measured of late; 0: not known.
    ticks : tuple of (float, float)
        When the clock was looked at within the last second, and what was simulated then, s.
    """

    seen: float | None = None
    left: float = 0.0
    cost: float = 0.0
    ticks: tuple[tuple[float, float], ...] = ()

    @property
    def factor(self) -> float:
        """Simulated time over the wall's, in the last second; 1 keeps up, 0 before anything is known."""
        gone = sum(time for time, _ in self.ticks)
        return sum(done for _, done in self.ticks) / gone if gone > 0.0 else 0.0

    def stopped(self) -> Clock:
        """Return the clock of a session that pauses: the time until it goes on will not count."""
        return replace(self, seen=None, left=0.0, ticks=())


def periods_due(clock: Clock, now: float, period: float, most: int) -> tuple[int, Clock]:
    """Return how many control periods to simulate now, and the clock after them.

    What is more than `most`, or more than this machine can do between two ticks, is dropped and
    not made up for later.

    `now`: a clock that never goes back, s; `period`: control period, s; `most`: most periods at a time.
    """
    if clock.seen is None:
        return 0, replace(clock, seen=now)
    gone = max(0.0, now - clock.seen)
    whole = math.floor((clock.left + gone) / period + SLACK)
    count = max(0, min(whole, most, _count_affordable(clock, gone)))
    left = max(0.0, clock.left + gone - whole * period)
    ticks = (*clock.ticks, (gone, count * period))
    while len(ticks) > 1 and sum(time for time, _ in ticks[1:]) >= WINDOW:
        ticks = ticks[1:]
    return count, replace(clock, seen=now, left=left, ticks=ticks)


def _count_affordable(clock: Clock, gone: float) -> int:
    """Return how many periods this machine can do in the time between two ticks, at least 1."""
    if clock.cost <= 0.0:
        return 2**31
    return max(1, int(SHARE * max(gone, SHORTEST) / clock.cost))


def update_cost(clock: Clock, count: int, took: float) -> Clock:
    """Return the clock after some periods of a measured duration.

    `count`: control periods; `took`: of the wall's time, all together, s.
    """
    if count < 1 or took <= 0.0:
        return clock
    each = took / count
    return replace(clock, cost=each if clock.cost <= 0.0 else 0.8 * clock.cost + 0.2 * each)


def interpolate_path(start: Floats, end: Floats, count: int) -> Floats:
    """Return where the fingers are between periods, shape (count + 1, f, 7), on their ways from pose to pose.

    `start`, `end` (f, 7), poses when last read, and now; `count`: control periods in between, at least 1.
    """
    path: Floats = interpolate_poses(np.array([start, end]), np.arange(count + 1) / count)[0]
    path[0] = start
    return path


def clamp_pose(pose: Floats, stroke: float) -> Floats:
    """Return the pose, raised to where a finger can be: its lowest point no deeper than the bed's floor.

    Pins bottom out there. A finger an artist drags below it would press with more newtons than
    floating-point numbers have.

    `pose` (7,); `stroke`: highest pin top, m; sideways and upwards a thousand strokes are as good as
    infinitely far.
    """
    far = 1e3 * stroke
    inside = pose.copy()
    inside[:2] = np.clip(pose[:2], -far, far)
    inside[2] = min(max(float(pose[2]), 0.0), far)
    return inside


def simulate_path(
    system: System, state: State, path: Floats, smoothing: Floats | None = None
) -> Iterator[State]:
    """Simulate the periods of the fingers' paths; the arrays of `state` are used up.

    A recorded path gives the same states bit for bit, however many periods are done at a time.

    `path` (t + 1, f, 7), where the fingers are between the periods, from `interpolate_path`; `smoothing` (t,
    4), what is smoothed in each period, see `control.smoothing`. Yields after each period; valid until the
    next one is asked for.
    """
    fingers = trace_fingers(system, interpolate_poses(path, system.instants / system.period))
    systems = repeat(system, len(fingers)) if smoothing is None else _order_smoothing(system, smoothing)
    for own, finger in zip(systems, fingers, strict=True):
        state = advance(own, state, finger)
        yield state


def _order_smoothing(system: System, smoothing: Floats) -> Iterator[System]:
    """Yield the system of each control period of a bed that is smoothed."""
    from ..control.smoothing import order_periods

    method = system.controller
    for controller in order_periods(method, system.grid, system.cell, system.period, smoothing):
        yield system if controller is method else replace(system, controller=controller)
