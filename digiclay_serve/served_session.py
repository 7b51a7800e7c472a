"""Session of a server as a value, which follows the newest pose, and the parts of its take on the disk."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import (
    DigiclayError,
    DivergenceError,
    OutputError,
    ParameterError,
)
from digiclay.core.control.travel import measure_square
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.system import System
from digiclay.core.files.run_folder import Content, claim_folder, make_folder, write_whole
from digiclay.core.files.tables import Record
from digiclay.core.model.trajectory import interpolate_poses, sample_poses
from digiclay.core.model.yielding_hand import Hand
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session import accuracy, live_session, snapshot
from digiclay.core.session.recent_trace import exceeds_law
from digiclay.core.session.take import Take, from_bytes, to_bytes

from .doors import Order
from .protocol import LIMITS, Flag, Frame, Limits
from .tracked_fingers import (
    CLEAR,
    PARKED,
    TRACKING,
    Felt,
    Tracking,
    Tracks,
    advance,
    begin_tracks,
    name_fingers,
)

#: Time between two states that are kept for a session that diverges, s.
KEEP = 0.5
#: How far a point of the fingertip is from the lowest one at most, in the paper's device, m: a turn
#: moves it.
ARM = 0.02
#: How far around a fingertip pins are looked at, m: whatever is under it, and what it could run
#: into.
AROUND = 0.015


@dataclass(frozen=True, eq=False, kw_only=True)
class Session(live_session.LiveSession):
    """Session of a server at one instant."""

    #: Moment to which it goes back when it diverges.
    kept: live_session.Moment
    #: Of the last pose taken up.
    number: int = 0
    #: How often it went back.
    diverged: int = 0
    #: Poses (f, 7) on the way to which it diverged: they are not gone to again.
    refused: Floats | None = None
    limits: Limits = LIMITS
    #: Whether a pose asked for is farther away than the largest speed allows.
    behind: bool = False
    tracking: Tracking = TRACKING
    #: Of fingers with identities, after so many messages with them.
    tracks: Tracks
    named: int = 0


def begin_session(scene: Scene, limits: Limits = LIMITS, tracking: Tracking = TRACKING) -> Session:
    """Begin a session at rest, its fingertips where the paths of the scene begin. Raises DigiclayError."""
    if scene.bodies:
        rule = "must be left out: a server's clients move fingertips"
        raise ParameterError("body", "", rule, f"{len(scene.bodies)} of them")
    return _begin_at_rest(scene, assemble(scene), limits, tracking, accuracy.start(scene))


def _begin_at_rest(
    scene: Scene,
    system: System,
    limits: Limits,
    tracking: Tracking,
    monitor: accuracy.ErrorMonitor | None,
) -> Session:
    """Return the session of a bed at rest; a fingertip in the place of another one is not there."""
    state = begin(system)
    first = sample_poses(scene.trajectories(), np.zeros(1))[0]
    poses = live_session.clamp_pose(first, system.cell.actuator.stroke)
    for row in range(1, len(poses)):
        if (poses[:row] == poses[row]).all(1).any():
            poses[row, 2] = PARKED
    kept = live_session.Moment(0, snapshot.dump(system, state), poses)
    return Session(
        scene=scene,
        system=system,
        state=state,
        poses=poses,
        kept=kept,
        limits=limits,
        tracking=tracking,
        monitor=monitor,
        tracks=begin_tracks(poses),
    )


def hold_softly(scene: Scene, stiffness: float) -> Scene:
    """Return the scene with hands that are springs of a stiffness, N/m: a virtual coupling."""
    return scene.with_sections(hand=Hand(mass=1e-9, damping=0.0, stiffness=stiffness))


def lacks_pose(session: Session, order: Order, silence: float) -> bool:
    """Return whether no pose has come, or none for a time, s, after which its fingertips lift."""
    most = session.tracking.lift if order.named else session.limits.silence
    return silence > most or not (order.named or order.pose)


def aim(
    session: Session, order: Order, count: int, silence: float = 0.0
) -> tuple[Session, Floats, float]:
    """Return the session, and where its fingertips (f, 7) are to be after control periods by an order.

    And the height, m, over which they go there at once. An identity that is not named lifts, and so
    does the fingertip of a pose that came long ago. `silence`: time since the order, s.
    """
    targets, clear = session.poses.copy(), math.inf
    if order.named:
        tracks, time = session.tracks, count * session.system.period
        felt = feel(session)
        if order.named != session.named:
            tracks = name_fingers(tracks, order.fingers)
        tracks, targets = advance(tracks, session.tracking, felt, time)
        session = replace(session, tracks=tracks, named=order.named)
        clear = felt.peak + CLEAR
    if order.pose is not None:
        targets[0] = order.pose
        if lacks_pose(session, order, silence):
            targets[0, 2] = max(order.pose[2], float(session.state.row(0).max()) + CLEAR)
    return session, targets, clear


def feel(session: Session) -> Felt:
    """Return what the fingertips are near to."""
    system, poses, heights = session.system, session.poses, session.state.row(0)
    peak = float(heights.max())

    def look() -> Floats:
        basis = system.grid.compute_basis(np.arange(system.grid.count))
        near = measure_square(poses[:, 0], poses[:, 1], basis) < AROUND**2
        tops = np.where(near, heights, 0.0).max(1)
        return np.where(near.any(1), tops, peak)

    return Felt(poses, peak, cache(look))


def follow(
    session: Session, targets: Floats, number: int, count: int, clear: float = math.inf
) -> Session:
    """Simulate control periods in which fingertips go straight to poses, at their largest speed at most.

    A session that diverges goes back to a state it has kept, with the fingertips there; its
    recording too.

    `session`: used up; `targets` (f, 7), lowest point, m, and unit quaternion, finite; `number`: of
    the pose; `count`: control periods, at least 1; `clear`: height over which fingertips go
    anywhere at once, m.
    """
    system = session.system
    if session.refused is not None and np.array_equal(targets, session.refused):
        targets = session.poses
    goals = live_session.clamp_pose(targets, system.cell.actuator.stroke)
    reach = session.limits.speed * system.period * count
    start = session.poses
    ends = np.array(
        [
            _limit_way(*each, reach, clear)
            for each in zip(start.tolist(), goals.tolist(), strict=True)
        ]
    )
    path = (
        np.array([start, ends]) if count == 1 else live_session.interpolate_path(start, ends, count)
    )
    try:
        after = live_session.follow_path(session, path)
    except DivergenceError:
        back = live_session.go_back(session, session.kept)
        tracks = begin_tracks(back.poses)
        return replace(back, diverged=session.diverged + 1, refused=targets, tracks=tracks)
    after = replace(after, poses=ends, number=number, behind=not np.array_equal(ends, goals))
    if after.state.period - session.kept.period < KEEP / system.period:
        return after
    return replace(after, kept=_keep(after))


def _keep(session: Session) -> live_session.Moment:
    """Return the present moment of a session."""
    return live_session.Moment(
        session.state.period, snapshot.dump(session.system, session.state), session.poses
    )


def _limit_way(start: list[float], goal: list[float], most: float, clear: float) -> list[float]:
    """Return the pose (7,) on the way to another at which no point of the fingertip has gone farther, m.

    Above a height, m, no way counts.
    """
    if start[2] >= clear:
        if goal[2] >= clear:
            return goal
        start = [*goal[:2], clear, *goal[3:]]
    # Lists of 7 are faster than arrays.
    cosine = abs(sum(map(operator.mul, start[3:], goal[3:])))
    distance = math.dist(start[:3], goal[:3]) + ARM * 2.0 * math.acos(min(1.0, cosine))
    if distance <= most * (1.0 + 1e-9):  # rounding
        return goal
    return [*interpolate_poses(np.array([[start], [goal]]), np.array([most / distance]))[0, 0, 0]]


def reset(session: Session) -> Session:
    """Return the session with its bed at rest and its fingertip where it began; a recording ends."""
    monitor = session.monitor and accuracy.reset(session.monitor)
    fresh = _begin_at_rest(session.scene, session.system, session.limits, session.tracking, monitor)
    return replace(fresh, number=session.number, diverged=session.diverged)


def record(session: Session, room: int) -> Session:
    """Begin to record. `room`: control periods for which there is room at once."""
    now = _keep(session)
    return replace(live_session.start_recording(session, now.snapshot, room=room), kept=now)


def make_frame(session: Session, flags: int = 0) -> Frame:
    """Return the state for other programs: no more force than the limit, and more flags."""
    state, system, most = session.state, session.system, session.limits.force
    forces = state.row(system.rows.force)
    total = float(forces.sum())
    each = state.finger_forces() if system.fingers > 1 else np.array([total])
    if session.behind:
        flags |= Flag.POSE_LIMITED
    tips = session.tips
    if exceeds_law(system, state, tips[0]):
        flags |= Flag.BEYOND_A_FINGER
    if (largest := float(each.max())) > most:
        flags |= Flag.FORCE_LIMITED
        share = most / largest
        forces = forces * share
        each = each * share
        total = total * share if system.fingers > 1 else most
    pins = state.row(0).astype(np.float32), forces.astype(np.float32)
    time = state.period * system.period
    rows = session.tracks.identities.tolist(), each.tolist(), map(tuple, tips.tolist())
    fingers = tuple(zip(*rows, strict=True)) if system.fingers > 1 else ()
    errors = session.errors and (session.errors.height, session.errors.force)
    return Frame(state.period, session.number, time, total, tips[0], *pins, flags, fingers, errors)


#: Most parts that wait for the disk.
WAITING = 4
#: Names of takes, and of the parts that a killed process leaves.
TAKE = Content("take", ("take_[0-9][0-9][0-9].npz", f"take_[0-9][0-9][0-9]_part_{5 * '[0-9]'}.npz"))


class PartWriter(AbstractContextManager["PartWriter"]):
    """Thread that writes parts into a folder, which no other process writes until the block ends.

    The folder is new or empty; with `overwrite` it may hold takes, which the first part that is
    written replaces. Raises OutputError on entry when it cannot be used.
    """

    def __init__(self, folder: Path, *, overwrite: bool = False) -> None:
        self.folder, self._overwrite = folder, overwrite
        self.failure = ""
        #: Simulated time and errors of each take by its number, as the metrics of a run have them.
        self.efforts: dict[int, Record] = {}
        self._old: list[Path] = []
        self._claim = ExitStack()
        self._writing = ThreadPoolExecutor(1)
        self._waiting: list[Future[None]] = []
        self.session = self._part = 1

    def __enter__(self) -> PartWriter:
        claim = claim_folder(self.folder, overwrite=self._overwrite, content=TAKE)
        self._claim.enter_context(claim)
        self._old = TAKE.find(self.folder)
        return self

    def put(self, take: Take) -> None:
        """Hand over a part without waiting for the disk; after a failure nothing is written any more."""
        if self.failure:
            return
        self._waiting = [part for part in self._waiting if not part.done()]
        if len(self._waiting) > WAITING:
            self.failure = (
                f"The disk is too slow for the take: {self.folder} has what was written until now."
            )
            return
        path = self.folder / f"take_{self.session:03}_part_{self._part:05}.npz"
        self._waiting.append(self._writing.submit(self._write, path, take))
        self._part += 1

    def end_session(self) -> None:
        """Have the next part begin a take of its own."""
        if self._part > 1:
            self.session, self._part = self.session + 1, 1

    def finish(self) -> list[Path]:
        """Wait for the disk, and join the parts of each take; return the takes."""
        self._writing.shutdown()
        files = sorted(set(self.folder.glob("take_*_part_*.npz")).difference(self._old))
        written = []
        for name, group in groupby(files, lambda path: path.name.partition("_part_")[0]):
            parts, target = list(group), self.folder / f"{name}.npz"
            write_whole(
                target, to_bytes(join_parts([from_bytes(path.read_bytes()) for path in parts]))
            )
            for path in parts:
                path.unlink()
            written.append(target)
        return written

    def __exit__(self, *raised: object) -> None:
        self._writing.shutdown()
        self._claim.close()

    def _write(self, path: Path, take: Take) -> None:
        """Write a part, unless one before it could not be written."""
        if self.failure:
            return
        try:
            make_folder(self.folder)
            while self._old:
                self._old.pop().unlink()
            write_whole(path, to_bytes(take))
        except (DigiclayError, OSError) as error:
            self.failure = f"The take ends here: {error}"


def join_parts(parts: Sequence[Take]) -> Take:
    """Return one take of parts, oldest first; OutputError when one does not begin where the last one ends."""
    first, *others = parts
    for before, part in pairwise(parts):
        if part.start != before.end or part.scene != first.scene:
            raise OutputError("The parts of a take must follow each other: one of them is missing.")
    poses = np.concatenate([first.poses, *(part.poses[1:] for part in others)])
    return Take(first.scene, first.start, poses, parts[-1].end)
