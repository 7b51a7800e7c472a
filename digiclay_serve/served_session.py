"""Session of a server as a value, which follows the newest pose, and the parts of its take on the disk."""

from __future__ import annotations

import math
import operator
import queue
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError, DivergenceError, OutputError
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.files.run_folder import Content, claim_folder, write_whole
from digiclay.core.model.trajectory import interpolate_poses, sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session import snapshot
from digiclay.core.session.live_periods import clamp_pose, interpolate_path, simulate_path
from digiclay.core.session.recent_trace import exceeds_law
from digiclay.core.session.take import Recording, Take, from_bytes, to_bytes

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
    state : State
        Used up by the next step.
    pose : ndarray (7,)
        The fingertip's.
    number : int
        Of the last pose taken up.
    diverged : int
        How often it went back to `kept`.
    refused : ndarray (7,) or None
        Pose on the way to which it diverged: it is not gone to again.
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


#: Most parts that wait for the disk.
WAITING = 4
#: Names of takes, and of the parts that a killed process leaves.
TAKE = Content("take", ("take_[0-9][0-9][0-9].npz", f"take_[0-9][0-9][0-9]_part_{5 * '[0-9]'}.npz"))


class PartWriter(AbstractContextManager["PartWriter"]):
    """Thread that writes parts into a folder, which nobody else writes until the block ends.

    Parameters
    ----------
    folder : Path
        None, or an empty one.
    overwrite : bool, optional
        It may hold takes; the first part that is written replaces them.

    Raises
    ------
    OutputError
        On entry, when the folder cannot be used.
    """

    def __init__(self, folder: Path, *, overwrite: bool = False) -> None:
        self.folder, self._overwrite = folder, overwrite
        self.failure = ""
        self._old: list[Path] = []
        self._made = False
        self._until_the_end = ExitStack()
        self._parts: queue.Queue[tuple[Path, Take] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write_all, daemon=True)
        self._session = self._part = 1

    def __enter__(self) -> PartWriter:
        claim = claim_folder(self.folder, overwrite=self._overwrite, content=TAKE)
        self._until_the_end.enter_context(claim)
        try:
            self._old = TAKE.find(self.folder)
            self._made = not self.folder.exists()
            self.folder.mkdir(exist_ok=True, parents=True)
        except OSError as error:
            self._until_the_end.close()
            raise OutputError(f"{self.folder} cannot be made: {error.strerror or error}.") from None
        self._thread.start()
        return self

    def put(self, take: Take, *, last: bool = False) -> None:
        """Hand over a part without waiting for the disk; after a failure nothing is written any more.

        `last`: whether the next part begins elsewhere, as after a reset.
        """
        if self.failure:
            return
        try:
            self._parts.put_nowait((self.folder / f"take_{self._session:03}_part_{self._part:05}.npz", take))
        except queue.Full:
            self.failure = f"The disk is too slow for the take: {self.folder} has what was written until now."
        self._part += 1
        if last:
            self.end_session()

    def end_session(self) -> None:
        """Have the next part begin a take of its own."""
        if self._part > 1:
            self._session, self._part = self._session + 1, 1

    def finish(self) -> list[Path]:
        """Wait for the disk, and join the parts of each take; return the takes."""
        if self._thread.is_alive():
            self._parts.put(None)
            self._thread.join()
        found = sorted(set(self.folder.glob("take_*_part_*.npz")).difference(self._old))
        sessions = sorted({path.name.partition("_part_")[0] for path in found})
        written = []
        for name in sessions:
            parts = [path for path in found if path.name.startswith(f"{name}_part_")]
            target = self.folder / f"{name}.npz"
            write_whole(target, to_bytes(join_parts([from_bytes(path.read_bytes()) for path in parts])))
            for path in parts:
                path.unlink()
            written.append(target)
        return written

    def __exit__(self, *raised: object) -> None:
        if self._thread.is_alive():
            self._parts.put(None)
            self._thread.join()
        if self._made:
            with suppress(OSError):  # it holds a take
                self.folder.rmdir()
        self._until_the_end.close()

    def _write_all(self) -> None:
        """Write what is handed over."""
        while (part := self._parts.get()) is not None:
            if self.failure:
                continue
            try:
                while self._old:
                    self._old.pop().unlink()
                write_whole(part[0], to_bytes(part[1]))
            except (DigiclayError, OSError) as error:
                self.failure = f"The take ends here: {error}"


def join_parts(parts: Sequence[Take]) -> Take:
    """Return one take of parts that follow each other.

    `parts`: oldest first, at least one. Raises OutputError when one does not begin with the state the last
    one ends with.
    """
    first, *others = parts
    end, poses = first.end, [first.poses]
    for part in others:
        if part.start != end or part.scene != first.scene:
            raise OutputError("The parts of a take must follow each other: one of them is missing.")
        end = part.end
        poses.append(part.poses[1:])
    return Take(first.scene, first.start, np.concatenate(poses), end)
