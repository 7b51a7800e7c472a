"""Session of a server as a value: it follows the newest pose, control period by control period."""

from __future__ import annotations

import math
import operator
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DivergenceError
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.model.trajectory import interpolate_poses, sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session import snapshot
from digiclay.core.session.live_periods import clamp_pose, interpolate_path, simulate_path
from digiclay.core.session.recent_trace import exceeds_law
from digiclay.core.session.recorded_path import Recording

from .protocol import LIMITS, Flag, Frame, Limits

#: Time between two states that are kept for a session that diverges, s.
KEEP = 0.5
#: How far a point of the fingertip is from the lowest one at most, in the paper's device, m: a turn moves it.
ARM = 0.02


@dataclass(frozen=True, eq=False)
class Kept:
    """State to go back to: period, snapshot, and pose of the fingertip (7,)."""

    period: int
    snapshot: bytes
    pose: Floats


@dataclass(frozen=True, eq=False)
class Session:
    """Session at one instant.

    Attributes
    ----------
    scene : Scene
    system : System
    state : State
        Used up by the next step.
    pose : ndarray (7,)
        The fingertip's.
    number : int
        Of the last pose taken up.
    kept : Kept
    recording : Recording or None
    diverged : int
        How often it went back to `kept`.
    refused : ndarray (7,) or None
        Pose on the way to which it diverged: it is not gone to again.
    limits : Limits
    behind : bool
        Whether the pose asked for is farther away than the largest speed allows.
    """

    scene: Scene
    system: System
    state: State
    pose: Floats
    kept: Kept
    number: int = 0
    recording: Recording | None = None
    diverged: int = 0
    refused: Floats | None = None
    limits: Limits = LIMITS
    behind: bool = False


def begin_session(scene: Scene, limits: Limits = LIMITS) -> Session:
    """Begin a session at rest, its fingertip where the path of the scene begins.

    Raises DigiclayError when the scene's parts do not go together.
    """
    return _begin_at_rest(scene, assemble(scene), limits)


def _begin_at_rest(scene: Scene, system: System, limits: Limits) -> Session:
    """Return the session of a bed at rest."""
    state = begin(system)
    first = sample_poses(scene.trajectories(), np.zeros(1))[0, 0]
    pose = clamp_pose(first, system.cell.actuator.stroke)
    return Session(scene, system, state, pose, Kept(0, snapshot.dump(system, state), pose), limits=limits)


def follow(session: Session, target: Floats, number: int, count: int) -> Session:
    """Simulate control periods in which the fingertip goes straight to a pose, at its largest speed at most.

    A session that diverges goes back to a state it has kept, with the fingertip there; its recording too.

    `session`: used up; `target` (7,), lowest point, m, and unit quaternion, finite; `number`: of the pose;
    `count`: control periods, at least 1.
    """
    system = session.system
    if session.refused is not None and np.array_equal(target, session.refused):
        target = session.pose
    goal = clamp_pose(target, system.cell.actuator.stroke)
    end = _limit_way(session.pose, goal, session.limits.speed * system.period * count)
    start, stop = session.pose[None], end[None]
    path = np.array([start, stop]) if count == 1 else interpolate_path(start, stop, count)
    try:
        # A pressed pin's force grows exponentially; beyond all floats the session says so itself.
        with np.errstate(over="ignore", invalid="ignore"):
            (state,) = deque(simulate_path(system, session.state, path), maxlen=1)
    except DivergenceError:
        return replace(_go_back(session), refused=target)
    recording = session.recording and session.recording.extend(path[1:], 0)
    after = replace(
        session, state=state, pose=end, number=number, recording=recording, behind=end is not goal
    )
    if state.period - session.kept.period >= KEEP / system.period:
        after = replace(after, kept=Kept(state.period, snapshot.dump(system, state), end))
    return after


def _limit_way(start: Floats, goal: Floats, most: float) -> Floats:
    """Return the pose (7,) on the way to another at which no point of the fingertip has gone farther, m."""
    first, last = start.tolist(), goal.tolist()  # faster than arrays of 7
    cosine = abs(sum(map(operator.mul, first[3:], last[3:])))
    way = math.dist(first[:3], last[:3]) + ARM * 2.0 * math.acos(min(1.0, cosine))
    if way <= most * (1.0 + 1e-9):  # rounding
        return goal
    reached: Floats = interpolate_poses(np.array([[start], [goal]]), np.array([most / way]))[0, 0, 0]
    return reached


def _go_back(session: Session) -> Session:
    """Return the session at its kept state."""
    kept, recording = session.kept, session.recording
    # What was recorded since is cut off: the recording began at the kept state, or before it.
    recording = recording and recording.cut_at_period(kept.period)
    return replace(
        session, state=snapshot.load(session.system, kept.snapshot), pose=kept.pose,
        recording=recording, diverged=session.diverged + 1,
    )  # fmt: skip


def reset(session: Session) -> Session:
    """Return the session with its bed at rest and its fingertip where it began; a recording ends."""
    fresh = _begin_at_rest(session.scene, session.system, session.limits)
    return replace(fresh, number=session.number, diverged=session.diverged)


def record(session: Session, room: int) -> Session:
    """Begin to record. `room`: control periods for which there is room at once."""
    now = snapshot.dump(session.system, session.state)
    period = session.state.period
    started = Recording.begin(now, period, session.pose[None], 0, room + 1)
    return replace(session, recording=started, kept=Kept(period, now, session.pose))


def make_frame(session: Session) -> Frame:
    """Return the state for other programs: no more force than the limit, and flags."""
    state, system, most = session.state, session.system, session.limits.force
    forces = state.row(system.rows.force)
    total = float(forces.sum())
    flags = Flag.POSE_LIMITED if session.behind else Flag(0)
    if exceeds_law(system, state, session.pose):
        flags |= Flag.BEYOND_A_FINGER
    if total > most:
        flags |= Flag.FORCE_LIMITED
        forces, total = forces * (most / total), most
    return Frame(
        state.period,
        session.number,
        state.period * system.period,
        total,
        session.pose,
        state.row(0).astype(np.float32),
        forces.astype(np.float32),
        flags,
    )
