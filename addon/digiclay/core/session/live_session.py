"""Live session: state and fingertip, clock that says how many control periods are due, recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from operator import is_
from typing import TypeVar

import numpy as np

from ..base.arrays import Floats
from ..base.modes import BLISTER, LOCKED
from ..control.orders import ORDER, SURFACED, LockingControl, Orders, order_periods
from ..engine.bodies import Given, Knot, find_given
from ..engine.simulation import advance
from ..engine.state import State
from ..engine.system import System
from ..model.trajectory import interpolate_poses
from ..scene.schema import Scene
from . import accuracy, snapshot

#: Wall time over which the real-time factor is averaged, s.
WINDOW = 1.0
#: Longest time for the periods of a tick, as a share of the interval of ticks: the rest is for
#: drawing and for the user; and for those of a queue when the hand has let go.
SHARE, RELEASED_SHARE = 0.7, 0.9
#: Least time for the periods of a queue, as a share of Blender's drawing time, while a stroke is
#: drawn, and after its end: software drawing takes half a second. At 30 frames per second, 15 are
#: still displayed then.
LEAST, RELEASED_LEAST = 0.5, 1.0
#: Share of the time between the periods that is drawing for certain: Blender also waits for the
#: next tick.
DRAWN = 0.9
#: Shortest interval of ticks that is assumed, s: ticks may come in a burst.
SHORTEST = 1e-2
#: An animation whose frame has not changed for this time is another scene's, s: software draws 1
#: frame per s.
STANDS = 2.0
#: Rounding error up to which times count as whole periods, in periods.
SLACK = 1e-6

#: Pose of a recorded fingertip that is absent, (7,): a stroke adds fingertips for its images.
AWAY = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])

#: Columns of a recording: poses, orders and, last, ticks.
POSES, ORDERS = slice(-ORDER - 1), slice(-ORDER - 1, -1)

Ticks = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Clock:
    """Wall clock of a live session."""

    seen: float | None = None
    """Wall time at which the clock was last read, s; None: it starts at the next reading."""
    moment: tuple[float, float] | None = None
    """Time of an animation that played then, and wall time at which it got there, s; None: none played."""
    left: float = 0.0
    """Elapsed time that is not simulated yet, less than a control period, s."""
    cost: float = 0.0
    """Wall time per control period, s, a running average; 0: unknown."""
    spent: float = 0.0
    """Wall time that the periods of a queue took in the last tick, s; 0: none."""
    ticks: Ticks = ()
    """Wall time between readings within the last second, and the time simulated in it, s."""

    @property
    def factor(self) -> float:
        """Simulated time over wall time in the last second; 1 is real time, 0 is unknown."""
        gone = sum(time for time, _ in self.ticks)
        return sum(done for _, done in self.ticks) / gone if gone > 0.0 else 0.0

    def stopped(self) -> Clock:
        """Return the clock of a session that pauses, so that the pause does not count."""
        return replace(self, seen=None, moment=None, left=0.0, spent=0.0, ticks=())


def periods_due(
    clock: Clock, now: float, period: float, most: int, moment: float | None = None
) -> tuple[int, Clock]:
    """Return the number of control periods, s, to simulate now, s, at `most`, and the clock after them.

    `moment`: time of an animation that plays, s, which counts instead, so that keyed motion has its
    speed.
    """
    last, shown = clock.moment, None if moment is None else (moment, now)
    shown = last if last and last[0] == moment else shown
    if clock.seen is None:
        return 0, replace(clock, seen=now, moment=shown)
    gone = passed = max(0.0, now - clock.seen)
    affordable = max(1, int(SHARE * max(gone, SHORTEST) / clock.cost)) if clock.cost > 0.0 else most
    limit = min(most, affordable)
    if last and shown and now - shown[1] < STANDS:
        passed, limit = abs(shown[0] - last[0]), max(most, affordable)
    whole = math.floor((clock.left + passed) / period + SLACK)
    count = max(0, min(whole, limit))
    left = max(0.0, clock.left + passed - whole * period)
    ticks = _extend_window(clock.ticks, gone, count * period)
    return count, replace(clock, seen=now, moment=shown, left=left, spent=0.0, ticks=ticks)


def _extend_window(ticks: Ticks, gone: float, done: float) -> Ticks:
    """Return the ticks within the last second, with one added; wall time and simulated time, s."""
    ticks = (*ticks, (gone, done))
    while len(ticks) > 1 and sum(time for time, _ in ticks[1:]) >= WINDOW:
        ticks = ticks[1:]
    return ticks


def find_spare(clock: Clock, now: float, interval: float, held: bool) -> float:
    """Return the time for the periods of a queue in a tick at `now`, of ticks an `interval` apart, s.

    `held`: the hand draws a stroke.
    """
    share, least = (SHARE, LEAST) if held else (RELEASED_SHARE, RELEASED_LEAST)
    # Drawing cannot be measured here, only the whole time between two ticks without the periods.
    beside = interval if clock.seen is None else max(0.0, now - clock.seen - clock.spent)
    return max(min(share * interval, interval - DRAWN * beside), least * beside)


def count_fitting(clock: Clock, spare: float, most: int) -> int:
    """Return how many periods of a queue fit into a time, s, 1 to `most`: the last one may end later."""
    return min(max(int(spare / clock.cost), 1), most) if clock.cost > 0.0 else 1


def count_queue(clock: Clock, now: float, done: float, spent: float) -> Clock:
    """Return the clock after a queue's periods: simulated and wall time, s; waiting does not count."""
    clock = replace(clock, moment=None, left=0.0, spent=spent)
    if done > 0.0:
        gone = spent if clock.seen is None else max(spent, now - clock.seen)
        clock = replace(clock, ticks=_extend_window(clock.ticks, gone, done))
    return replace(clock, seen=now)


def update_cost(clock: Clock, count: int, took: float) -> Clock:
    """Return the clock after a number of control periods and the wall time they took, s."""
    if count < 1 or took <= 0.0:
        return clock
    each = took / count
    return replace(clock, cost=each if clock.cost <= 0.0 else 0.8 * clock.cost + 0.2 * each)


def interpolate_path(start: Floats, end: Floats, count: int) -> Floats:
    """Return the fingers' poses (count + 1, f, 7) at the ends of periods between two poses (f, 7)."""
    path: Floats = interpolate_poses(np.array([start, end]), np.arange(count + 1) / count)[0]
    path[0] = start
    return path


def clamp_pose(pose: Floats, stroke: float) -> Floats:
    """Return poses (..., 7), limited to the floor and to a thousand strokes, m, from the bed."""
    # Pins stop at the floor: below it the force would exceed the floating-point range.
    far = 1e3 * stroke
    inside = pose.copy()
    np.minimum(np.maximum(pose[..., :3], (-far, -far, 0.0)), far, out=inside[..., :3])
    return inside


def simulate_path(
    system: System, state: State, path: Floats, orders: Orders | None = None
) -> Iterator[State]:
    """Yield the states along the path (t + 1, f, 7), each valid until the next one; overwrites `state`."""
    poses = interpolate_poses(path, system.instants / system.period)
    fingers = system.trace(poses, state.period)
    locked = bool((state.mode() == LOCKED).any())
    systems: Iterator[System] = repeat(system, len(fingers))
    if orders is not None or locked:
        systems = _order(system, orders or Orders(np.zeros((len(fingers), ORDER))), locked=locked)
    for system, finger in zip(systems, fingers, strict=True):
        state, controller = advance(system, state, finger), system.controller
        if isinstance(controller, LockingControl):
            state = state._replace(locks=controller.find_locks(system.grid, state.locks))
        yield state


def _order(system: System, orders: Orders, *, locked: bool) -> Iterator[System]:
    """Yield the system of each control period of a bed with orders, or with locked pins."""
    method, device = system.controller, (system.grid, system.cell, system.period)
    limits = system.latency, system.height_floor
    for controller in order_periods(method, *device, orders, *limits, locked=locked):
        yield system if controller is method else replace(system, controller=controller)


def has_arrived(state: State) -> bool:
    """Return whether all pins that orders move have reached their heights."""
    return not bool((state.mode() == BLISTER).any())


@dataclass(frozen=True, eq=False)
class Recording:
    """Fingertip paths and orders since the start of the recording."""

    start: bytes
    """The state at the start, from `snapshot.dump`."""
    first: int
    """Its period."""
    rows: Floats
    """(capacity, 7 f + 5 + 1): Poses of the fingers at the end of each period, AWAY if absent, its order, see
    `core.control.orders`, and its tick; row 0: the start."""
    count: int
    """Rows in use."""
    saved: int = 0
    """Rows that the file has in a take."""
    surfaces: tuple[Floats, ...] = ()
    """(n,) each: Heights to which orders move pins, m."""
    knots: tuple[Knot, ...] = ()
    """Bodies, where these are given."""

    @classmethod
    def begin(
        cls, snapshot: bytes, period: int, pose: Floats, tick: int, room: int = 256
    ) -> Recording:
        """Return a recording of a start only: snapshot, period, poses (f, 7); `room`: its capacity."""
        rows = np.empty((room, pose.size + ORDER + 1))
        rows[0] = *pose.ravel(), *np.zeros(ORDER), tick
        return cls(snapshot, period, rows, 1)

    @property
    def path(self) -> Floats:
        """Poses (t + 1, f, 7), which `simulate_path` simulates again bit for bit."""
        return self.rows[: self.count, POSES].reshape(self.count, -1, 7)

    @property
    def orders(self) -> Orders | None:
        """The orders of all periods; None: no period has one."""
        orders = Orders(self.rows[1 : self.count, ORDERS], self.surfaces)
        return orders if orders.given else None

    @property
    def unsaved(self) -> bool:
        """Whether the file lacks recorded periods."""
        return self.count > max(self.saved, 1)

    def extend(self, path: Floats, tick: int, orders: Orders | None = None) -> Recording:
        """Return the recording with poses (k, f, 7) of more periods, and their orders."""
        end = self.count + len(path)
        rows = self.rows
        if end > len(rows):
            rows = np.empty((2 * end, self.rows.shape[1]))
            rows[: self.count] = self.rows[: self.count]
        new = rows[self.count : end]
        poses = np.tile(AWAY, (len(path), (rows.shape[1] - ORDER - 1) // 7))
        poses[:, : path[0].size] = path.reshape(len(path), -1)
        new[:, POSES] = poses
        new[:, -1] = tick
        given, surfaces = new[:, ORDERS], self.surfaces
        given[:] = 0.0
        if orders is not None:
            given[:] = orders.rows
            surfaces, numbers = _add_surfaces(surfaces, orders.surfaces)
            placed = np.isin(given[:, 4], SURFACED)
            given[placed, 0] = numbers[given[placed, 0].astype(np.intp)]
        return replace(self, rows=rows, count=end, surfaces=surfaces)

    def let_in(self, poses: Floats) -> Recording:
        """Return the recording with fingertips at poses (f, 7) from its last row on."""
        more = max(0, poses.size - (self.rows.shape[1] - ORDER - 1))
        away = np.tile(AWAY, (len(self.rows), more // 7))
        rows = np.concatenate([self.rows[:, POSES], away, self.rows[:, -ORDER - 1 :]], axis=1)
        rows[self.count - 1, : poses.size] = poses.ravel()
        return replace(self, rows=rows)

    def cut_at_tick(self, tick: int, period: int) -> Recording | None:
        """Return the recording up to the tick that undo restored, in `period`; None if they disagree."""
        count = int(np.searchsorted(self.rows[: self.count, -1], tick, side="right"))
        return self._first(count) if count and count - 1 == period - self.first else None

    def cut_at_period(self, period: int) -> Recording | None:
        """Return the recording up to one of its periods; None if that is before its start."""
        count = period - self.first + 1
        return self._first(count) if 0 < count <= self.count else None

    def _first(self, count: int) -> Recording:
        """Return the first rows of the recording."""
        rows = self.rows[1:count, ORDERS]
        last = self.first + count - 1
        needed = int(rows[np.isin(rows[:, 4], SURFACED), 0].max(initial=-1.0)) + 1
        return replace(
            self,
            count=count,
            saved=min(self.saved, count),
            surfaces=self.surfaces[:needed],
            knots=tuple(knot for knot in self.knots if knot[0] <= last),
        )


def _add_surfaces(
    surfaces: tuple[Floats, ...], added: tuple[Floats, ...]
) -> tuple[tuple[Floats, ...], Floats]:
    """Return surfaces (n,) with those added, unless equal to the last one, and the numbers of the latter."""
    numbers = []
    for surface in added:
        if not (
            surfaces and (surfaces[-1] is surface or surfaces[-1].tobytes() == surface.tobytes())
        ):
            surfaces = (*surfaces, surface)
        numbers.append(len(surfaces) - 1)
    return surfaces, np.array(numbers, np.float64)


@dataclass(frozen=True, eq=False)
class Moment:
    """Moment to which a session can return: period, snapshot, and poses of the fingertips (f, 7)."""

    period: int
    snapshot: bytes
    poses: Floats
    tick: int = 0
    """Number of the session's tick, which identifies the moment."""
    base: Floats | None = None
    """(n,): Heights that strokes count from, m; None: of a session without strokes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LiveSession:
    """Live session at one instant, in Blender or in a server."""

    scene: Scene
    system: System
    state: State
    """The next control period overwrites it: it may not be stored."""
    poses: Floats
    """(f, 7): Poses of the fingertips that the session has reached; of those on hands the intended ones."""
    recording: Recording | None = None
    monitor: accuracy.ErrorMonitor | None = None
    errors: accuracy.Errors | None = None
    """Estimate so far."""
    reached: Sequence[Given] | None = None
    """Bodies where the session has them; None: no path yet."""
    aim: Sequence[Given] | None = None
    """Where the next path leads them; None: there are none."""

    @property
    def tips(self) -> Floats:
        """Poses of the fingertips, (f, 7), which hands that give way have raised."""
        tips = self.poses.copy()
        if self.state.deflection:
            tips[:, 2] += self.state.deflection.rise
        return tips

    @property
    def pose(self) -> Floats:
        """Pose of the first fingertip, (7,)."""
        return self.poses[0]


Session = TypeVar("Session", bound=LiveSession)


def follow_path(
    session: Session,
    path: Floats,
    orders: Orders | None = None,
    tick: int = 0,
    watch: Callable[[State], None] | None = None,
    pause: int = accuracy.PAUSE,
) -> Session:
    """Simulate and record the control periods of a path (t + 1, f, 7); unusable after a DivergenceError.

    `pause`: control periods between two stretches of its monitor.
    """
    session, knots = _lead_bodies(session, len(path) - 1)
    system, state, monitor = session.system, session.state, session.monitor
    monitor = monitor and accuracy.begin_stretch(monitor, state, pause)
    errors, first = None, state.period + 1
    # The force on a pressed pin grows exponentially; the session itself reports an overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        for state in simulate_path(system, session.state, path, orders):
            if monitor:
                index = state.period - first
                monitor = accuracy.note(monitor, state, path[index : index + 2], pause, knots)
            if watch:
                watch(state)
    if monitor:
        monitor, errors = accuracy.catch_up(monitor, state, len(path) - 1)
    recording = session.recording and session.recording.extend(path[1:], tick, orders)
    errors = errors or session.errors
    return replace(
        session, state=state, poses=path[-1], recording=recording, monitor=monitor, errors=errors
    )


def _lead_bodies(session: Session, count: int) -> tuple[Session, list[Knot]]:
    """Give bodies along a path of `count` periods to the system; return the session at its end, and them."""
    aim, reached, first = session.aim, session.reached, session.state.period
    given = find_given(session.system)
    if aim is None or given is None:
        return session, []
    if reached is None or len(reached) != len(aim):  # others than before begin where they are
        reached = aim
    knots: list[Knot] = [(first, reached), (first + count, aim)]
    unders: list[Knot] = [(period, given.measure(bodies)) for period, bodies in knots]
    given.give(unders)
    recording = session.recording
    if recording:
        former = recording.knots or knots[:1]
        knots = [(period, given.condense(bodies, former[0][1])) for period, bodies in knots]
        last, bodies = former[-1]
        goes_on = bool(recording.knots) and last == first and all(map(is_, bodies, knots[0][1]))
        recording = replace(recording, knots=(*recording.knots, *knots[goes_on:]))
    return replace(session, reached=aim, recording=recording), unders


def start_recording(session: Session, now: bytes, tick: int = 0, room: int = 255) -> Session:
    """Return the session with a new recording; `now`: snapshot of the state; `room`: periods to allocate."""
    begun = Recording.begin(now, session.state.period, session.poses, tick, room + 1)
    return replace(session, recording=begun)


def go_back(session: Session, moment: Moment) -> Session:
    """Return the session at an earlier moment, without what was recorded since."""
    recording = session.recording and session.recording.cut_at_period(moment.period)
    state = snapshot.load(session.system, moment.snapshot)
    monitor = session.monitor and accuracy.reset(session.monitor)
    return replace(
        session, state=state, poses=moment.poses, recording=recording, monitor=monitor, errors=None
    )
