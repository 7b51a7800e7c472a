"""Live sessions and their beds, as values; no Blender."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.control.smoothing import ORDER
from ..core.engine.state import State
from ..core.engine.system import System
from ..core.scene.schema import Scene
from ..core.session.accuracy import ErrorMonitor, Errors
from ..core.session.live_periods import Clock
from ..core.session.recent_trace import RecentTrace
from .stroke import Stroke

__all__ = [
    "Gesture", "Recording", "Running", "drop", "find", "last_message", "list_sessions", "put",
    "set_message",
]  # fmt: skip

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gesture:
    """Start of a gesture: period, snapshot (`core.session.snapshot`), and pose of the fingertip (7,)."""

    period: int
    snapshot: bytes
    pose: Floats


@dataclass(frozen=True, eq=False)
class Recording:
    """Fingertip path, and what was smoothed, since the start of the recording.

    Attributes
    ----------
    start : bytes
        The state recording began with, kept by `core.session.snapshot`.
    first : int
        Its period.
    rows : ndarray (capacity, 7 f + 4 + 1)
        Poses of the fingers at the end of each period, what was smoothed in it, see `core.control.smoothing`,
        and the moment it was simulated in; row 0: the start.
    count : int
        How many of the rows are in use. Those behind belong to nobody.
    saved : int
        How many of those the file has, as a take.
    """

    start: bytes
    first: int
    rows: Floats
    count: int
    saved: int = 0

    @classmethod
    def begin(cls, snapshot: bytes, period: int, pose: Floats, tick: int) -> Recording:
        """Return a recording that has nothing but its start.

        Parameters
        ----------
        snapshot : bytes
            The state at the start.
        period : int
            Its period.
        pose : ndarray (f, 7)
            Of the fingertips then.
        tick : int
        """
        rows = np.empty((256, pose.size + ORDER + 1))
        rows[0] = *pose.ravel(), *np.zeros(ORDER), tick
        return cls(snapshot, period, rows, 1)

    @property
    def path(self) -> Floats:
        """Poses, shape (t + 1, f, 7): `simulate_path` simulates them again bit for bit."""
        return self.rows[: self.count, : -ORDER - 1].reshape(self.count, -1, 7)

    @property
    def smoothing(self) -> Floats | None:
        """What was smoothed in each period, shape (t, 4); None: nothing in any."""
        orders = self.rows[1 : self.count, -ORDER - 1 : -1]
        return orders if orders.any() else None

    @property
    def unsaved(self) -> bool:
        """Whether something was recorded that the file does not have."""
        return self.count > max(self.saved, 1)

    def extend(self, path: Floats, tick: int, smoothing: Floats | None = None) -> Recording:
        """Return the recording with the poses of some more periods, shape (k, f, 7).

        Parameters
        ----------
        path : ndarray (k, f, 7)
            Poses at the ends of the periods.
        tick : int
        smoothing : ndarray (k, 4), optional
            What was smoothed in them; nothing when left out.
        """
        end = self.count + len(path)
        rows = self.rows
        if end > len(rows):
            rows = np.empty((2 * end, self.rows.shape[1]))
            rows[: self.count] = self.rows[: self.count]
        rows[self.count : end, : -ORDER - 1] = path.reshape(len(path), -1)
        rows[self.count : end, -ORDER - 1 : -1] = 0.0 if smoothing is None else smoothing
        rows[self.count : end, -1] = tick
        return replace(self, rows=rows, count=end)

    def cut_at_tick(self, tick: int, period: int) -> Recording | None:
        """Return the recording as it was at a moment undo came back to; None when it did not lead there.

        Parameters
        ----------
        tick : int
        period : int
            Of the state at that tick.
        """
        count = int(np.searchsorted(self.rows[: self.count, -1], tick, side="right"))
        return self._first(count) if count and count - 1 == period - self.first else None

    def cut_at_period(self, period: int) -> Recording | None:
        """Return the recording up to a period of its own; None when that is before its start."""
        count = period - self.first + 1
        return self._first(count) if 0 < count <= self.count else None

    def _first(self, count: int) -> Recording:
        """Return the recording with its first rows alone."""
        return replace(self, count=count, saved=min(self.saved, count))


@dataclass(frozen=True, eq=False)
class Running:
    """Live session at one instant; replaced by another value at each tick.

    Attributes
    ----------
    uid : int
        `session_uid` of the bed.
    name : str
        Of the bed, for messages.
    scene : Scene
    system : System
    state : State
        Used up by the next tick: read what you need, keep nothing of it.
    snapshot : bytes
        The state by `core.session.snapshot`; also in the bed's property.
    pose : ndarray (7,)
        The fingertip's, up to which the session has followed it.
    tick : int
        Counts ticks and never goes back, not even by undo.
    paused : bool
        By the user.
    blocking_reason : str
        Why the session stands still although it is not paused; empty: it does not.
    stale : int
        Ticks until the state undo or redo has put into the bed is taken up; 0: there is none.
    steps : int
        Single control periods asked for while paused.
    clock : Clock
    trace : Trace
        Total force, set point and heights of picked pins in the last seconds.
    monitor : ErrorMonitor or None
    errors : Errors or None
        Latest estimate.
    gestures : tuple of Gesture
        The last ones, oldest first.
    next_gesture : Gesture or None
        The gesture that begins if the finger touches.
    rest_time : float
        How long the finger has not moved, s of simulated time.
    recording : Recording or None
    strokes : tuple of Stroke
        What the Press tool has drawn and the finger has not finished, oldest first: the finger goes along
        these, wherever the fingertip is.
    stroke_start : Gesture or None
        Where the first of them began.
    finished_strokes : int
        How many strokes the finger has finished.
    last_place : (float, float) or None
        Where the last of those ended, x and y, m.
    settings : tuple or None
        Settings of the bed, as Blender stores them, of which `scene` was made; None: they are not known.
    """

    uid: int
    name: str
    scene: Scene
    system: System
    state: State
    snapshot: bytes
    pose: Floats
    tick: int
    clock: Clock
    trace: RecentTrace
    monitor: ErrorMonitor | None
    errors: Errors | None = None
    paused: bool = False
    blocking_reason: str = ""
    stale: int = 0
    steps: int = 0
    gestures: tuple[Gesture, ...] = ()
    next_gesture: Gesture | None = None
    rest_time: float = 0.0
    recording: Recording | None = None
    strokes: tuple[Stroke, ...] = ()
    stroke_start: Gesture | None = None
    finished_strokes: int = 0
    last_place: tuple[float, float] | None = None
    settings: tuple[Any, ...] | None = None

    @property
    def factor(self) -> float:
        """Real-time factor of the last second: 1 keeps up; 0 while it stands still."""
        return self.clock.factor

    @property
    def path(self) -> Floats | None:
        """Recorded poses (t + 1, f, 7), row 0 the start; None when nothing is recorded."""
        return self.recording.path if self.recording else None


#: The sessions by the uid of their bed: what this Blender is doing, not what a file holds.
_SESSIONS: dict[int, Running] = {}


def find(bed: Any) -> Running | None:
    """Return the session of a bed's object, or None."""
    return _SESSIONS.get(bed.session_uid) if bed is not None else None


def list_sessions() -> tuple[Running, ...]:
    """Return all sessions, in the order they were started."""
    return tuple(_SESSIONS.values())


def put(running: Running) -> None:
    """Make a value the present one of its bed's session."""
    _SESSIONS[running.uid] = running


def drop(uid: int) -> Running | None:
    """Forget a session; return what it was."""
    return _SESSIONS.pop(uid, None)


#: What was told last: some of it cannot be reported where it happens, such as while a file is loaded.
_SAID = [""]


def set_message(words: str) -> None:
    """Keep the last message, for the Session panel."""
    _SAID[0] = words


def last_message() -> str:
    """Return the last message."""
    return _SAID[0]
