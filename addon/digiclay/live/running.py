"""Live sessions and their beds, as values; no Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..core.base.arrays import Floats
from ..core.session.accuracy import ErrorMonitor, Errors
from ..core.session.live_session import Clock, LiveSession, Moment, Recording
from ..core.session.recent_trace import RecentTrace
from .stroke import Stroke

__all__ = [
    "Moment", "Recording", "Running", "drop", "find", "last_message", "list_sessions", "put",
    "set_message",
]  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class Running(LiveSession):
    """Live session at one instant; replaced by another value at each tick.

    Attributes
    ----------
    uid : int
        `session_uid` of the bed.
    name : str
        Of the bed, for messages.
    snapshot : bytes
        The state by `core.session.snapshot`; also in the bed's property.
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
    trace : Trace
        Total force, set point and heights of picked pins in the last seconds.
    errors : Errors or None
        Latest estimate.
    gestures : tuple of Moment
        The last ones, oldest first.
    next_gesture : Moment or None
        The gesture that begins if the finger touches.
    rest_time : float
        How long the finger has not moved, s of simulated time.
    strokes : tuple of Stroke
        What the Press tool has drawn and the finger has not finished, oldest first: the finger goes along
        these, wherever the fingertip is.
    stroke_start : Moment or None
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
    snapshot: bytes
    tick: int
    clock: Clock
    trace: RecentTrace
    monitor: ErrorMonitor | None
    errors: Errors | None = None
    paused: bool = False
    blocking_reason: str = ""
    stale: int = 0
    steps: int = 0
    gestures: tuple[Moment, ...] = ()
    next_gesture: Moment | None = None
    rest_time: float = 0.0
    strokes: tuple[Stroke, ...] = ()
    stroke_start: Moment | None = None
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


#: What was told last, and the uids of the beds it is about; none: of a closed file's. Some of it cannot be
#: reported where it happens, such as while a file is loaded.
_SAID: list[tuple[str, tuple[int, ...]]] = [("", ())]


def set_message(words: str, *uids: int) -> None:
    """Keep the last message, for the Session panels of the beds that it is about, or of all."""
    _SAID[0] = words, uids


def last_message(bed: Any = None) -> str:
    """Return the last message; for a bed's panel, unless it is about others."""
    words, uids = _SAID[0]
    return words if bed is None or not uids or bed.session_uid in uids else ""
